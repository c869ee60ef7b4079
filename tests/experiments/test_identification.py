"""The experiment on identification: its small size, and what its stored result says."""

import json

from experiments import identification


def test_small_size(tmp_path):
    content = identification.main("small", tmp_path)
    (fit,) = content["fits"]
    rows = {row["parameter"]: row for row in fit["parameters"]}
    assert not rows.pop("spring.damping_N_s_per_m")["identified"]
    assert all(row["identified"] for row in rows.values()) and not fit["remarks"]
    # six correlated intervals of 95 %: two that miss would be a surprise
    assert content["motori-1"]["covered"] >= 5
    assert abs(rows["valve.mass_kg"]["estimate"] / 0.24 - 1) < 0.08 < abs(rows["valve.mass_kg"]["start"] / 0.24 - 1)
    assert (tmp_path / "identification.json").is_file()


def test_stored_result_holds_what_it_says():
    stored = json.loads((identification.RESULTS / "identification.json").read_text())
    assert stored["provenance"]["command"] == "python -m experiments.identification full"
    for name in identification.CASES:
        rows = [r for f in stored["fits"] if f["scene"] == name for r in f["parameters"]]
        covered = sum(r["identified"] and r["low"] <= r["truth"] <= r["high"] for r in rows)
        known = sum(r["identified"] for r in rows)
        assert (covered, known) == (stored[name]["covered"], stored[name]["intervals"])
        # at least 85 % of intervals of 95 %: those of one noise are correlated, so the binomial bound is not the one
        assert covered >= 0.85 * known and known >= 30
