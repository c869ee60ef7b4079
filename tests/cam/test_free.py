"""The free cam: joining conditions exact, limits that hold at every angle and are not much too strict."""

import numpy as np
import pytest

from camopt.cam.families.free import free_cam
from camopt.measure.limits import broken_by_shape
from camopt.optimizer.program.kinematic import first_working, kinematic_optimum, spline_rows
from camopt.optimizer.program.linear_program import maximise
from camopt.scene import InputError
from camopt.scene.units import DEG, MM, MM_PER_DEG, MM_PER_DEG2, MM_PER_DEG3, MM_PER_DEG4
from tests.cam import cams

KODAMA = cams.KODAMA.design
SKEW = KODAMA.model_copy(update={"closing_ramp_height_mm": 0.35, "closing_ramp_velocity_mm_per_deg": 0.02})


def drawn(cam, seed):
    """Free coefficients at random."""
    return np.random.default_rng(seed).normal(size=cam.Z.shape[1]) * 0.01


def extreme_cam(design, cam, direction):
    """Free coefficients on the limits in a direction."""
    limits = cam.limits(design)
    return maximise(direction, spline_rows(limits.matrix), limits.bound, first_working(limits)).z


@pytest.mark.parametrize("design", [KODAMA, SKEW], ids=["kodama", "skew"])
@pytest.mark.parametrize("knot_deg", [3.0, 2.0, 1.0])
def test_any_coefficients_meet_the_ramps_exactly(design, knot_deg):
    cam = free_cam(design, knot_deg)
    assert len(cam.x_p) == round(144 / knot_deg) + 3
    assert cam.Z.shape == (len(cam.x_p), len(cam.x_p) - 4)
    np.testing.assert_allclose(cam.Z.T @ cam.Z, np.eye(cam.Z.shape[1]), atol=1e-13)
    lift = cam.lift(drawn(cam, 1))
    (up, up_speed, _), (down, down_speed, _) = design.ramps()
    at = {-72 * DEG: (up * MM, up_speed * MM_PER_DEG, 0.0), 72 * DEG: (down * MM, -down_speed * MM_PER_DEG, 0.0)}
    for angle, values in at.items():
        right = int(np.argmin(np.abs(lift.borders - angle)))
        for order, value in enumerate(values):
            for piece, local in ((right - 1, lift.borders[right] - lift.borders[right - 1]), (right, 0.0)):
                found = np.polyval(np.polyder(lift.coefficients[piece][::-1], order), local)
                # 1e-12 of the largest value that the derivative takes in this lift
                assert abs(found - value) < 1e-12 * max(np.abs(lift.extremes(order)))
    inner = lift.borders[3:-3]
    for order in range(5):  # four times continuously differentiable between the ramp tops
        size = np.max(np.abs(lift.extremes(min(order, 3)))) / (knot_deg * DEG) ** max(0, order - 3)
        jump = lift(inner[1:-1] + 1e-13, order) - lift(inner[1:-1] - 1e-13, order)
        assert np.max(np.abs(jump)) < 1e-9 * size


@pytest.mark.parametrize("order", range(5))
def test_basis_is_the_lift_by_another_way(order):
    cam = free_cam(SKEW, 3.0)
    z, theta = drawn(cam, 2), np.random.default_rng(3).uniform(-7.0, 7.0, 400)  # beyond one revolution too
    matrix, offset = cam.basis(theta, order)
    expected = cam.lift(z)(theta, order)
    np.testing.assert_allclose(matrix @ cam.coefficients(z) + offset, expected, atol=1e-12 * np.abs(expected).max())


def test_area_row():
    cam = free_cam(SKEW, 2.0)
    z, (row, constant) = drawn(cam, 4), cam.area()
    theta = np.linspace(-72, 72, 144001) * DEG
    assert row @ z + constant == pytest.approx(np.trapezoid(cam.lift(z)(theta), theta), rel=1e-8)


