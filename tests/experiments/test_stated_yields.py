"""What a job says of trains as built, put to the test: the small size, and what the full size left."""

import json

import pytest

from experiments import stated_yields


@pytest.mark.long
def test_small_size(tmp_path):
    content = stated_yields.main("small", tmp_path)
    (row,) = content["scenes"].values()
    assert row["differs"] == 0 and row["open"] < row["judged"] == 3
    assert content["coverage"]["population"] == 60 and 0.93 <= content["coverage"]["covered"] <= 1.0


def test_no_verdict_differs_and_the_interval_covers():
    content = json.loads((stated_yields.RESULTS / "stated_yields.json").read_text())
    assert list(content["scenes"]) == list(stated_yields.SCENES["full"])
    for row in content["scenes"].values():
        assert row["judged"] == 20 and row["differs"] == 0 and row["open"] <= 5
    found = content["coverage"]
    assert found["population"] == 4000 and 0.93 <= found["covered"] <= 0.98
    assert found["covered"] == pytest.approx(found["expected"], abs=3 * (0.05 * 0.95 / 200) ** 0.5)
