"""The experiment on real trains at its small size: one scene to a verdict, with the literature's cams beside it."""

from experiments import real_trains


def test_the_small_size(tmp_path):
    content = real_trains.main("small", tmp_path)
    (found,) = (content[name] for name in real_trains.SCENES["small"])
    assert found["verdict"] == "confirmed" and found["broken"] == []
    assert 0.57 < found["area_ratio"] <= found["bound"]
    assert found["beside"]["multi-pol"]["used_part_of_a_limit"] > 1.0
    assert isinstance(found["beside"]["polydyne"], str), "its plain member breaks the acceleration limit"
    assert (tmp_path / "real_trains.json").is_file()
