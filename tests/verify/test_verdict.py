"""The verdict: agreement, limits, neighbourhood, and the contract's verification.json."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from camopt.cam.families.polydyne import polydyne
from camopt.exact import engine
from camopt.scene import QUANTITIES, InputError, load_scene
from camopt.verify import verdict
from camopt.verify.converge import Converged
from camopt.verify.settle import Figures
from camopt.verify.verdict import agreement, verify

SHAPE = ("acceleration_max_mm_per_deg2", "acceleration_min_mm_per_deg2", "jerk_max_mm_per_deg3", "nose_deg")
AT_5000 = {"speeds_rpm": (5000.0,), "band_step_rpm": None, "halvings": 2}


@cache
def lift():
    return polydyne(load_scene("kodama"))


def scene(**limits):
    """kodama without limits on the shape, so that the motion decides."""
    base = load_scene("kodama")
    return base.model_copy(update={"design": base.design.model_copy(update={**dict.fromkeys(SHAPE), **limits})})


def answer(worst=0.1, error=0.001, half_range=0.0, converged=True, **changed):
    values = {name: changed.get(name, worst) for name in QUANTITIES}
    spread = {name: (value - half_range, value + half_range) for name, value in values.items()}
    return Converged(1440, converged, values, spread, dict.fromkeys(QUANTITIES, error), 5, True, np.zeros(2))


def test_agreement_needs_two_converged_methods_whose_intervals_meet():
    assert agreement([answer(), answer(bounce_mm=0.1029)], 2.0)
    assert not agreement([answer(), answer(bounce_mm=0.1031)], 2.0)  # 0.5 (0.002 + 1 %) each, above the errors of 0.001
    assert agreement([answer(error=0.003), answer(bounce_mm=0.104)], 2.0)
    assert agreement([answer(half_range=0.002), answer(bounce_mm=0.1045)], 2.0)
    assert not agreement([answer()], 2.0)
    assert not agreement([answer(), answer(converged=False)], 2.0)
    assert agreement([answer(), answer(impact_velocity_m_per_s=9.0)], 2.0)  # carries no limit
    assert not agreement([answer(), answer(contact_force_max_N=9.0)], 2.0)


def test_not_seating_agrees_only_with_not_seating():
    lost = answer(bounce_mm=np.nan, seating_velocity_m_per_s=np.nan)
    assert agreement([lost, lost], 2.0)
    assert not agreement([lost, answer()], 2.0)


def test_a_limit_is_broken_only_beyond_error_and_neighbours():
    def against(value, error, *neighbours):
        near = [Figures({name: np.array([v]) for name in QUANTITIES}) for v in neighbours]
        return verdict._against_limits(
            scene(jump_max_mm=None, seating_velocity_max_m_per_s=None), 6000.0, answer(value, error), near
        )

    name = "bounce_max_mm at 6000 r/min"  # 0.05
    assert against(0.04, 0.001, 0.045) == ((), ())
    assert against(0.04, 0.011, 0.045) == ((), (name,))
    assert against(0.06, 0.011, 0.065) == ((), (name,))
    assert against(0.06, 0.001, 0.045) == ((), (name,))
    assert against(0.06, 0.001, 0.055) == ((name,), ())
    assert against(np.nan, 0.0, np.nan) == (("never seats at 6000 r/min",), ())
    assert against(0.04, 0.0, np.nan) == ((), ("never seats at 6000 r/min",))


def test_confirmed_and_the_contract():
    result = verify(scene(), lift(), **AT_5000)
    data = json.loads(json.dumps(result.as_dict(), allow_nan=False))
    assert data["verdict"] == "confirmed" and data["broken"] == []
    assert set(data) == {"verdict", "broken", "speeds", "worst_in_band", "band", "limits", "accuracy"}
    assert data["worst_in_band"] == []
    assert data["band"] is None and data["limits"] == {"first_jump_rpm": None, "first_bounce_rpm": None}
    (speed,) = data["speeds"]
    figures = {
        *("bounce_mm", "bounce_error_mm", "bounce_range_mm", "jump_mm", "jump_deg", "contact_force_min_N"),
        *("contact_force_max_N", "seating_velocity_m_per_s", "impact_velocity_m_per_s", "dynamic_area_mm_deg"),
        *("revolutions", "periodic"),
    }
    assert set(speed) == figures | {"speed_rpm", "verdict", "method", "methods"}
    assert list(speed["methods"]) == ["event", "rkg"]
    for method in speed["methods"].values():
        assert set(method) == figures | {"steps_per_revolution", "converged"}
        assert method["converged"]
        # settled to 1 um; the two methods share no code
        assert method["seating_velocity_m_per_s"] == pytest.approx(0.1624, abs=2e-3)
        assert method["contact_force_min_N"] == pytest.approx(72.26, abs=0.1)


def test_a_broken_limit_is_named_and_rejects():
    result = verify(scene(seating_velocity_max_m_per_s=0.15), lift(), **AT_5000)
    assert result.verdict == "rejected"
    assert result.broken == ("seating_velocity_max_m_per_s at 5000 r/min",)


def test_a_limit_within_the_neighbourhood_is_sensitive():
    # 0.1 % of speed moves the seating velocity of 0.16241 m/s by about 0.1 % of itself
    result = verify(scene(seating_velocity_max_m_per_s=0.1624), lift(), **AT_5000)
    assert result.verdict == "sensitive"
    assert result.speeds[0].straddled == ("seating_velocity_max_m_per_s at 5000 r/min",)
    assert result.broken == ()


def test_a_limit_on_the_shape_rejects_alone():
    result = verify(scene(max_lift_mm=9.3), lift(), **AT_5000)
    assert result.verdict == "rejected" and result.broken == ("max_lift_mm",)
    assert result.speeds[0].verdict == "confirmed"


@pytest.mark.parametrize("part", ["mass_damping", "mass_force"])
def test_a_sign_flipped_in_one_method_ends_the_agreement(monkeypatch, part):
    def flipped(train, lift, cam_speed, steps=None):
        return engine.prepare(replace(train, **{part: -getattr(train, part)}), lift, cam_speed, steps)

    others = verdict._method
    monkeypatch.setattr(verdict, "_method", lambda name: flipped if name == "event" else others(name))
    assert verify(scene(), lift(), **AT_5000).verdict == "not converged"


def test_one_method_is_no_agreement_and_an_unknown_one_is_refused():
    assert verify(scene(), lift(), methods=("rkg",), **AT_5000).verdict == "not converged"
    with pytest.raises(InputError, match="magic"):
        verify(scene(), lift(), methods=("rkg", "magic"), **AT_5000)


def motori(**limits):
    """motori-1 without limits on the shape; jumps and bounces with a polydyne from 6000 r/min on."""
    base = load_scene("motori-1")
    return base.model_copy(update={"design": base.design.model_copy(update={**dict.fromkeys(SHAPE), **limits})})


@pytest.mark.parametrize("bounce_max_mm", [1.0, 1e-4])
def test_the_record_of_a_band_holds_what_any_report_states_about_it(bounce_max_mm):
    train = motori(bounce_max_mm=bounce_max_mm, jump_max_mm=None, seating_velocity_max_m_per_s=None)
    result = verify(train, polydyne(train), (5000.0, 6500.0, 7500.0), band_step_rpm=200.0, halvings=2)
    data = json.loads(json.dumps(result.as_dict(), allow_nan=False))
    assert data["verdict"] == ("rejected" if bounce_max_mm < 1 else result.verdict)
    band, listed, worst = data["band"], data["speeds"], data["worst_in_band"]
    assert worst and set(worst[0]) == set(listed[0])  # also where a listed speed rejects already
    assert all(len(record["methods"]) == 2 and record["method"] == "event" for record in (*worst, *listed))
    curves = band["curves"]
    assert all(len(values) == len(curves["speed_rpm"]) for values in curves.values())
    inside = [r for r in (*listed, *worst) if 5000 <= r["speed_rpm"] <= 7000]
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
    assert max(curves["speed_rpm"]) == 7000.0  # a speed asked for outside the band says nothing about the band


def test_what_another_method_found_in_the_band_is_said_so():
    train = motori(jump_max_mm=None, seating_velocity_max_m_per_s=None)
    result = verify(train, polydyne(train), (6500.0,), ("rkg", "event"), band_step_rpm=500.0, halvings=2)
    methods = dict(zip(result.band.speeds_rpm, result.band.methods, strict=True))
    assert methods[6500.0] == "rkg" and methods[5000.0] == "event"
