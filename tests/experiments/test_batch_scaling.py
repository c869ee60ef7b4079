"""Many trains in one program: the small size runs, and the stored table says where it was made."""

import json

import pytest

from experiments import batch_scaling


def test_small_size(tmp_path):
    content = batch_scaling.main("small", tmp_path)
    assert [(row["trains"], row["cams"], row["speeds"]) for row in content["rows"]] == 2 * [(2, 1, 5), (1, 2, 2)]
    assert all(
        row["motion_ms"] > 0.01 and row["gradient_processor_ms"] > row["motion_processor_ms"] for row in content["rows"]
    )
    assert 0.0 < content["float32_error_N"] < 100.0  # of forces of a thousand newtons


def test_the_stored_result():
    content = json.loads((batch_scaling.RESULTS / "batch_scaling.json").read_text())
    rows = {(row["precision"], row["trains"], row["cams"], row["speeds"]): row for row in content["rows"]}
    by_train = {(n, 1, batch_scaling.SPEEDS) for n in batch_scaling.TRAINS["full"]}
    by_cam = {(1, *cams) for cams in batch_scaling.CAMS["full"]}
    assert set(rows) == {(p, *n) for p in batch_scaling.PRECISIONS for n in by_train | by_cam}
    assert content["device"] == "cpu"  # the page says that no accelerator was at hand
    one, many = (rows["float64", n, 1, batch_scaling.SPEEDS]["motion_processor_ms"] for n in (1, 64))
    assert many < 0.8 * one  # a batch pays


@pytest.mark.parametrize("seconds", [0.01])
def test_the_least_time_is_that_of_the_call(seconds):
    import time

    found = batch_scaling.least(time.sleep, seconds)
    assert seconds <= found["ms"] and found["processor_ms"] < seconds  # it sleeps
