"""The experiment on the flat follower: the published pair of noses, and the published range of the film."""

import pytest

from experiments import flat_follower


def test_the_published_numbers_come_out(tmp_path):
    found = flat_follower.main("small", tmp_path)
    sharp, blunt = found["noses"]
    assert 1 - blunt["stress_of_the_sharp"] / sharp["stress_of_the_sharp"] == pytest.approx(0.338, abs=5e-4)  # 34 %
    assert abs(blunt["entrainment_mm"]) < 1e-9 < abs(sharp["entrainment_mm"])
    film = found["film"]
    assert 4 < film["flanks"] < 6.5 and 0.2 < film["nose"] < 0.4
    assert (tmp_path / "flat_follower-nose.png").stat().st_size > 10_000
