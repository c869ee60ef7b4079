"""`camopt gradient`: the verdict's criteria, one report of a small train, and the command around it."""

import json

import numpy as np
import pytest

from camopt.cam.families.polydyne import polydyne
from camopt.cli.parser import main
from camopt.scene import load_scene
from camopt.smooth.simulate import EPS
from camopt.study.gradient import report as study
from camopt.study.gradient.paths import METRICS, PathGradients, exact_gradients, problem, repeated_cosines
from camopt.study.gradient.report import disagreement, judge, relative_errors, verdict

SLOPES = np.array([[1.0, 2.0], [1.0, 2.0 + 1e-4], [0.5, 2.0]])
HEIGHTS = 1e-6, 1e-7, 1e-8


def judged(gradient, differences=SLOPES, truth=3.0, value=3.0, repeated=None):
    found = PathGradients(np.array([value]), np.array([gradient]), np.array([2.0]))
    return judge(0, truth, np.asarray(differences), HEIGHTS, found, {EPS: found}, repeated)


def test_sign_factor_and_zero_are_told_from_a_right_gradient():
    right, double, flipped = (judged([factor, 2.0 * factor]) for factor in (1.0, 2.0, -1.0))
    assert right["verdict"] == "trust"
    assert (right["exact"]["relative_error"], right["exact"]["cosine"]) == (0.0, pytest.approx(1.0))
    assert double["verdict"] == "direction only"
    assert double["exact"]["relative_error"] == pytest.approx(1.0, rel=0.2)
    assert flipped["verdict"] == judged([0.0, 0.0])["verdict"] == judged([np.nan, 1.0])["verdict"] == "none"
    assert flipped["exact"]["cosine"] < -0.9
    refused = judged([2.0, 4.0], [[np.nan, np.nan], *SLOPES[:2]])  # at the first height
    assert refused["verdict"] == "direction only" and refused["agreement"] < 1e-3


@pytest.mark.parametrize(
    ("gradient", "differences", "value", "reason"),
    [
        ([1.0, 2.0], [[1.0, 2.0], [-1.0, 5.0], [4.0, 0.0]], 3.0, "agree at no height"),
        ([0.0, 0.0], np.zeros((3, 2)), 0.0, "zero all around"),
        ([1.0, 2.0], np.full((3, 2), np.nan), np.nan, "never seats"),
    ],
)
def test_rough_still_and_missing_metrics_have_no_gradient(gradient, differences, value, reason):
    found = judged(gradient, differences, value, value)
    assert found["verdict"] == "none" and reason in found["reason"]


def test_a_motion_that_does_not_repeat_itself_is_not_trusted():
    found = [judged([1.0, 2.0], repeated=cosine)["verdict"] for cosine in (0.95, 0.5, np.nan)]
    assert found == ["direction only", "none", "none"]
    assert (verdict(1e-3, 1.0), verdict(2e-2, 1.0)) == ("trust", "direction only")


def test_bias_errors_and_disagreement():
    assert judged([1.0, 2.0], value=3.3)["smooth"][0]["value_bias"] == pytest.approx(0.1)
    assert relative_errors(np.array([3.0, 4.0]), np.array([[3.0, 0.0], [0.0, 0.0]])) == pytest.approx([4 / 3, np.inf])
    assert disagreement(np.array([[2.0], [1.0], [1.1]])) == pytest.approx(0.1 / 1.1)


@pytest.fixture(scope="module")
def report():
    scene = load_scene("motori-1")
    return study.gradient_report(scene, polydyne(scene), max(scene.operation.speeds_rpm), bumps=2, widths=(EPS,))


def test_both_paths_are_right_on_a_train_of_one_mass(report):
    assert report["settled"]
    assert report["spectral_radius"] < 1.0
    moving = {n: m for n, m in report["metrics"].items() if m["verdict"] == "trust"}
    assert {"contact_force_max_N", "seating_velocity_m_per_s", "dynamic_area_mm_deg"} <= set(moving)
    for name, metric in moving.items():
        assert metric["exact"]["relative_error"] < 1e-5, name
        assert metric["smooth"][0]["relative_error"] < 1e-2, name
        assert metric["smooth"][0]["value_bias"] < 5e-3, name
        assert 1.0 < metric["exact"]["cost_ratio"] < 10.0, name


def test_the_command_writes_the_contract(report, monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(study, "gradient_report", lambda scene, lift, speed, progress: report)
    file = tmp_path / "gradient.json"
    words = ["gradient", "motori-1", "--cam", "polydyne", "--speed", "3000", "--json", str(file), "--quiet"]
    assert main(words) == 0
    content = json.loads(file.read_text())
    assert tuple(content["metrics"]) == METRICS
    one = content["metrics"]["dynamic_area_mm_deg"]
    assert {"relative_error", "cosine", "cost_ratio"} <= set(one["exact"])
    assert {"eps_m", "value_bias", "cosine", "relative_error", "cost_ratio"} <= set(one["smooth"][0])
    assert one["verdict"] in ("trust", "direction only", "none")
    shown = capsys.readouterr().out
    assert f"dynamic_area_mm_deg = {one['value']:.6g}: {one['verdict']}" in shown
    assert "nearest grazing" in shown


def test_gradients_of_a_settled_motion_repeat_and_of_a_chaotic_one_do_not():
    scene = load_scene("kodama")
    lift, at = polydyne(scene, (2, 6, 10, 14, 18), design_speed_rpm=7000), METRICS.index("seating_velocity_m_per_s")
    calm, *wild = (problem(scene, lift, rpm, 4) for rpm in (5000, 6950, 7000, 7050))
    assert calm.settled
    assert not any(p.settled for p in wild)
    assert repeated_cosines(calm, exact_gradients(calm)[0].gradients)[at] > 0.999
    # where the motion is chaotic each cosine is a draw, which the last digit of the motion decides
    assert np.median([repeated_cosines(p, exact_gradients(p)[0].gradients)[at] for p in wild]) < 0.9


@pytest.mark.long
def test_under_curved_laws_both_paths_are_judged_by_dop853():
    scene = load_scene("kodama-hertz")
    report = study.gradient_report(scene, polydyne(scene), 5000, bumps=1, widths=(EPS,))
    assert "DOP853" in report["truth"]
    area, force = (report["metrics"][name] for name in ("dynamic_area_mm_deg", "contact_force_min_N"))
    assert area["exact"]["relative_error"] < 1e-4
    assert 1e-6 < area["exact"]["value_bias"] < 1e-4  # that of the chords
    for metric in (area, force):
        assert metric["smooth"][0]["relative_error"] < 1e-4
        assert metric["smooth"][0]["value_bias"] < 1e-4
    # a chord is not the tangent of its law
    assert (area["verdict"], force["verdict"]) == ("trust", "direction only")
