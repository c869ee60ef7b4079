"""What the first revolutions say of the settled motion, at small size and as stored: the objective's default."""

import json

from camopt.optimizer.ascent.objective import REPRESENTATIVE
from experiments import first_revolutions
from experiments.support.record import RESULTS


def test_where_nothing_surges_every_revolution_is_like_the_settled_one(tmp_path):
    content = first_revolutions.main("small", tmp_path)
    assert content["figures"] == 2 * content["motions"] and 0 < content["broken"] < content["figures"]
    for row in content["rows"]:
        assert row["missed"] == row["invented"] == 0
        assert row["near_percent"] == 100.0 and 0.8 < row["least_share"] <= 1.0 + 1e-9


def test_the_objective_takes_the_first_revolution_that_stands_for_the_settled_motion():
    rows = json.loads((RESULTS / "first_revolutions.json").read_text())["rows"]
    stands = [row["revolution"] for row in rows if row["near_percent"] > 98.0 and row["least_share"] > 0.75]
    assert stands[0] == REPRESENTATIVE and rows[0]["least_share"] < 0.1
