"""Cost of a Jacobian: each number that grows is counted, and the time grows with the speeds."""

import json

from experiments import jacobian_cost


def test_small_size(tmp_path):
    content = jacobian_cost.main("small", tmp_path)
    counts = {(row["source"], row["by"]): [] for row in content["rows"]}
    for row in content["rows"]:
        counts[row["source"], row["by"]].append(row["count"])
    for source in jacobian_cost.SOURCES:
        assert counts[source, "masses"] == [10, 1]
        assert counts[source, "speeds"] == counts[source, "trains"] == [1, 2]
        assert counts[source, "coefficients"] == [23, 47]  # of an event of 162 deg, less four conditions
    assert (tmp_path / "jacobian_cost.json").is_file()


def test_the_stored_result():
    content = json.loads((jacobian_cost.RESULTS / "jacobian_cost.json").read_text())
    powers = {(row["source"], row["by"]): row["power"] for row in content["powers"]}
    for source in jacobian_cost.SOURCES:
        assert 0.5 < powers[source, "speeds"] < 1.5
        few, *_, many = (row for row in content["rows"] if (row["source"], row["by"]) == (source, "coefficients"))
        assert many["ms"] / few["ms"] < many["count"] / few["count"]  # a column more costs less than its share
