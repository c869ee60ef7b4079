"""Gradient ascent from a Polydyne on `motori-1`, at small size."""

from experiments import gradient_ascent


def test_ascents_climb_below_their_bounds(tmp_path):
    content = gradient_ascent.main("small", tmp_path)
    calm, bouncing = content["calm"], content["bouncing"]
    for name, row in calm["ascents"].items():
        assert row["confirmed"] and row["area_ratio"] <= calm["area_ratio_of_the_shape"] + 1e-9, name
    assert bouncing["area_ratio_no_jump"] < bouncing["area_ratio_of_the_shape"]
    assert all(row["share_at_the_start"] > 50 for row in bouncing["ascents"].values())
    assert bouncing["ascents"]["adam 1e-3"]["largest_share"] < 50
    assert {path.name for path in tmp_path.iterdir()} == {"gradient_ascent.json"}
