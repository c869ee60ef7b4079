"""Contact with flat and roller followers against cams whose contour is known: circles about another centre."""

import numpy as np
import pytest

from camopt.cam.followers import signed_radius
from camopt.cam.geometry import contact, crossing
from camopt.cam.lift import Lift
from camopt.scene import InputError
from camopt.scene.geometry import Geometry
from camopt.scene.units import DEG, MM
from tests.cam.cams import FLAT, OFFSET, RADIUS, ROLLER, ROLLS, cam_of, eccentric_flat, eccentric_roller
from tests.cam.cams import MULTI_POL as CAM

WIDE = Geometry(follower="flat", base_radius_mm=30)


class TestCircleAboutAnotherCentre:
    @pytest.mark.parametrize(("law", "geometry"), [(eccentric_flat, FLAT), (eccentric_roller, ROLLS)])
    def test_contour_and_curvature(self, law, geometry):
        found = contact(cam_of(law), geometry)
        assert found.radius_of_curvature == pytest.approx(RADIUS, rel=1e-7)
        x, y = found.contour.T
        assert np.hypot(x - OFFSET, y) == pytest.approx(RADIUS, rel=1e-9)
        angle, radius = found.polar
        assert np.all(np.diff(angle) > -1e-9)
        assert angle[[0, -1]] == pytest.approx([-np.pi, np.pi], abs=1e-6)
        assert radius * np.exp(1j * angle) == pytest.approx(x + 1j * y)
        assert found.smallest_concave is None
        assert found.faults() == []

    def test_eccentricity_of_a_flat_follower(self):
        found = contact(cam_of(eccentric_flat), FLAT)
        assert found.eccentricity == pytest.approx(-OFFSET * np.sin(found.theta), abs=1e-9 * MM)
        assert found.face_width == pytest.approx(2 * OFFSET, rel=1e-6)
        assert found.figures()["pressure_angle_max_deg"] is None
        narrow = Geometry(follower="flat", base_radius_mm=16, face_width_mm=7.9)
        assert contact(cam_of(eccentric_flat), narrow).faults() == [
            "the contact needs a face 8.00 mm wide, but it is 7.9 mm wide"
        ]

    def test_pressure_angle_of_a_roller(self):
        found = contact(cam_of(eccentric_roller), ROLLS)
        assert np.sin(found.pressure_angle) == pytest.approx(
            -OFFSET * np.sin(found.theta) / (RADIUS + ROLLER), abs=1e-8
        )
        largest = np.degrees(np.arcsin(OFFSET / (RADIUS + ROLLER)))
        assert found.figures()["pressure_angle_max_deg"] == pytest.approx(largest, rel=1e-6)
        assert found.figures()["face_width_needed_mm"] is None

    def test_a_lift_that_never_lies_so_low_is_open_the_whole_turn(self):
        flat = Lift(np.array([-np.pi, np.pi]), np.array([[3e-3]]), 1.2)
        assert crossing(flat, 1 * MM) == (-np.pi, np.pi)

    def test_crossings(self):
        opening, closing = crossing(cam_of(eccentric_flat), 5 * MM)
        assert (opening, closing) == pytest.approx((-np.arccos(0.25), np.arccos(0.25)), abs=1e-9)


def pitch_radius(r, first, second):
    """That of a polar curve r(theta), whose derivatives are (r', r) and (r'' - r, 2 r') along and across its ray."""
    return signed_radius(first + 1j * r, second - r + 2j * first)


def test_concave_and_straight_pitch_curves():
    """An arc whose centre lies outside the cam, and the straight flank of a tangent cam."""
    theta, centre, rho = np.linspace(-0.2, 0.2, 9), 90 * MM, 60 * MM
    root = np.sqrt(rho**2 - (centre * np.sin(theta)) ** 2)
    r = centre * np.cos(theta) - root
    root1 = -(centre**2) * np.sin(theta) * np.cos(theta) / root
    root2 = -(centre**2 * np.cos(2 * theta) + root1**2) / root
    assert pitch_radius(r, -centre * np.sin(theta) - root1, -centre * np.cos(theta) - root2) == pytest.approx(-rho)
    cos, tan = np.cos(theta), np.tan(theta)
    straight = 25 * MM / cos
    assert np.abs(pitch_radius(straight, straight * tan, straight * (1 + 2 * tan**2))).min() > 1e6 * MM


class TestValveCam:
    def test_curvature_is_the_formula_at_the_nose_and_on_the_base_circle(self):
        found = contact(CAM, WIDE)
        nose = np.argmin(np.abs(found.theta))
        assert found.radius_of_curvature[nose] == pytest.approx(39.4 * MM + float(CAM(0.0, 2)), rel=1e-9)
        assert found.radius_of_curvature[0] == pytest.approx(30 * MM)
        assert found.contour[nose] == pytest.approx([39.4 * MM, 0.0], abs=1e-9)
        theta = np.linspace(-np.pi, np.pi, 200_011)
        smallest = np.min(30 * MM + CAM(theta) + CAM(theta, 2))
        assert found.smallest_convex == pytest.approx(smallest, rel=1e-5)

    def test_curvature_is_that_of_the_contour(self):
        """Three points of the contour lie on a circle of the stated radius, concave flanks to the other side."""
        for geometry in (WIDE, ROLLS):
            found = contact(CAM, geometry)
            inner = np.flatnonzero(np.diff(found.theta) > 0.9 * np.diff(found.theta).max())
            inner = inner[(inner > 1) & np.isin(inner - 1, inner)]
            a, b, c = (found.contour[inner + k] for k in (-1, 0, 1))
            one, two = b - a, c - b
            cross = one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]
            sides = np.prod([np.hypot(*d.T) for d in (one, two, c - a)], axis=0)
            curvature = 2 * cross / sides
            assert curvature * 16 * MM == pytest.approx(16 * MM / found.radius_of_curvature[inner], abs=2e-2)
        assert contact(CAM, ROLLS).smallest_concave is not None

    def test_a_small_base_circle_is_refused_by_name(self):
        flat = contact(CAM, FLAT)
        assert flat.smallest_concave is not None
        assert "concave" in flat.faults()[0]
        rolls = contact(CAM, Geometry(follower="roller", base_radius_mm=5, roller_radius_mm=40))
        assert "undercuts" in rolls.faults()[0]

    def test_a_cam_is_as_long_open_on_both_sides_of_its_nose(self):
        for height in (1.0, 1.27):
            opening, closing = crossing(CAM, height * MM)
            assert CAM(np.array([opening, closing])) == pytest.approx(height * MM, rel=1e-9)
            assert opening == pytest.approx(-closing, abs=1e-9)
            assert 50 * DEG < closing < 72 * DEG
        with pytest.raises(InputError, match="12 mm is not below the maximum lift"):
            crossing(CAM, 12 * MM)
