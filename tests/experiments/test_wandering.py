"""Motions about the speed at which a drawn cam first breaks a limit, against more of their revolutions."""

from experiments import wandering


def test_no_motion_is_falsely_periodic_and_no_range_is_left(tmp_path):
    content = wandering.main("small", tmp_path)
    assert content["pairs"] == len(wandering.ABOUT) and 0 < content["called_periodic"] == content["rest"]
    assert content["falsely_periodic"] == 0 and content["ranges_left"] == 0
    assert {p.name for p in tmp_path.iterdir()} == {"wandering.json"}
