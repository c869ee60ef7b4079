"""The verdict: agreement, limits, neighbourhood, and the contract's verification.json."""

import json
import time
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from camopt.cam.families.polydyne import polydyne
from camopt.exact import engine
from camopt.scene import InputError, load_scene
from camopt.verifier import verdict
from camopt.verifier.at_speed import FAR, HALVED, ONE_STEP, against_limits, agreement, violates_by_margin
from camopt.verifier.convergence import Tolerances, figures_of
from camopt.verifier.display import COLUMNS
from camopt.verifier.verdict import verdict_on
from tests.verifier.answers import answer
from tests.verifier.scenes import moving

AT_2_UM = Tolerances(2.0)
AT_5000 = {"speeds_rpm": (5000.0,), "band_step_rpm": None, "tolerances": Tolerances(halvings=2)}


@cache
def lift():
    return polydyne(load_scene("kodama"))


def scene(**limits):
    return moving("kodama", **limits)


def test_agreement_needs_two_converged_methods_whose_intervals_meet():
    assert agreement([answer(), answer(bounce_mm=0.1029)], AT_2_UM)
    # 0.5 (0.002 + 1 %) each, above the errors of 0.001
    assert not agreement([answer(), answer(bounce_mm=0.1031)], AT_2_UM)
    assert agreement([answer(error=0.006), answer(bounce_mm=0.104)], AT_2_UM)  # halving moved it by half of that
    assert agreement([answer(0.098, 0.102), answer(bounce_mm=0.1045)], AT_2_UM)
    assert not agreement([answer()], AT_2_UM)
    assert not agreement([answer(), answer(converged=False)], AT_2_UM)
    assert agreement([answer(), answer(impact_velocity_m_per_s=9.0)], AT_2_UM)  # carries no limit
    assert not agreement([answer(), answer(contact_force_max_N=9.0)], AT_2_UM)


def test_not_seating_agrees_only_with_not_seating():
    lost = answer(bounce_mm=np.nan, seating_velocity_m_per_s=np.nan)
    assert agreement([lost, lost], AT_2_UM)
    assert not agreement([lost, answer()], AT_2_UM) and not agreement([answer(), lost], AT_2_UM)
    parted = replace(lost, range=lost.range | {"jump_mm": (9.0, 9.0)})
    assert agreement([lost, parted], AT_2_UM)  # no seat is the answer, and the jump beside it decides nothing
    assert not agreement([lost, replace(lost, converged=False)], AT_2_UM)


def test_a_limit_is_broken_only_beyond_error_and_neighbours():
    limited = scene(jump_max_mm=None, seating_velocity_max_m_per_s=None)

    def against(value, error, neighbour):
        return against_limits(limited, 6000.0, answer(value, error=error), [figures_of(answer(neighbour))])

    name = "bounce_max_mm at 6000 r/min"  # 0.05
    assert against(0.04, 0.001, 0.045) == ((), ())
    assert against(0.04, 0.011, 0.045) == ((), (name,))
    assert against(0.06, 0.011, 0.065) == ((), (name,))
    assert against(0.06, 0.001, 0.045) == ((), (name,))
    assert against(0.06, 0.001, 0.055) == ((name,), ())
    assert against(np.nan, 0.0, np.nan) == (("never seats at 6000 r/min",), ())
    assert against(0.04, 0.0, np.nan) == ((), ("never seats at 6000 r/min",))


NONE = dict.fromkeys(("bounce_max_mm", "jump_max_mm", "seating_velocity_max_m_per_s"))
"""No limit of the scene's own."""


@pytest.mark.parametrize(
    ("key", "limit"),
    [
        ("jump_max_mm", 0.05),
        ("jump_max_deg", 5.0),
        ("seating_velocity_max_m_per_s", 0.8),
        ("contact_force_max_N", 3000.0),
        ("contact_force_min_N", 40.0),
    ],
)
def test_every_limited_metric_is_judged_at_its_bad_end_with_its_error(key, limit):
    """Two per cent within the limit with an error of three is not confirmed; an error of one is."""
    sign = -1.0 if key == "contact_force_min_N" else 1.0
    inside, beyond = limit * (1 - 0.02 * sign), limit * (1 + 0.02 * sign)

    def against(value, error, neighbour):
        near = figures_of(answer(*sorted((neighbour, value)), bounce_mm=0.0))
        own = answer(value, error=error, bounce_mm=0.0)
        return against_limits(scene(**NONE | {key: limit}), 6000.0, own, [near])

    name = f"{key} at 6000 r/min"
    assert against(inside, 0.01 * limit, inside) == ((), ())
    assert against(inside, 0.03 * limit, inside) == ((), (name,))
    assert against(inside, 0.01 * limit, beyond) == ((), (name,))
    assert against(beyond, 0.01 * limit, beyond) == ((name,), ())
    assert against(beyond, 0.03 * limit, beyond) == ((), (name,))


