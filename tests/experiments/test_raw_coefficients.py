"""Gradients by all coefficients of a cam: the paths differ along steps of the lift, and along nothing else."""

import json

import numpy as np
import pytest

import camopt
from experiments import raw_coefficients


def check(content: dict) -> None:
    for row in content["rows"]:
        if row["directions"] == "lift and velocity continuous":
            assert row["cosine"] > 1 - 1e-7 and row["difference"] < 3e-4  # a layer of 2e-9 m leaves a few 1e-5
        if row["directions"] == "all":
            assert row["difference"] > 0.05


def test_small_size(tmp_path):
    check(raw_coefficients.main("small", tmp_path))


def test_the_stored_result():
    content = json.loads((raw_coefficients.RESULTS / "raw_coefficients.json").read_text())
    check(content)
    assert {row["scene"] for row in content["rows"]} == set(raw_coefficients.CASES["full"])


@pytest.mark.parametrize(("orders", "most"), [((), 1e9), ((0,), 1e-12), ((0, 1), 1e-12)])
def test_directions_have_no_step(orders, most):
    scene = camopt.load_scene("motori-1")
    cam = camopt.polydyne(scene)
    along, widths = raw_coefficients.continuous(cam, orders), np.diff(cam.borders)
    assert along @ along.T == pytest.approx(np.eye(len(along)), abs=1e-12)
    change = along[-1].reshape(cam.coefficients.shape)  # of coefficients times powers of the widths
    ends, starts = change.sum(axis=1), np.roll(change[:, 0], -1)
    assert np.abs(ends - starts).max() < most
    if 1 in orders:
        slopes = (change * np.arange(change.shape[1])).sum(axis=1) / widths
        assert np.abs(slopes - np.roll(change[:, 1] / widths, -1)).max() < 1e-10 / widths.min()
