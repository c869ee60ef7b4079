"""Band sweeps, on a motion whose figures are known functions of the speed and on the built-in scene."""

import numpy as np
import pytest

from camopt.cam.families.polydyne import polydyne
from camopt.exact import settled_metrics
from camopt.measure import sweep as module
from camopt.measure.resonance import Resonance
from camopt.measure.sweep import SpeedCache, first_exceeding, reserve_sentences, sweep
from camopt.scene import QUANTITIES, load_scene

SCENE = load_scene("kodama")


@pytest.fixture
def known(monkeypatch):
    """Figures as functions of the crankshaft speed; returns the table to fill."""
    table = {}

    def figures(many, scene, lift, speeds_rpm):
        return [{name: table.get(name, lambda _: 1.0)(rpm) for name in QUANTITIES} for rpm in speeds_rpm]

    monkeypatch.setattr(module, "at_speeds", figures)
    return table


def test_worst_speed_is_found_to_1_rpm(known):
    known["bounce_mm"] = lambda rpm: 0.3 - ((rpm - 6463) / 1000) ** 2
    known["contact_force_min_N"] = lambda rpm: 10 + abs(rpm - 5333)
    band = sweep(SpeedCache(None, SCENE, None), 100.0, ("bounce_mm", "contact_force_min_N"))
    assert band.worst("bounce_mm") == pytest.approx((6463.0, 0.3))
    assert band.worst("contact_force_min_N") == pytest.approx((5333.0, 10.0))
    assert (band.from_rpm, band.to_rpm, band.step_rpm) == (5000.0, 7000.0, 100.0)
    assert np.all(np.diff(band.speeds_rpm) > 0)
    assert {5000.0, 5100.0, 6900.0, 7000.0} <= set(band.speeds_rpm)


def test_a_valve_that_does_not_seat_is_the_worst(known):
    known["bounce_mm"] = lambda rpm: np.nan if rpm == 5200 else 1.0
    speed, value = sweep(SpeedCache(None, SCENE, None), 100.0).worst("bounce_mm")
    assert speed == 5200.0 and np.isnan(value)


def test_starting_speeds_to_10_rpm(known):
    known["bounce_mm"] = lambda rpm: 0.0 if rpm < 6123 else 0.2
    known["jump_mm"] = lambda rpm: 0.0
    found = first_exceeding(SpeedCache(None, SCENE, None), {"bounce_mm": 0.05, "jump_mm": 0.05})
    assert found["jump_mm"] is None
    assert 6123 <= found["bounce_mm"] <= 6133
    known["bounce_mm"] = lambda rpm: 0.2 if rpm > 10_480 else 0.0  # the band ends at 7000: looked at up to 10 500
    assert 10_480 < first_exceeding(SpeedCache(None, SCENE, None), {"bounce_mm": 0.05})["bounce_mm"] <= 10_490
    known["bounce_mm"] = lambda rpm: 0.2
    assert first_exceeding(SpeedCache(None, SCENE, None), {"bounce_mm": 0.05})["bounce_mm"] == 2500.0


def test_the_three_worst_peaks_are_refined_and_not_the_largest_alone(known):
    def peaks(rpm):
        return sum(height * max(0.0, 1 - abs(rpm - at) / 40) for at, height in ((5230, 1.0), (5930, 0.9), (6630, 0.8)))

    known["bounce_mm"] = peaks
    found = sweep(SpeedCache(None, SCENE, None), 100.0)
    heights = dict(zip(found.speeds_rpm, found.figures["bounce_mm"], strict=True))
    assert [heights[s] for s in (5230.0, 5930.0, 6630.0)] == pytest.approx([1.0, 0.9, 0.8])


def test_the_grid_looks_at_resonances_between_its_steps(known):
    known["jump_mm"] = lambda rpm: 1.0 if 6444 < rpm < 6450 else 0.0  # 6 r/min wide
    narrow = Resonance(6447.0, 6446.9, 6447.1, 3.0, 7, 376.0, 1e-3)
    assert sweep(SpeedCache(None, SCENE, None), 100.0, ("jump_mm",)).worst("jump_mm")[1] == 0.0
    speed, value = sweep(SpeedCache(None, SCENE, None), 100.0, ("jump_mm",), [narrow]).worst("jump_mm")
    assert value == 1.0 and 6444 < speed < 6450