@pytest.mark.parametrize("design", [KODAMA, SKEW], ids=["kodama", "skew"])
@pytest.mark.parametrize("seed", range(3))
def test_limits_hold_at_every_angle_and_are_reached(design, seed):
    cam = free_cam(design, 3.0)
    lift = cam.lift(extreme_cam(design, cam, drawn(cam, seed)))
    theta = np.arange(-72.0, 72.0005, 0.001) * DEG
    acceleration, jerk = lift(theta, 2) / MM_PER_DEG2, lift(theta[:-1], 3) / MM_PER_DEG3
    assert -0.008 <= acceleration.min() and acceleration.max() <= 0.015 and lift(theta).max() / MM <= 9.4
    assert acceleration[np.abs(theta) < 40 * DEG].max() <= 0.0
    assert 0.9 * 0.003 < np.abs(jerk).max() <= 0.003  # a corner of the limits, so the rows are not idle
    assert lift.extremes(2)[1] / MM_PER_DEG2 <= 0.015
    assert np.max(np.abs(lift.extremes(3, -72 * DEG, 72 * DEG))) / MM_PER_DEG3 <= 0.003 * (1 + 1e-9)


@pytest.mark.parametrize("knot_deg", [3.0, 2.0])
def test_a_limit_on_the_snap_holds_at_every_angle_and_would_be_broken_without(knot_deg):
    snaps = {}
    for most in (None, 0.0005):
        design = KODAMA.model_copy(update={"snap_max_mm_per_deg4": most})
        found = kinematic_optimum(design, free_cam(design, knot_deg))
        theta = np.arange(-72.0, 72.0005, 0.001) * DEG
        steps = np.diff(found.lift(theta, 2)) / (0.001 * DEG)  # by the acceleration alone: its mean slope is the jerk
        snaps[most] = np.abs(np.diff(steps)).max() / (0.001 * DEG) / MM_PER_DEG4
        assert broken_by_shape(found.lift, design) == []
    assert snaps[0.0005] == pytest.approx(0.0005, rel=1e-3)
    assert snaps[None] > 1.5 * 0.0005
    with pytest.raises(InputError, match="snap_max_mm_per_deg4 would have to rise from 1e-05 to"):
        low = design.model_copy(update={"snap_max_mm_per_deg4": 1e-5, "reach_max_lift": True})
        kinematic_optimum(low, free_cam(low, knot_deg))


def test_lift_control_points_are_tight():
    cam = free_cam(KODAMA, 3.0)
    z, limits = extreme_cam(KODAMA, cam, drawn(cam, 7)), cam.limits(KODAMA)
    cap = limits.rows("max_lift_mm")
    margin = np.min(limits.bound[cap] - limits.matrix[cap] @ z) / MM
    assert 0 <= 9.4 - cam.lift(z).max_lift / MM - margin < 1e-4  # control points above the lift by less than 1e-4 mm


def test_control_points_enclose_and_converge():
    cam = free_cam(KODAMA, 3.0)
    z = drawn(cam, 5)
    low, high = cam.lift(z).extremes(2, -40 * DEG, 40 * DEG)
    gaps = []
    for parts in (27, 54, 108):
        matrix, offset = cam.control_points(2, np.linspace(-40, 40, parts + 1) * DEG)
        points = matrix @ z + offset
        assert points.max() >= high - 1e-9
        assert points.min() <= low + 1e-9
        gaps.append((points.max() - high) + (low - points.min()))
    assert gaps[2] < 0.3 * gaps[1] + 1e-9  # second order
    assert gaps[1] < 0.5 * gaps[0] + 1e-9


def test_nose_rows_stop_exactly_at_the_nose():
    """A nose of 40 deg lies inside a knot interval: acceleration may be positive just outside it."""
    cam = free_cam(KODAMA, 3.0)
    matrix, _ = cam.basis(np.array([-40.3 * DEG, 40.3 * DEG]), 2)
    lift = cam.lift(extreme_cam(KODAMA, cam, matrix.sum(axis=0) @ cam.Z))
    assert np.min(lift(np.array([-40.3, 40.3]) * DEG, 2)) / MM_PER_DEG2 > 1e-4
    assert lift.extremes(2, -40 * DEG, 40 * DEG)[1] / MM_PER_DEG2 <= 0.0


def test_limits_left_out_have_no_rows():
    design = KODAMA.model_copy(update={"jerk_max_mm_per_deg3": None, "nose_deg": None})
    limits = free_cam(design).limits(design)
    assert limits.names == ("acceleration_max_mm_per_deg2", "acceleration_min_mm_per_deg2", "max_lift_mm")
    assert len(limits.rows("jerk_max_mm_per_deg3")) == 0


def test_a_knot_interval_longer_than_half_the_duration_is_refused():
    with pytest.raises(ValueError, match="knot_deg must be at most half"):
        free_cam(KODAMA, 144.0)
