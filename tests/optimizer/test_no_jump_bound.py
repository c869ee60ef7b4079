"""The bound of the no-jump problem: its kernel against the forces themselves, and weak duality."""

from dataclasses import replace

import numpy as np
import pytest

from camopt.cam.families.free import free_cam
from camopt.optimizer.bound.certificate import area_ratio_bound
from camopt.optimizer.bound.summary import force_terms, no_jump_bound
from camopt.optimizer.program.force_rows import PEAK
from camopt.optimizer.program.no_jump import no_jump_program
from camopt.scene import build_train, load_scene

SCENE = load_scene("kodama")
TRAIN = build_train(SCENE)
SPEEDS = [SCENE.cam_speed(rpm) for rpm in (6000, 7000)]
FREE = SCENE.design
SKEW = FREE.model_copy(
    update={
        "closing_ramp_height_mm": 0.35,
        "closing_ramp_velocity_mm_per_deg": 0.02,
        "contact_force_max_N": 3000.0,
        "nose_deg": None,
    }
)
NO_JERK = FREE.model_copy(update={"jerk_max_mm_per_deg3": None})


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
