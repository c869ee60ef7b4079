"""Verdicts in which one method looks at every speed and the others where a limit is nearest."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from camopt.cam.families.polydyne import polydyne
from camopt.exact.settled import settled_metrics
from camopt.measure.settling import Figures
from camopt.scene import build_train, load_scene
from camopt.verifier import at_speed, spot_checks, verdict
from camopt.verifier.accuracy import EFFORTS
from camopt.verifier.convergence import WANDERING_REVOLUTIONS
from camopt.verifier.record import ALONE, HALVED, ONE_STEP
from camopt.verifier.verdict import verdict_on

SCENE = load_scene("motori-1")
SPEEDS = (3000.0, 3500.0, 4000.0, 4500.0, 5000.0)
BOTH = ("event", "rkg")
DRAFT = EFFORTS["draft"].tolerances


@pytest.fixture(scope="module")
def cam():
    return polydyne(SCENE)


@pytest.fixture(scope="module")
def draft(cam):
    return verdict_on(SCENE, cam, SPEEDS, BOTH, None, DRAFT)


def test_all_methods_look_at_both_ends_and_at_the_worst_speeds(draft):
    by_speed = {s.speed_rpm: s for s in draft.speeds}
    assert by_speed[3000.0].decided_after == by_speed[5000.0].decided_after == HALVED
    for name in ("bounce_mm", "jump_mm", "seating_velocity_m_per_s", "contact_force_max_N"):
        worst = max(s.ranges[name][1] for s in draft.speeds)
        assert any(s.ranges[name][1] == worst and len(s.methods) == 2 for s in draft.speeds), name
    alone = [s for s in draft.speeds if s.decided_after == ALONE]
    assert alone and all(list(s.methods) == ["event"] and s.verdict == "confirmed" for s in alone)


def test_the_statement_says_where(draft):
    looked = ", ".join(f"{s.speed_rpm:g}" for s in draft.speeds if len(s.methods) == 2)
    alone = sum(s.decided_after == ALONE for s in draft.speeds)
    assert f"all methods were run at {looked} r/min, event-exact alone at {alone} other speed" in str(draft)


def test_a_draft_s_figures_are_those_of_all_methods_within_its_error(draft, cam):
    full = verdict_on(SCENE, cam, SPEEDS[1:2], BOTH, None, replace(DRAFT, unchanged_halvings=2, spot_checks=False))
    for name in ("bounce_mm", "jump_mm", "contact_force_max_N"):
        one, other = draft.speeds[1].methods["event"], full.speeds[0].methods["event"]
        assert one.worst[name] == pytest.approx(other.worst[name], abs=one.error[name] + other.error[name])


def test_a_rejected_baseline_is_rejected_at_its_worst_speed_alone(cam):
    speeds = (4000.0, 6000.0, 7000.0)
    found = verdict_on(SCENE, cam, speeds, BOTH, None, replace(DRAFT, spot_checks=False), False)
    assert found.verdict == "rejected" and "bounce_max_mm at 7000 r/min" in found.broken
    assert sorted(s.decided_after for s in found.speeds) == sorted([ALONE, ALONE, ONE_STEP])


def test_a_wrong_event_exact_is_found_out_where_a_limit_is_nearest(monkeypatch, cam):
    """Its peak force is a tenth too high at every speed: no limit breaks, but the other method does not agree."""
    real = at_speed.at_once

    def wrong(*case):
        look = real(*case)
        name = "contact_force_max_N"
        low, high = look.range[name]
        return replace(look, range=look.range | {name: (1.1 * low, 1.1 * high)})

    monkeypatch.setattr(at_speed, "at_once", wrong)
    assert verdict_on(SCENE, cam, SPEEDS[::4], BOTH, None, DRAFT).speeds[0].verdict == "not converged"


def test_a_motion_that_hangs_on_its_start_is_judged_by_halving(monkeypatch, cam):
    """Motions from other states near by have another peak force: event-exact's one look does not stand."""
    real, name = spot_checks.neighbours, "contact_force_max_N"

    def other(*case):
        return [Figures(f.by_revolution | {name: 1.1 * f.by_revolution[name]}) for f in real(*case)]

    monkeypatch.setattr(spot_checks, "neighbours", other)
    (found,) = verdict_on(SCENE, cam, SPEEDS[:1], BOTH, None, DRAFT).speeds
    assert found.methods["event"].steps_per_revolution > 0


