"""Followers both ways: valve lift, contour, valve lift; against brute-force envelopes and a four-bar linkage."""

import numpy as np
import pytest

from camopt.cam.conversion import converted, lift_along
from camopt.cam.followers import Arm, follower_of
from camopt.cam.geometry import contact
from camopt.cam.hertz import line_pressure
from camopt.scene import InputError
from camopt.scene.geometry import Geometry
from camopt.scene.units import DEG, MM
from tests.cam.cams import FINGER, FOLLOWERS, OFFSET, RADIUS, cam_of, resting, swing_to, valve_lift
from tests.cam.cams import MULTI_POL as CAM

SWINGING = [name for name in FOLLOWERS if "," in name]
THETA = np.linspace(-180.0, 180.0, 721)[:-1] * DEG


@pytest.fixture(params=FOLLOWERS)
def geometry(request) -> Geometry:
    return FOLLOWERS[request.param]


class TestRoundTrip:
    def test_valve_lift_contour_valve_lift(self, geometry):
        theta, lift = lift_along(contact(CAM, geometry, THETA), geometry)
        assert np.abs(theta - THETA).max() < 1e-9 * DEG
        assert np.abs(lift - CAM(THETA)).max() < 1e-9 * MM

    def test_as_lift_laws(self, geometry):
        """By way of a roller's lift on the same contour, and back, as polynomial pieces."""
        ball = Geometry(follower="roller", base_radius_mm=geometry.base_radius_mm, roller_radius_mm=3)
        back = converted(converted(CAM, geometry, ball), ball, geometry)
        between = THETA + 0.037 * DEG
        assert np.abs(back(between) - CAM(between)).max() < 2e-6 * MM
        smooth = np.abs(between) < 30 * DEG
        assert np.abs(back(between) - CAM(between))[smooth].max() < 1e-8 * MM


class TestBruteForce:
    """The follower rests on the points of the contour; nothing is known of normals and envelopes."""

    def test_rests_on_its_contour(self, geometry):
        points = contact(CAM, geometry, THETA).contour
        lift = np.array([resting(points, geometry, theta) for theta in THETA[::7]])
        assert np.abs(lift - CAM(THETA[::7])).max() < 1e-9 * MM

    def test_no_point_passes_the_follower_between(self, geometry):
        """Halfway between the angles of the points the lift is short by about step^2 / 8 times the radii."""
        points = contact(CAM, geometry, THETA).contour
        between = THETA[3::7] + 0.25 * DEG
        short = CAM(between) - np.array([resting(points, geometry, theta) for theta in between])
        assert -1e-9 * MM < short.min()
        assert short.max() < 400 * MM * (0.5 * DEG) ** 2 / 8


class TestCircleAboutAnotherCentre:
    """A circle about another centre and a pad make a four-bar linkage: the pad's centre keeps its distance from it."""

    @pytest.mark.parametrize("name", SWINGING)
    def test_contour_is_the_circle(self, name):
        geometry = FOLLOWERS[name].model_copy(update={"base_radius_mm": (RADIUS - OFFSET) / MM})
        reach = RADIUS + geometry.contact_radius_mm * MM
        lift = cam_of(lambda theta: valve_lift(geometry, swing_to(geometry, OFFSET * np.exp(-1j * theta), reach)))
        found = contact(lift, geometry)
        assert found.radius_of_curvature == pytest.approx(RADIUS, rel=1e-5)
        centres = found.contour - RADIUS * found.normal
        assert centres == pytest.approx(np.broadcast_to([OFFSET, 0.0], centres.shape), abs=1e-7 * MM)


