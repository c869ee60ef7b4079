"""The search for the largest-area member of a family: limits kept, least bounce said, same call same cam."""

import numpy as np
import pytest

from camopt.cam.families.new_design import new_design
from camopt.cam.families.polydyne import polydyne
from camopt.cam.families.registry import FAMILIES
from camopt.exact import prepare
from camopt.measure.limits import broken_by_shape, shape_excess
from camopt.measure.settling import settled_from_rest
from camopt.optimizer.baselines import largest_member as baselines
from camopt.optimizer.baselines.largest_member import MemberMotion, family_space, largest_area_member
from camopt.scene import InputError, build_train, load_scene
from camopt.scene.units import MM, MM_PER_DEG2

KODAMA = load_scene("kodama")
FREED = KODAMA.design.model_copy(update={"jerk_max_mm_per_deg3": None})
SLOW = (5000.0, 6000.0)


def ratio(lift) -> float:
    return lift.area_ratio(9.4 * MM)


class TestSpaces:
    @pytest.mark.parametrize("family", FAMILIES)
    @pytest.mark.parametrize("jerk", [True, False])
    def test_every_family_has_members_between_its_bounds(self, family, jerk):
        space = family_space(KODAMA, family, jerk)
        low, high = np.array(space.bounds).reshape(-1, 2).T
        assert np.all(low < high)
        lift = space.member(0.6 * low + 0.4 * high)
        assert 0.3 < ratio(lift) < 0.65082
        for x in space.known:
            assert np.all((low <= x) & (x <= high))

    @pytest.mark.parametrize(("family", "reached"), [("multi-pol", 0.602), ("new-design", 0.5505)])
    def test_known_members_hold_and_are_the_plain_ones(self, family, reached):
        """`reached` by a long search without any start, see tests/cam/test_families.py."""
        space = family_space(KODAMA, family, True)
        members = [space.member(np.array(x)) for x in space.known]
        best = max(ratio(lift) for lift in members if not shape_excess(lift, KODAMA.design))
        assert best == pytest.approx(reached, abs=2e-3)

    def test_using_less_of_a_limit_keeps_it(self):
        space = family_space(KODAMA, "multi-pol", False)
        x = np.array(space.known[0])
        x[-2:] = 0.95, 0.9
        low, high = (value / MM_PER_DEG2 for value in space.member(x).extremes(2))
        assert high == pytest.approx(0.95 * 0.015, rel=1e-6)
        assert low == pytest.approx(-0.9 * 0.008, rel=5e-3)  # control points lie beyond the extremes

    @pytest.mark.parametrize(
        ("family", "says"),
        [
            ("polydyne:exponents=2/10/18/26/34", "chooses exponents"),
            ("multi-pol:a12_mm_per_deg2=0.01", "chooses a12"),
            ("sinusoid", "not a family"),
            ("new-design:ratio=0", "expected"),
        ],
    )
    def test_faults(self, family, says):
        with pytest.raises(InputError, match=says) as error:
            family_space(KODAMA, family, True)
        assert "\n" not in str(error.value)


def test_excess_is_relative_to_the_limit():
    lift = polydyne(KODAMA)
    highest = lift.extremes(2)[1] / MM_PER_DEG2
    key = "acceleration_max_mm_per_deg2"
    assert shape_excess(lift, FREED) == {key: pytest.approx(highest / 0.015 - 1, rel=1e-9)}
    assert shape_excess(lift, FREED.model_copy(update={key: 0.016})) == {}
    stepped = new_design(KODAMA, (15.8, 9.9, 11.0, 35.3), 0.0125, j34=0.00044)
    assert max(shape_excess(stepped, KODAMA.design).values()) == 1.0  # a step in acceleration


class TestSearch:
    def test_bounce_limit_is_held_and_costs_area(self):
        slow = {"jerk": False, "speeds_rpm": SLOW, "evaluations": 96}
        found = largest_area_member(KODAMA, "trapezoid", bounce_max_mm=0.03, **slow)
        assert found.holds
        assert broken_by_shape(found.lift, FREED) == []
        train, lift = build_train(KODAMA), found.lift
        slowly = [settled_from_rest(prepare, train, lift, KODAMA.cam_speed(s)).metrics(lift) for s in SLOW]
        for name in ("bounce_mm", "jump_mm"):
            assert max(one.worst(name) for one in slowly) == pytest.approx(found.figures[name], abs=1e-9)
        assert found.figures["bounce_mm"] <= 0.03
        free = largest_area_member(KODAMA, "trapezoid", **slow)
        assert free.holds
        assert free.area_ratio > found.area_ratio > 0.5
        assert free.figures["bounce_mm"] > 0.03

    def test_exponents_are_searched_too(self):
        found = largest_area_member(KODAMA, "exponent", jerk=False, speeds_rpm=(5000.0,), evaluations=64)
        assert found.holds  # the plain one does not: its acceleration is 0.0166 mm/deg2
        assert found.area_ratio > 0.54

    def test_least_bounce_is_returned_and_said(self):
        found = largest_area_member(KODAMA, "trapezoid", bounce_max_mm=1e-3, speeds_rpm=(7000.0,), evaluations=64)
        assert not found.holds
        assert f"{found.figures['bounce_mm']:.4g} mm is the least reached" in found.says
        start = family_space(KODAMA, "trapezoid", True)
        plain = MemberMotion(KODAMA, (7000.0,)).worst(start.member(np.array(start.known[1])))
        assert found.figures["bounce_mm"] < 0.9 * plain["bounce_mm"]

    def test_limits_that_no_member_meets_are_said(self):
        design = KODAMA.design.model_copy(update={"acceleration_max_mm_per_deg2": 0.004})
        found = largest_area_member(KODAMA.model_copy(update={"design": design}), "trapezoid", evaluations=64)
        assert not found.holds
        assert found.says.startswith("no trapezoid cam found within the limits on the shape")

    def test_shape_alone_is_the_plain_largest_area(self):
        found = largest_area_member(KODAMA, "multi-pol", jerk=False, speeds_rpm=(5000.0,), evaluations=64)
        assert found.area_ratio == pytest.approx(0.635, abs=1e-3)
        assert found.figures["bounce_mm"] >= 0

    def test_the_same_call_finds_the_same_cam(self):
        asked = {"family": "trapezoid", "jerk": False, "bounce_max_mm": 0.03, "speeds_rpm": (6e3,), "evaluations": 64}
        one, other = (largest_area_member(KODAMA, **asked) for _ in range(2))
        np.testing.assert_array_equal(one.lift.coefficients, other.lift.coefficients)
        assert (one.evaluations, one.judged) == (other.evaluations, other.judged)

    @pytest.mark.parametrize(
        ("keywords", "says"),
        [({"evaluations": 10}, "at least"), ({"bounce_max_mm": 0.0}, "above 0")],
    )
    def test_faults(self, keywords, says):
        with pytest.raises(InputError, match=says):
            largest_area_member(KODAMA, "trapezoid", **keywords)


def test_a_family_without_free_parameters_is_one_cam(monkeypatch):
    one = baselines.family_space(KODAMA, "polydyne", False)
    fixed = type(one)([], lambda _: polydyne(KODAMA))
    monkeypatch.setattr(baselines, "family_space", lambda *_: fixed)
    found = largest_area_member(KODAMA, "cycloidal", jerk=False, bounce_max_mm=0.05, speeds_rpm=(5000.0,))
    assert (found.evaluations, found.holds) == (1, False)
    assert "breaks acceleration_max_mm_per_deg2" in found.says