@pytest.mark.parametrize(("speed", "most"), [(7000.0, WANDERING_REVOLUTIONS), (4000.0, None)])
def test_the_band_of_a_rejected_baseline_settles_briefly(cam, monkeypatch, speed, most):
    """No sweep that anything rests on does."""
    asked = []

    class Looked(Exception):
        pass

    def looked(swept, *_, **__):
        swept([6000.0])
        raise Looked

    def many(*motions, **how):
        asked.append(how.get("most"))
        return settled_metrics(*motions, **how)

    monkeypatch.setattr(verdict, "sweep", looked)
    monkeypatch.setattr(verdict, "_settled_metrics", lambda: many)
    with pytest.raises(Looked):
        verdict_on(SCENE, cam, (speed,), BOTH, 500.0, DRAFT, False)
    assert asked[-1] == most


def test_bars_count_the_speeds_that_are_judged(cam, monkeypatch):
    shown = []

    class Bar(spot_checks.tqdm):
        def __init__(self, *given, **named):
            shown.append((named["total"], named["disable"]))
            super().__init__(*given, **named)

    monkeypatch.setattr(spot_checks, "tqdm", Bar)
    for progress, hidden in ((False, True), (True, None)):  # None: a bar on a terminal
        verdict_on(SCENE, cam, SPEEDS[:2], BOTH, None, progress=progress)
        assert shown.pop() == (2, hidden) and not shown


@pytest.mark.parametrize("said", ["rejected", "sensitive", "not converged"])
def test_only_a_rejection_by_all_methods_spares_the_other_speeds(monkeypatch, said):
    first, judged = SimpleNamespace(worst={}, error={}), SimpleNamespace(verdict=said)
    monkeypatch.setattr(spot_checks, "violates_by_margin", lambda *_: True)
    monkeypatch.setattr(spot_checks, "_largest_usage", lambda *_: 0.0)
    monkeypatch.setattr(spot_checks, "with_all_methods", lambda *_: judged)
    alone = (SimpleNamespace(decided_after=ALONE, first=first),)
    found = spot_checks.early_rejection(SimpleNamespace(scene=SCENE), alone)
    assert found == ((judged,) if said == "rejected" else None)


@pytest.mark.parametrize(
    ("said", "after", "none"), [("rejected", HALVED, True), ("rejected", ALONE, False), ("sensitive", HALVED, False)]
)
def test_all_methods_judge_no_other_speed_only_where_they_have_rejected_one(monkeypatch, said, after, none):
    monkeypatch.setattr(spot_checks, "judge_all", lambda judge, case, speeds: [one])
    one = SimpleNamespace(verdict=said, decided_after=after, speed_rpm=1.0, ranges={"contact_force_max_N": (0.0, 1.0)})
    case = SimpleNamespace(tolerances=SimpleNamespace(limited=()))
    assert spot_checks.spot_checked(case, (one,)) == ({} if none else {1.0: one})


def test_only_the_first_method_is_measured_without_samples(monkeypatch, cam):
    """That way measures event-exact's motions: as the figures of another method they would be no second opinion."""
    monkeypatch.setattr(at_speed, "StepRefinement", lambda *case: case[-1])
    methods = {name: verdict.method_named(name) for name in BOTH}
    case = at_speed.Case(SCENE, cam, methods, DRAFT, settled_metrics)
    assert [case.refinement(name, 5000.0) for name in BOTH] == [settled_metrics, None]


def test_neighbours_are_as_far_as_stated_to_both_sides_in_speed_lift_and_every_number_of_the_state(monkeypatch, cam):
    monkeypatch.setattr(at_speed, "at_once", lambda many, train, *motion: motion)
    monkeypatch.setattr(at_speed, "figures_of", lambda motion: motion)
    train = build_train(load_scene("kodama"))
    state = np.zeros(train.state_size)
    case = SimpleNamespace(train=train, lift=cam, scene=SCENE, many=True)
    motions, speed = at_speed.neighbours(case, 5000.0, SimpleNamespace(state=state)), SCENE.cam_speed(5000.0)
    for sign, ((_, fast, _), (high, same, _), (_, _, moved)) in zip((-1, 1), (motions[:3], motions[3:]), strict=True):
        assert fast == pytest.approx(speed * (1 + sign * at_speed.SPEED_NEIGHBOUR), rel=1e-12) and same == speed
        assert high.max_lift - cam.max_lift == pytest.approx(sign * at_speed.LIFT_NEIGHBOUR, rel=1e-6)
        assert np.unique(np.abs(moved)) == pytest.approx(sorted(at_speed.STATE_NEIGHBOUR))


def test_only_the_stated_method_refines_until_its_bounce_is_certain(cam, monkeypatch):
    reported, refinement = {}, at_speed.Case.refinement

    def noted(case, method, speed_rpm, **changed):
        if "reported" in changed:
            reported[method] = changed["reported"]
        return refinement(case, method, speed_rpm, **changed)

    monkeypatch.setattr(at_speed.Case, "refinement", noted)
    verdict_on(SCENE, cam, SPEEDS[:1], BOTH, None, replace(DRAFT, spot_checks=False))
    assert reported == {"event": True, "rkg": False}
