"""`camopt bound`: the bound of the no-jump problem, by its kernel against the forces themselves and weak duality;
bounds that hold together, and what a train forbids said beside what the shape's limits allow."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from camopt.cam.families.free import free_cam
from camopt.optimizer.accuracy import ACCURACIES
from camopt.optimizer.bound import summary
from camopt.optimizer.bound.certificate import area_ratio_bound
from camopt.optimizer.bound.summary import area_bound, bound_lines, force_terms, no_jump_bound
from camopt.optimizer.program.force_rows import PEAK
from camopt.optimizer.program.no_jump import no_jump_program
from camopt.optimizer.search.search import find_cam
from camopt.scene import InputError, build_train, load_scene

MOTOR, KODAMA = load_scene("motori-1"), load_scene("kodama")
TRAIN = build_train(KODAMA)
KNOT_DEG = 4.0
SPEEDS = [KODAMA.cam_speed(rpm) for rpm in (6000, 7000)]
FREE = KODAMA.design
SKEW = FREE.model_copy(
    update={
        "closing_ramp_height_mm": 0.35,
        "closing_ramp_velocity_mm_per_deg": 0.02,
        "contact_force_max_N": 3000.0,
        "nose_deg": None,
    }
)
NO_JERK = FREE.model_copy(update={"jerk_max_mm_per_deg3": None})


def designed(**update):
    """The one-mass scene under other design conditions."""
    return MOTOR.model_copy(update={"design": MOTOR.design.model_copy(update=update)})


def undamped():
    """The one-mass scene without any damping."""
    elements = tuple(e.model_copy(update={"damping_N_s_per_m": 0.0}) for e in MOTOR.element)
    return MOTOR.model_copy(update={"element": elements})


def test_no_bound_on_part_of_the_cams_exceeds_that_on_all(monkeypatch):
    """Its multipliers are another program's, so the bound of the no-jump cams came out above the kinematic one."""
    monkeypatch.setattr(summary, "no_jump_bound", lambda *_: SimpleNamespace(bound=0.9))
    found = area_bound(MOTOR, KNOT_DEG)
    assert found["area_ratio_no_jump_bound"] == found["area_ratio_bound"] < 0.7
    monkeypatch.undo()
    fast = area_bound(MOTOR, KNOT_DEG)
    assert fast["area_ratio_no_jump"] < fast["area_ratio_no_jump_bound"] < fast["area_ratio_bound"]


@pytest.mark.parametrize("speed_rpm", [100.0, 500.0])
def test_a_slow_train_is_bounded_by_its_shape_alone(speed_rpm):
    """Forces of 1e-300 N, long after the cam has passed, were scaled to one and overflowed."""
    slow = MOTOR.model_copy(update={"operation": MOTOR.operation.model_copy(update={"speeds_rpm": (speed_rpm,)})})
    found = area_bound(slow, KNOT_DEG)
    assert found["no_jump_says"] is None
    assert found["area_ratio_no_jump"] == pytest.approx(found["area_ratio_feasible"], rel=1e-6)


def test_the_contacts_keep_the_least_force_that_the_scene_asks_for():
    asked, usual = area_bound(designed(contact_force_min_N=60.0), KNOT_DEG), area_bound(MOTOR, KNOT_DEG)
    assert (asked["margins_N"], asked["seat_margin_N"]) == (60.0, 20.0)
    assert (usual["margins_N"], usual["seat_margin_N"]) == (20.0, 20.0)
    assert asked["area_ratio_no_jump"] < usual["area_ratio_no_jump"]
    assert "closed by 60 N or more, and the seat by 20 N, at" in "\n".join(bound_lines(asked))


def test_an_undamped_train_has_its_kinematic_bound_and_a_sentence():
    found = area_bound(undamped(), KNOT_DEG)
    assert found["area_ratio_bound"] == area_bound(MOTOR, KNOT_DEG)["area_ratio_bound"]
    assert found["area_ratio_no_jump"] is found["area_ratio_no_jump_bound"] is None
    says = found["no_jump_says"]
    assert "does not die away at 2500 r/min of the camshaft" in says and "rad/s" not in says
    assert "give elements or masses more damping_N_s_per_m" in says and f"  {says}" in bound_lines(found)


def test_the_search_refuses_an_undamped_train_in_the_same_words():
    with pytest.raises(InputError, match=r"does not die away at 2497\.5 r/min .* more damping_N_s_per_m"):
        find_cam(undamped(), "band", ACCURACIES["draft"], "exact")


