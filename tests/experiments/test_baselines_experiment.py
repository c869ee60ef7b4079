"""The experiment on baselines: its small size, and what its stored result says."""

import json

from camopt.cam.families.registry import FAMILIES
from experiments import baselines


def test_small_size(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(baselines, "SMALL", ("trapezoid",))
    baselines.main("small", tmp_path)
    (row,) = json.loads((tmp_path / "baselines.json").read_text())["baselines"]
    assert (row["family"], row["limits"], row["evaluations"]) == (
        "trapezoid",
        "no-jerk",
        baselines.EVALUATIONS["small"],
    )
    assert row["holds"] == (row["bounce_mm"] <= 0.05)
    assert 0.4 < row["area_ratio"] < 0.65082
    assert row["says"] in capsys.readouterr().out


def test_stored_result_holds_what_it_says():
    stored = json.loads((baselines.RESULTS / "baselines.json").read_text())
    rows = stored["baselines"]
    assert {r["family"].partition(":")[0] for r in rows} <= set(FAMILIES)
    for row in rows:
        assert row["holds"] == ("least reached" not in row["says"] and "within the limits on" not in row["says"])
        if row["holds"]:
            assert row["bounce_mm"] <= stored["bounce_limit_mm"]
            assert row["area_ratio"] < (0.6180 if row["limits"] == "all" else 0.65082)  # camopt bound; bang-bang
            assert row["limits"] == "no-jerk" or row["jerk_max_mm_per_deg3"] <= 0.003 * (1 + 1e-9)
