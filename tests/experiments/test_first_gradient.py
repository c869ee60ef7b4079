"""Time to the first gradient: the second process takes its programs from where the first left them."""

import json

import pytest

from experiments import first_gradient


def check(rows: list[dict]) -> None:
    for first, second in zip(rows[::2], rows[1::2], strict=True):
        assert (first["process"], second["process"]) == first_gradient.PROCESSES
        assert second["processor_s"] < 0.8 * first["processor_s"]  # of linear trains it is less than a half
        assert first["lines"] >= 1


@pytest.mark.long
@pytest.mark.timeout(600)
def test_small_size(tmp_path):
    check(first_gradient.main("small", tmp_path)["rows"])


def test_the_stored_result():
    rows = json.loads((first_gradient.RESULTS / "first_gradient.json").read_text())["rows"]
    check(rows)
    assert {row["scene"] for row in rows} == set(first_gradient.SCENES["full"])