def test_a_ramp_that_is_too_low_leaves_the_kinematic_bound():
    found = area_bound(designed(ramp_height_mm=0.06), KNOT_DEG)
    assert 0.5 < found["area_ratio_feasible"] <= found["area_ratio_bound"] < 0.7
    assert found["area_ratio_no_jump"] is None
    assert "a higher ramp_height_mm" in found["no_jump_says"]


def test_a_train_that_is_not_linear_has_a_sentence_in_place_of_a_bound_for_kept_contacts():
    (spring,) = (e for e in MOTOR.element if e.name == "spring")
    rows = ((0.0, spring.preload_N), (20.0, spring.preload_N + 0.02 * spring.stiffness_N_per_m))
    gone = {"law": "table", "force_table": rows, "stiffness_N_per_m": None, "preload_N": 0.0}
    elements = tuple(e.model_copy(update=gone) if e is spring else e for e in MOTOR.element)
    found = area_bound(MOTOR.model_copy(update={"element": elements}), KNOT_DEG)
    assert found["no_jump_says"] == (
        "no bound for closed contacts: it exists only for linear trains, and this one has 'spring' (table)"
    )
    assert found["area_ratio_no_jump_bound"] is None and found["area_ratio_no_jump"] > 0.4


@pytest.mark.parametrize("design", [FREE, SKEW, NO_JERK], ids=["kodama", "skew-peak", "acceleration"])
def test_kernel_gives_the_forces_of_any_cam(design):
    """constant + integral kernel u = sum of multiplier (force - margin), u the jerk (or acceleration) of any spline."""
    cam = free_cam(design)
    p = no_jump_program(TRAIN, design, cam, SPEEDS)
    random = np.random.default_rng(1)
    z = random.normal(size=cam.Z.shape[1]) * 0.005
    multipliers = random.exponential(size=len(p.kind))
    margins = np.array([[20.0, 20.0], [10.0, 5.0], [-3.0, -3.0]])
    constant, kernel = force_terms(p, margins, multipliers)
    x = kernel.x
    node, weight = np.polynomial.legendre.leggauss(5)
    theta = (0.5 * (x[1:] + x[:-1])[:, None] + 0.5 * np.diff(x)[:, None] * node).ravel()
    w = (0.5 * np.diff(x)[:, None] * weight).ravel()
    order = 2 if design.jerk_max_mm_per_deg3 is None else 3
    left = constant + np.sum(w * kernel(theta) * cam.lift(z)(theta, order))
    force = p.forces(z)
    level = margins[np.minimum(p.kind, 2), p.speed]
    slack = np.where(p.kind == PEAK, (design.contact_force_max_N or 0.0) - force, force - level)
    # of terms of this size; the Hermite interpolant of the kernel is the only approximation
    assert abs(left - multipliers @ slack) < 1e-7 * np.sum(multipliers * np.abs(slack))


def test_bound_is_above_every_spline_and_falls_with_better_multipliers():
    p = no_jump_program(TRAIN, FREE, free_cam(FREE), SPEEDS[1:])
    coarse, fine = (no_jump_bound(p, 20.0, knot) for knot in (3.0, 1.5))
    best = fine.program.solve(20.0).area_ratio
    assert p.solve(20.0).area_ratio < best < fine.bound < coarse.bound
    assert fine.bound < area_ratio_bound(FREE).bound - 0.02  # the dynamics cost something, and the bound knows
    spoiled = replace(fine, force=fine.force * np.random.default_rng(0).uniform(0.95, 1.05, len(fine.force)))
    assert best < spoiled.bound


def test_without_force_multipliers_it_is_the_kinematic_bound():
    p = no_jump_program(TRAIN, FREE, free_cam(FREE), SPEEDS[:1])
    found = no_jump_bound(p, 20.0, 3.0)
    alone = replace(found, kinematic=area_ratio_bound(FREE), force=np.zeros_like(found.force))
    assert alone.bound == pytest.approx(area_ratio_bound(FREE).bound, abs=1e-12)
    with pytest.raises(ValueError, match="force multipliers of a certificate must be >= 0"):
        _ = replace(found, force=found.force - 1e-9).bound


def test_without_limits_on_the_control_there_is_no_such_bound():
    design = NO_JERK.model_copy(update={"acceleration_max_mm_per_deg2": None})
    p = no_jump_program(TRAIN, design, free_cam(design), SPEEDS[:1])
    assert no_jump_bound(p, 20.0, 3.0) is None