def test_the_search_for_starts_and_the_band_know_the_same_speeds(known):
    known["bounce_mm"] = lambda rpm: 1.0 if 6443 < rpm < 6449 else 0.0  # a window between the search's 40 r/min
    swept = SpeedCache(None, SCENE, None)
    swept([6445.0])
    assert 6443 <= first_exceeding(swept, {"bounce_mm": 0.05})["bounce_mm"] <= 6453
    known["bounce_mm"] = lambda rpm: 1.0 if 6418 < rpm < 6424 else 0.0  # 6420 is a speed of that search, not of a band
    swept = SpeedCache(None, SCENE, None)
    first_exceeding(swept, {"bounce_mm": 0.05})
    assert 6418 < sweep(swept, 100.0).worst("bounce_mm")[0] < 6424


def test_every_speed_has_its_own_figures_at_its_place():
    lift = polydyne(SCENE)
    speeds = [5000.0, 5200.0, 5100.0]
    together = module.at_speeds(settled_metrics, SCENE, lift, speeds)
    for speed, row in zip(speeds, together, strict=True):
        assert module.at_speeds(settled_metrics, SCENE, lift, [speed]) == [row]
    assert together[0]["seating_velocity_m_per_s"] != together[1]["seating_velocity_m_per_s"]


def test_the_step_about_a_peak_is_quartered_until_it_is_the_finest(known):
    known["bounce_mm"] = lambda rpm: -abs(rpm - 6000.0)
    looked = set(sweep(SpeedCache(None, SCENE, None), 64.0).speeds_rpm)
    nearest = min(looked, key=lambda rpm: abs(rpm - 6000.0))
    assert nearest == 6000.0
    first = min(np.arange(5000.0, 7000.0, 64.0), key=lambda rpm: abs(rpm - 6000.0))
    assert {first + 16.0 * k for k in range(-3, 4)} <= looked
    second = min((first + 16.0 * k for k in range(-3, 4)), key=lambda rpm: abs(rpm - 6000.0))
    assert {second + 4.0 * k for k in range(-3, 4)} <= looked
    assert {6000.0 + k for k in range(-3, 4)} <= looked


@pytest.mark.parametrize(
    ("starts", "design", "says"),
    [
        ({"jump": 7620.0}, {"jump_max_mm": 0.02}, ["Jump exceeds 0.02 mm from 7620 r/min on, 0.3 % above the band."]),
        ({"bounce": 3990.0}, {}, ["Bounce exceeds 0.05 mm from 3990 r/min on, below the band."]),
        ({"bounce": 5000.0}, {"bounce_max_mm": None}, ["Bounce exceeds 0.05 mm from 5000 r/min on, within the band."]),
        ({"jump": None}, {}, ["Jump does not exceed 0.05 mm below 1.5 times the band's top."]),
        ({}, {}, []),
    ],
)
def test_what_is_kept_beyond_the_band_is_said_with_the_scenes_own_limits(starts, design, says):
    starts = {f"first_{name}_rpm": speed for name, speed in starts.items()}
    assert reserve_sentences(starts, design, (4000.0, 7600.0)) == says


def test_judged_speeds_replace_those_of_the_sweep_and_join_it_within_the_band(known):
    band = sweep(SpeedCache(None, SCENE, None), 1000.0, ())
    judged = dict.fromkeys((4990.0, 5000.0, 5500.0, 7000.0, 7010.0), dict.fromkeys(QUANTITIES, 2.0))
    found = band.with_judged("rkg", judged)
    assert found.speeds_rpm.tolist() == [5000.0, 5500.0, 6000.0, 7000.0]
    assert found.figures["bounce_mm"].tolist() == [2.0, 2.0, 1.0, 2.0]
    assert found.methods == {5000.0: "rkg", 5500.0: "rkg", 6000.0: "event", 7000.0: "rkg"}