def test_what_is_limited_decides_whether_methods_agree():
    """Least force and jump angle hang on contacts that barely open: they decide only where they are limited."""
    for metric, far in (("contact_force_min_N", 30.0), ("jump_deg", 9.0)):
        assert agreement([answer(), answer(**{metric: far})], AT_2_UM)
        assert not agreement([answer(), answer(**{metric: far})], Tolerances(2.0, limited=[metric]))


def test_a_cam_that_floats_is_rejected_where_jump_angle_or_least_force_are_limited():
    """motori-1 with its polydyne at 5400 r/min: the contact is open over 32 degrees and parts by 0.025 mm."""
    floating = motori(**NONE | {"jump_max_mm": 0.05})
    lift, at_5400 = polydyne(floating), AT_5000 | {"speeds_rpm": (5400.0,), "tolerances": Tolerances(halvings=4)}
    free = verdict_on(floating, lift, **at_5400)
    worst = next(iter(free.speeds[0].methods.values())).worst
    assert free.verdict == "confirmed" and worst["jump_deg"] > 30 and worst["contact_force_min_N"] == 0.0
    for limits in ({"jump_max_deg": 0.5 * worst["jump_deg"]}, {"contact_force_min_N": 20.0}):
        result = verdict_on(motori(**NONE | limits), lift, **at_5400)
        assert result.verdict == "rejected" and result.broken == (f"{next(iter(limits))} at 5400 r/min",)


def test_a_verdict_prints_on_one_screen():
    base, both = motori(**NONE), ("event", "rkg")
    result = verdict_on(base, polydyne(base), (4000.0, 5000.0, 5400.0), both, 1000.0, Tolerances(halvings=2))
    shown = str(result)
    assert len(shown.splitlines()) <= 30 and max(map(len, shown.splitlines())) <= 100 and len(shown) < 2500
    for words in ("jump deg", "least N", "worst over 4000 to 6000 r/min", "verdict: "):
        assert words in shown
    least = result.as_dict().worst("contact_force_min_N")  # what the end of `camopt optimize` states
    assert f"{least.value:.5g}" in shown and f"{least.speed_rpm:.5g}" in shown
    assert {"jump angle [deg]", "least contact force [N]"} <= set(COLUMNS.values())
    for record in (result, result.speeds[0], result.speeds[0].methods["event"], result.band):
        assert len(repr(record)) < 160 and type(record).__name__ in repr(record)
    narrow = replace(result, band=replace(result.band, to_rpm=4900.0))
    assert "worst over 4000 to 4900 r/min and at 5000, 5400 r/min, including neighbouring speeds" in str(narrow)
    many = tuple(result.speeds) * 20
    assert len(str(replace(result, speeds=many)).splitlines()) <= 30


def test_an_error_says_no_more_than_it_knows():
    """StepRefinement moves event-exact by 1e-11 mm; settling to a micrometre and cubics leave more."""
    result = verdict_on(scene(), lift(), **AT_5000)
    for record in result.as_dict()["speeds"]:
        assert record["bounce_error_mm"] == record["errors"]["bounce_mm"] == 1e-5
        assert record["errors"]["seating_velocity_m_per_s"] >= 1e-5 and record["errors"]["contact_force_max_N"] >= 1e-2
        low, high = record["ranges"]["seating_velocity_m_per_s"]
        assert low <= record["seating_velocity_m_per_s"] <= high
    assert "estimated error of bounce: at most 0.01 um" in result.accuracy["statement"]