class TestMotion:
    def test_forces_do_no_work_of_their_own(self, geometry):
        """The normal force on the moving contact does the valve force's work: N (n . dC) = F dh."""
        step = 1e-5
        found = contact(CAM, geometry, THETA)
        radius = (geometry.contact_radius_mm or 0.0) * MM
        before, after = (engine_centres(contact(CAM, geometry, THETA + d), radius) for d in (-step, step))
        velocity = (after - before) / (2 * step)
        normal = engine(found.normal, THETA)
        work = np.sum(normal * velocity, axis=1) * found.ratio / np.cos(found.pressure_angle)
        assert work == pytest.approx(CAM(THETA, 1), abs=2e-6 * np.abs(CAM(THETA, 1)).max())

    def test_sliding_is_the_velocity_of_the_surfaces_over_each_other(self, geometry):
        """Cam and body as rigid bodies, at the point where they touch."""
        found = contact(CAM, geometry, THETA)
        point, normal = engine(found.contour, THETA), engine(found.normal, THETA)
        along = np.stack([-normal[:, 1], normal[:, 0]], axis=1)
        cam = np.stack([point[:, 1], -point[:, 0]], axis=1)
        body = np.zeros_like(cam)
        if geometry.follower in ("finger", "rocker"):
            arm = Arm(geometry)
            turning = arm.swing(np.stack([CAM(THETA, k) for k in range(3)]))[1]
            away = point - [arm.pivot.real, arm.pivot.imag]
            body = turning[:, None] * np.stack([-away[:, 1], away[:, 0]], axis=1)
        if geometry.roller_radius_mm is not None:
            assert not found.sliding.any()
        else:
            slip = -np.sum(along * (cam - body), axis=1)
            assert found.sliding == pytest.approx(slip, rel=1e-9)

    def test_entrainment_is_how_the_contact_runs_along_both_surfaces(self, geometry):
        """The mean of its way along the contour and, with the body's turning taken out, along the pad."""
        step = 1e-4
        theta = THETA + 0.037 * DEG  # away from the borders, at which the jerk steps
        found = contact(CAM, geometry, theta)
        before, after = (contact(CAM, geometry, theta + d) for d in (-step, step))
        along = np.stack([-found.normal[:, 1], found.normal[:, 0]], axis=1)
        over_cam = np.sum((after.contour - before.contour) * along, axis=1) / (2 * step)
        over_follower = over_cam - found.sliding
        expected = over_cam if geometry.roller_radius_mm else (over_cam + over_follower) / 2
        assert found.entrainment == pytest.approx(expected, abs=1e-5 * np.abs(expected).max())

    def test_ratio_varies_with_the_swing(self, geometry):
        ratio = contact(CAM, geometry, THETA).ratio
        assert (np.ptp(ratio) > 1e-3) == (geometry.follower in ("finger", "rocker"))


def engine(vectors: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """Vectors (k, 2) of the cam as the engine sees them at cam angles (k) [rad]."""
    z = (vectors[:, 0] + 1j * vectors[:, 1]) * np.exp(-1j * theta)
    return np.stack([z.real, z.imag], axis=1)


def engine_centres(found, radius: float) -> np.ndarray:
    """Centres (k, 2) [m] of a roller or pad of this radius; points of a flat face."""
    if radius == 0.0:
        return engine(found.contour, found.theta) * [1, 0]
    return engine(found.contour + radius * found.normal, found.theta)


class TestAnchors:
    """A nose of 13.7 mm instead of 6 mm lowers the Hertz stress by 34 % and puts the entrainment to zero: published
    for a flat follower, which implies a distance of 27.4 mm of the face from the cam's axis."""

    @pytest.mark.parametrize(("nose", "zero"), [(6.0, False), (13.7, True)])
    def test_entrainment(self, nose, zero):
        law = np.array([[9.4 * MM], [0.0], [(nose - 27.4) * MM]])
        flat = Geometry(follower="flat", base_radius_mm=18.0)
        touching = follower_of(flat).contact(law, np.zeros(1))
        assert touching.radius_of_curvature[0] == pytest.approx(nose * MM)
        assert (abs(touching.entrainment[0]) < 1e-12) == zero

    def test_stress(self):
        stress = [float(line_pressure(1e5, nose * MM, 1.15e11)) for nose in (6.0, 13.7)]
        assert 1 - stress[1] / stress[0] == pytest.approx(0.338, abs=5e-4)


class TestFaults:
    def test_a_short_valve_arm(self):
        with pytest.raises(InputError, match=r"a valve arm of 8 mm does not lift the valve by 9\.4 mm"):
            contact(CAM, Geometry(**FINGER | {"valve_arm_mm": 8.0}, pad_radius_mm=30))

    def test_an_undercut_pad(self):
        steep = Geometry(**FINGER | {"base_radius_mm": 8.0, "valve_arm_mm": 25.0}, pad_radius_mm=35)
        assert "the pad undercuts the cam" in contact(CAM, steep).faults()[0]

    def test_a_hollow_is_not_bridged(self):
        rolls = Geometry(follower="roller", base_radius_mm=18, roller_radius_mm=3)
        with pytest.raises(InputError, match=r"the flat follower would bridge a hollow"):
            converted(CAM, rolls, Geometry(follower="flat", base_radius_mm=18))
