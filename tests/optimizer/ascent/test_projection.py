"""The nearest point within linear limits, by its optimality conditions, and the nearest free cam."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import nnls

import camopt
from camopt.cam.families.free import free_cam
from camopt.cam.linear_limits import linear_limits
from camopt.measure.limits import broken_by_shape, drawing_excess
from camopt.optimizer.ascent.projection import Empty, Polyhedron, ShapeLimits, nearest_free_cam
from camopt.optimizer.ascent.variables import ROOM
from camopt.optimizer.ascent.variables import drawing_excess as excess_in_jax
from camopt.optimizer.program.kinematic import kinematic_optimum
from camopt.scene import InputError, load_scene
from camopt.scene.geometry import Geometry

MOTORI = load_scene("motori-1")
assert MOTORI.design is not None
BOX = Polyhedron(np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, -1.0]]), np.array([1.0, 1.0, 0.0]))
"""A triangle with its corners at (1, 1), (-1, 1) and (1, -1)."""


@pytest.mark.parametrize(
    ("x", "nearest"),
    [((0.5, 0.5), (0.5, 0.5)), ((3.0, 0.5), (1.0, 0.5)), ((5.0, 9.0), (1.0, 1.0)), ((-2.0, -2.0), (0.0, 0.0))],
)
def test_the_nearest_point_of_a_triangle(x, nearest):
    assert BOX.nearest(np.array(x)) == pytest.approx(np.array(nearest), abs=1e-12)


def test_faces_of_a_triangle():
    inside, edge, corner = (np.array(p, dtype=float) for p in ((0.5, 0.5), (1.0, 0.5), (1.0, 1.0)))
    assert BOX.face(inside, np.ones(2)) == pytest.approx(np.eye(2))
    assert BOX.face(edge, np.ones(2)) == pytest.approx(np.diag([0.0, 1.0]), abs=1e-12)
    assert BOX.face(edge, np.array([-1.0, 1.0])) == pytest.approx(np.eye(2))  # it may leave the edge inwards
    assert BOX.face(corner, np.ones(2)) == pytest.approx(np.zeros((2, 2)), abs=1e-12)
    point, face = BOX.nearest_and_face(np.array([3.0, 0.5]))
    assert point == pytest.approx([1.0, 0.5]) and face == pytest.approx(np.diag([0.0, 1.0]), abs=1e-12)


def test_no_point_at_all():
    with pytest.raises(Empty):
        Polyhedron(np.array([[1.0], [-1.0]]), np.array([-1.0, -1.0])).nearest(np.zeros(1))


@pytest.mark.parametrize("size", [1e-5, 1e-3, 1e-1])
def test_the_nearest_coefficients_hold_and_are_the_nearest(size):
    """x - p is a non-negative sum of the rows that hold p: what p gives up cannot be had (Kuhn and Tucker 1951)."""
    cam = free_cam(MOTORI.design, 6.0)
    limits = ShapeLimits(cam, MOTORI.design)
    x = kinematic_optimum(MOTORI.design, cam).z + size * np.random.default_rng(0).normal(size=cam.Z.shape[1])
    p = limits.nearest(x)
    assert not broken_by_shape(cam.lift(p), MOTORI.design)
    matrix, bound = limits.polyhedron.matrix, limits.polyhedron.bound
    holding = bound - matrix @ p < 1e-9 * np.abs(p).max()
    _, left = nnls(matrix[holding].T, x - p)
    assert left < 1e-6 * np.linalg.norm(x - p)
    assert limits.nearest(p) == pytest.approx(p, abs=1e-12)
    inside = limits.nearest(np.zeros_like(x))
    assert (x - p) @ (inside - p) <= 1e-9 * np.linalg.norm(x - p)  # nothing within lies on the far side


def test_the_calmest_cam_that_reaches_a_lift_is_the_nearest_to_zero():
    """The size of the answer, not that of the point, says what counts as broken."""
    design = MOTORI.design.model_copy(update={"reach_max_lift": True})
    cam = free_cam(design)
    lift = cam.lift(ShapeLimits(cam, design).nearest(np.zeros(cam.Z.shape[1])))
    assert lift.max_lift == pytest.approx(design.max_lift_mm * 1e-3, rel=1e-5)
    assert not broken_by_shape(lift, design)


def test_least_squares_that_stop_early_are_noticed(monkeypatch):
    """SciPy's non-negative least squares may return a point that is not the least, without a word (scipy #25389)."""
    monkeypatch.setattr("camopt.optimizer.ascent.projection.nnls", lambda a, b, maxiter: (np.zeros(a.shape[1]), 1.0))
    for x, nearest in (((3.0, 0.5), (1.0, 0.5)), ((5.0, 9.0), (1.0, 1.0)), ((-2.0, -2.0), (0.0, 0.0))):
        assert BOX.nearest(np.array(x)) == pytest.approx(np.array(nearest), abs=1e-12)


class TestNearestFreeCam:
    def test_a_cam_within_the_limits_is_met_as_knots_grow_finer(self):
        cam = free_cam(MOTORI.design, 6.0)
        given = cam.lift(0.9 * kinematic_optimum(MOTORI.design, cam).z)
        same = nearest_free_cam(MOTORI, given, knot_deg=6.0)
        theta = np.linspace(-1.2, 1.2, 200)
        assert np.abs(same(theta) - given(theta)).max() < 1e-9

    @pytest.mark.parametrize(("design_speed_rpm", "share"), [(6000, 1 + 1e-9), (8000, 0.9)])
    def test_a_polydyne_that_breaks_limits_comes_near_and_holds_them(self, design_speed_rpm, share):
        """The mean square difference is less than `share` of that of the fullest cam within the limits. Of the polydyne
        of 6000 r/min the nearest is that cam itself, found by another program: the lifts differ by some 1e-14 m."""
        given = camopt.polydyne(MOTORI, design_speed_rpm=design_speed_rpm)
        found = nearest_free_cam(MOTORI, given, knot_deg=6.0)
        assert broken_by_shape(given, MOTORI.design) and not broken_by_shape(found, MOTORI.design)
        theta = np.linspace(-1.2, 1.2, 200)
        best = free_cam(MOTORI.design, 6.0).lift(kinematic_optimum(MOTORI.design, free_cam(MOTORI.design, 6.0)).z)
        mine, theirs = (np.mean((cam(theta) - given(theta)) ** 2) for cam in (found, best))
        assert mine < share * theirs

    def test_limits_that_contradict_each_other_are_a_sentence(self):
        design = MOTORI.design.model_copy(update={"acceleration_max_mm_per_deg2": 1e-4, "reach_max_lift": True})
        with pytest.raises(InputError, match="the limits of the design contradict each other"):
            nearest_free_cam(MOTORI.model_copy(update={"design": design}), camopt.polydyne(MOTORI), knot_deg=6.0)


def test_how_far_a_family_breaks_limits_of_a_drawing_is_what_the_pieces_say_and_never_less():
    start = camopt.polydyne(MOTORI, design_speed_rpm=6000)
    flat = Geometry(follower="flat", base_radius_mm=18.0)
    design = MOTORI.design.model_copy(update={"nose_radius_min_mm": 4.0}).within(flat, MOTORI.operation)
    (limit,) = linear_limits(design)
    cam: Any = SimpleNamespace(lift=lambda theta, _, order: start(theta, order))  # JAX takes ten seconds to compile one
    found = float(excess_in_jax(cam, {}, limit))
    own = limit.excess(start) / limit.level.size
    assert own == drawing_excess(start, design)["nose_radius_min_mm"]
    assert -1e-12 < found - own < ROOM + 1e-12