def test_confirmed_and_the_contract():
    result = verdict_on(scene(), lift(), **AT_5000)
    data = json.loads(json.dumps(result.as_dict(), allow_nan=False))
    assert data["verdict"] == "confirmed" and data["broken"] == []
    assert set(data) == {"verdict", "broken", "reason", "speeds", "worst_in_band", "band", "limits", "accuracy"}
    assert data["worst_in_band"] == []
    assert data["band"] is None and data["limits"] == {"first_jump_rpm": None, "first_bounce_rpm": None}
    (speed,) = data["speeds"]
    figures = {
        *("bounce_mm", "bounce_error_mm", "bounce_range_mm", "jump_mm", "jump_deg", "contact_force_min_N"),
        *("contact_force_max_N", "seating_velocity_m_per_s", "impact_velocity_m_per_s", "dynamic_area_mm_deg"),
        *("revolutions", "periodic", "errors", "ranges"),
    }
    assert set(speed) == figures | {"speed_rpm", "verdict", "decided_after", "method", "methods"}
    assert list(speed["methods"]) == ["event", "rkg"]
    for method in speed["methods"].values():
        assert set(method) == figures | {"steps_per_revolution", "converged"}
        assert method["converged"]
        # settled to 1 um; the two methods share no code
        assert method["seating_velocity_m_per_s"] == pytest.approx(0.1624, abs=2e-3)
        assert method["contact_force_min_N"] == pytest.approx(72.26, abs=0.1)


@pytest.mark.parametrize(
    ("limits", "broken", "at_the_speed"),
    [
        ({"seating_velocity_max_m_per_s": 0.15}, "seating_velocity_max_m_per_s at 5000 r/min", "rejected"),
        ({"max_lift_mm": 9.3}, "max_lift_mm", "confirmed"),
    ],
)
def test_a_broken_limit_on_the_motion_or_on_the_shape_is_named_and_rejects(limits, broken, at_the_speed):
    result = verdict_on(scene(**limits), lift(), **AT_5000)
    assert result.verdict == "rejected" and result.broken == (broken,)
    assert result.speeds[0].verdict == at_the_speed


def test_a_limit_is_far_broken_where_every_figure_breaks_it_beyond_all_doubt():
    limited = scene(**NONE | {"jump_max_mm": 0.05})
    figures, doubt = [{"jump_mm": 0.5}, {"jump_mm": 0.3}], {"jump_mm": 0.25 / FAR}
    assert violates_by_margin(limited, figures, {"jump_mm": 0.24 / FAR})
    assert not violates_by_margin(limited, figures, {"jump_mm": 0.26 / FAR})
    assert not violates_by_margin(limited, [{"jump_mm": 0.5}, {"jump_mm": 0.04}], dict.fromkeys(doubt, 0.0))
    for unknown in (np.nan, np.inf):
        assert not violates_by_margin(limited, [*figures, {"jump_mm": unknown}], doubt)
        assert not violates_by_margin(limited, figures, {"jump_mm": unknown})


def test_a_limit_broken_far_beyond_every_error_is_decided_by_one_step_for_half_the_price():
    """The polydyne at 6500 r/min bounces by 0.2 mm where 0.05 mm are allowed, and is rejected without being located."""

    def judged(**limits):
        case = scene(**NONE | limits)
        started = time.process_time()
        result = verdict_on(case, lift(), (6500.0,), ("event", "rkg", "tmm"), None, Tolerances(halvings=4))
        return result, time.process_time() - started

    judged(bounce_max_mm=0.05)  # compiles, and builds what the further ones share
    (early, cost), (late, full) = judged(bounce_max_mm=0.05), judged(bounce_max_mm=0.25)
    assert early.verdict == "rejected" and early.broken == ("bounce_max_mm at 6500 r/min",)
    record, other = early.as_dict()["speeds"][0], late.as_dict()["speeds"][0]
    assert record["decided_after"] == ONE_STEP and list(record["methods"]) == ["event", "rkg"]
    assert not record["methods"]["rkg"]["converged"] and record["methods"]["rkg"]["bounce_error_mm"] is None
    assert other["decided_after"] == HALVED and list(other["methods"]) == ["event", "rkg", "tmm"]
    for key in ("bounce_mm", "jump_mm"):
        assert record[key] == pytest.approx(other[key], rel=0.05)
    assert cost < full / 2


def test_a_limit_broken_by_little_is_not_decided_by_one_step():
    result = verdict_on(scene(seating_velocity_max_m_per_s=0.1623), lift(), **AT_5000)
    assert result.speeds[0].decided_after == HALVED


def test_a_limit_within_the_neighbourhood_is_sensitive():
    # 0.1 % of speed moves the seating velocity of 0.16241 m/s by about 0.1 % of itself
    result = verdict_on(scene(seating_velocity_max_m_per_s=0.1624), lift(), **AT_5000)
    assert result.verdict == "sensitive"
    assert result.speeds[0].straddled == ("seating_velocity_max_m_per_s at 5000 r/min",)
    assert result.reason.endswith("the cam keeps and at others it breaks seating_velocity_max_m_per_s at 5000 r/min.")
    assert result.as_dict()["reason"] == result.reason and result.reason in str(result)
    assert result.broken == ()


