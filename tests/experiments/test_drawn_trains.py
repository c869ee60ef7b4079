"""The drawn trains at small size: settled, all metrics, and as the slow path has them."""

from experiments import drawn_trains


def test_the_fast_path_agrees_on_drawn_trains(tmp_path):
    content = drawn_trains.main("small", tmp_path)
    for name, count in {"held": 60, "polydyne": 6}.items():
        row = content["cams"][name]
        assert row["motions"] == count and row["refused"] == 0
        assert row["within_stated_error"] and row["contacts_keep"] > 0 and row["periodic_in_one_only"] == 0
    assert content["cams"]["held"]["periodic"] >= 55
    assert {p.name for p in tmp_path.iterdir()} == {"drawn_trains.json", "drawn_trains-bounce.png"}