@pytest.mark.parametrize("part", ["mass_damping", "mass_force"])
def test_a_sign_flipped_in_one_method_ends_the_agreement(monkeypatch, part):
    def flipped(train, lift, cam_speed, steps=None):
        return engine.prepare(replace(train, **{part: -getattr(train, part)}), lift, cam_speed, steps)

    others = verdict.method_named
    monkeypatch.setattr(verdict, "method_named", lambda name: flipped if name == "event" else others(name))
    result = verdict_on(scene(), lift(), **AT_5000)
    assert result.verdict == "not converged" and "not agree" in result.reason and "5000 r/min" in result.reason


def test_one_method_is_no_agreement_and_an_unknown_one_is_refused():
    assert verdict_on(scene(), lift(), methods=("rkg",), **AT_5000).verdict == "not converged"
    with pytest.raises(InputError, match="magic"):
        verdict_on(scene(), lift(), methods=("rkg", "magic"), **AT_5000)


def motori(**limits):
    """In a band in which its motion with a polydyne repeats."""
    return moving("motori-1", (4000.0, 6000.0), **limits)


@pytest.mark.parametrize("bounce_max_mm", [1.0, 1e-4])
def test_the_record_of_a_band_holds_what_any_report_states_about_it(monkeypatch, bounce_max_mm):
    train = motori(bounce_max_mm=bounce_max_mm, jump_max_mm=None, seating_velocity_max_m_per_s=None)
    judge, judged = verdict.judge_speed, []
    monkeypatch.setattr(verdict, "judge_speed", lambda case, rpm: judged.append(rpm) or judge(case, rpm))
    result = verdict_on(train, polydyne(train), (5997.0, 6500.0), None, 500.0, Tolerances(halvings=4))
    assert sorted(judged) == sorted({s.speed_rpm for s in (*result.speeds, *result.worst_in_band)})  # each of them once
    assert 5997.0 in [s.speed_rpm for s in result.worst_in_band]  # which is listed, too
    data = json.loads(json.dumps(result.as_dict(), allow_nan=False))
    assert data["verdict"] == ("rejected" if bounce_max_mm < 1 else result.verdict)
    band, listed, worst = data["band"], data["speeds"], data["worst_in_band"]
    assert worst and set(worst[0]) == set(listed[0])  # also where a listed speed rejects already
    assert all(len(record["methods"]) == 2 and record["method"] == "event" for record in (*worst, *listed))
    curves = band["curves"]
    assert all(len(values) == len(curves["speed_rpm"]) for values in curves.values())
    inside = [r for r in (*listed, *worst) if 4000 <= r["speed_rpm"] <= 6000]
    for name in ("bounce_mm", "jump_mm", "jump_deg", "contact_force_min_N", "contact_force_max_N",
                 "seating_velocity_m_per_s", "impact_velocity_m_per_s", "dynamic_area_mm_deg"):  # fmt: skip
        extreme = min if name in ("contact_force_min_N", "dynamic_area_mm_deg") else max
        found = band["worst"][name]
        assert found["value"] == extreme(curves[name]) and found["method"] == "event"
        assert curves[name][curves["speed_rpm"].index(found["speed_rpm"])] == found["value"]
        assert found["value"] == extreme(found["value"], *(r[name] for r in inside))
        for record in inside:
            assert curves[name][curves["speed_rpm"].index(record["speed_rpm"])] == record[name]
    assert (band["worst_bounce_mm"], band["worst_speed_rpm"]) == (
        band["worst"]["bounce_mm"]["value"], band["worst"]["bounce_mm"]["speed_rpm"]
    )  # fmt: skip
    assert band["worst_speed_rpm"] in [r["speed_rpm"] for r in worst]
    assert max(curves["speed_rpm"]) == 6000.0  # a speed asked for outside the band says nothing about the band


def test_what_another_method_found_in_the_band_is_said_so():
    train = motori(jump_max_mm=None, seating_velocity_max_m_per_s=None)
    result = verdict_on(train, polydyne(train), (5500.0,), ("rkg", "event"), 1000.0, Tolerances(halvings=2))
    assert result.band.methods[5500.0] == "rkg" and result.band.methods[4000.0] == "event"
