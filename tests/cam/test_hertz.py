"""Hertz stress of a line contact against handbook coefficients and along known cams, and the oil film against a worked
example, its powers, and the published range of a flat follower's."""

import numpy as np
import pytest

from camopt.cam.geometry import contact
from camopt.cam.hertz import contact_modulus, contact_width, film_ratio, hertz_stress, line_pressure
from camopt.cam.lift import Lift
from camopt.scene import InputError, build_train, load_scene
from camopt.scene.geometry import Geometry
from camopt.scene.rest import rest_position, static_forces
from camopt.scene.units import DEG, MM, RPM
from tests.cam.cams import FLAT, OFFSET, RADIUS, ROLLER, ROLLS, cam_of, eccentric_flat, eccentric_roller
from tests.cam.cams import MULTI_POL as CAM

THETA = np.linspace(-3.0, 3.0, 61)
FORCE = 1000.0 + 200.0 * np.cos(THETA)


class TestFormula:
    def test_handbook_coefficients_for_equal_moduli_and_poisson_ratio_0_3(self):
        """Roark's Formulas for Stress and Strain, line contact: 0.591 sqrt(p E / K_D), K_D = D1 D2 / (D1 + D2) for two
        cylinders; Niemann, Maschinenelemente: 0.418 sqrt(p E / R) with the combined radius R."""
        p, e = 1e5, 210e9
        modulus = contact_modulus(FLAT)
        assert modulus == pytest.approx(210e9 / (2 * 0.91))
        d1, d2 = 0.04, 0.025
        radius = 1 / (2 / d1 + 2 / d2)
        assert line_pressure(p, radius, modulus) == pytest.approx(
            0.591 * np.sqrt(p * e * (d1 + d2) / (d1 * d2)), rel=1e-3
        )
        assert line_pressure(p, radius, modulus) == pytest.approx(0.418 * np.sqrt(p * e / radius), rel=1e-3)

    def test_line_carries_the_force(self):
        """p_0 is the top of a half ellipse over 2 a, a^2 = 4 P R / (pi E*) (Johnson 1985, Eqs. (4.43) and (4.45))."""
        p, radius, modulus = 2e5, 0.02, 1.2e11
        a = np.sqrt(4 * p * radius / (np.pi * modulus))
        assert np.pi / 2 * a * line_pressure(p, radius, modulus) == pytest.approx(p)

    def test_each_body_has_its_own_modulus(self):
        soft = FLAT.model_copy(update={"follower_modulus_GPa": 100.0, "follower_poisson_ratio": 0.25})
        assert 1 / contact_modulus(soft) == pytest.approx(0.91 / 210e9 + (1 - 0.25**2) / 100e9)


class TestAlongCirclesAboutAnotherCentre:
    def test_flat(self):
        found = hertz_stress(cam_of(eccentric_flat), FLAT, THETA, FORCE)
        expected = line_pressure(FORCE / (10 * MM), RADIUS, contact_modulus(FLAT))
        assert found.stress == pytest.approx(expected, rel=1e-6)
        assert found.largest == pytest.approx((expected.max(), 0.0), rel=1e-6, abs=1e-12)
        assert found.figures()["normal_force_N"] == pytest.approx(1200.0)

    def test_roller(self):
        """The normal force is the follower's over the cosine of the pressure angle, and 1/R = 1/20 + 1/8 mm."""
        found = hertz_stress(cam_of(eccentric_roller), ROLLS, THETA, FORCE)
        normal = FORCE / np.sqrt(1 - (OFFSET * np.sin(THETA) / (RADIUS + ROLLER)) ** 2)
        assert found.force == pytest.approx(normal, rel=1e-7)
        expected = line_pressure(normal / (10 * MM), 1 / (1 / RADIUS + 1 / ROLLER), contact_modulus(ROLLS))
        assert found.stress == pytest.approx(expected, rel=1e-6)

    def test_rocker_ratio(self):
        """Twice the valve lift for the same follower lift: the same cam, under twice the force."""
        double = cam_of(lambda theta: 2 * eccentric_flat(theta))
        geared = FLAT.model_copy(update={"rocker_ratio": 2.0})
        found = hertz_stress(double, geared, THETA, FORCE)
        assert found.stress == pytest.approx(
            np.sqrt(2) * hertz_stress(cam_of(eccentric_flat), FLAT, THETA, FORCE).stress
        )
        assert contact(double, geared).face_width == pytest.approx(2 * OFFSET, rel=1e-6)


def test_concave_flank_loads_the_roller_less_than_a_convex_one():
    along = contact(CAM, ROLLS, THETA)
    assert np.any(along.radius_of_curvature < 0)
    found = hertz_stress(CAM, ROLLS, THETA, np.full_like(THETA, 500.0))
    curvature = 1 / along.radius_of_curvature + 1 / ROLLER
    assert found.stress**2 / found.force == pytest.approx(contact_modulus(ROLLS) / np.pi / (10 * MM) * curvature)


def test_no_line_contact_is_refused():
    with pytest.raises(InputError, match=r"no line contact at -?\d+\.\d deg"):
        hertz_stress(CAM, FLAT, THETA, FORCE)
    undercut = Geometry(follower="roller", base_radius_mm=5, roller_radius_mm=40, contact_width_mm=10)
    with pytest.raises(InputError, match="no line contact"):
        hertz_stress(CAM, undercut, THETA, FORCE)
    with pytest.raises(InputError, match="give contact_width_mm"):
        contact_width(Geometry(follower="flat", base_radius_mm=16))
    assert contact_width(Geometry(follower="flat", base_radius_mm=16, face_width_mm=12)) == pytest.approx(12 * MM)


def test_angles_of_any_turn():
    """Angles of the second turn are those of the first."""
    lift: Lift = cam_of(eccentric_flat)
    found = hertz_stress(lift, FLAT, THETA + 2 * np.pi, FORCE)
    assert found.stress == pytest.approx(hertz_stress(lift, FLAT, THETA, FORCE).stress)
    assert found.largest[1] == pytest.approx(0.0, abs=1e-12)


def test_static_forces():
    """On the base circle the train at rest; lifted, the seat is open and the cam carries the spring's rate."""
    scene = load_scene("kodama")
    train = build_train(scene)
    cam, seat = (train.element_names.index(n) for n in ("cam_follower", "seat"))
    forces = static_forces(train, np.array([0.0, 5 * MM, 9 * MM]))
    d = train.compression(rest_position(train), 0.0)
    assert forces[0, seat] == pytest.approx(train.preload[seat] + train.stiffness[seat] * d[seat])
    assert forces[1:, seat] == pytest.approx(0.0)
    assert forces[0, cam] == pytest.approx(19.1)
    rate = (forces[2, cam] - forces[1, cam]) / (4 * MM)
    assert rate == pytest.approx(152000 / 6, rel=5e-3)  # six coils in series, and a train a thousand times stiffer
    assert forces[2, cam] == pytest.approx(19.1 + 197.0 + 152000 / 6 * (9 - 0.169) * MM, rel=5e-3)


OILED = Geometry(
    follower="flat", base_radius_mm=30, contact_width_mm=12, oil_viscosity_mPa_s=10, roughness_um=0.2 * np.sqrt(2)
)
FLANK, NOSE = -66 * DEG, 0.0


def ratio(theta: float, force: float, cam_speed: float = 2000 * RPM, **changes) -> float:
    found = film_ratio(contact(CAM, OILED.model_copy(update=changes), np.array([theta])), cam_speed, np.array([force]))
    return float(found[0])


def test_worked_by_hand():
    """U = 1.0e-11, G = 4615, W = 2.0e-5 on a radius of 20 mm make h/R = 2.65 * 2.0e-8 * 95.2 * 4.08 = 2.06e-5."""
    circle = OILED.model_copy(update={"base_radius_mm": 20.0, "roughness_um": 1.0})
    along = contact(CAM, circle, np.array([np.pi]))
    modulus = 210e9 / 0.91
    assert 20e-9 * modulus == pytest.approx(4615, rel=1e-3)
    speed = 1.0e-11 * modulus * 20 * MM / 10e-3
    force = 2.0e-5 * modulus * 20 * MM * 12 * MM
    found = film_ratio(along, speed / float(along.entrainment[0]), np.array([force]))
    assert found[0] * 1e-6 / (20 * MM) == pytest.approx(2.06e-5, rel=5e-3)


def test_powers():
    assert ratio(FLANK, 500.0, 4000 * RPM) / ratio(FLANK, 500.0) == pytest.approx(2**0.7)
    assert ratio(FLANK, 1000.0) / ratio(FLANK, 500.0) == pytest.approx(2**-0.13)
    assert ratio(FLANK, 500.0, roughness_um=0.1) / ratio(FLANK, 500.0, roughness_um=0.2) == pytest.approx(2.0)
    assert np.isinf(ratio(FLANK, 0.0))


def test_published_range_of_a_flat_follower():
    """4 to 6.5 on the flanks and 0.2 to 0.4 at the nose are published for 0.2 um of each surface, without oil or speed:
    an oil of 10 mPa s at 2000 r/min of the cam, on a base circle of 25 mm, falls into both."""
    theta = np.linspace(-72, 72, 289) * DEG
    along = contact(CAM, OILED.model_copy(update={"base_radius_mm": 25.0}), theta)
    found = film_ratio(along, 2000 * RPM, np.full(len(theta), 500.0))
    assert 4 < found.max() < 6.5
    assert abs(theta[np.argmax(found)]) > 40 * DEG
    assert 0.2 < found[np.argmin(np.abs(theta - NOSE))] < 0.4
    assert found.min() < 0.1  # where the entrainment reverses


def test_a_cusp_has_no_film():
    assert np.isnan(ratio(NOSE, 500.0, base_radius_mm=5.0))


def test_without_an_oil_there_is_none():
    along = contact(CAM, OILED.model_copy(update={"roughness_um": None}), np.array([0.0]))
    assert film_ratio(along, 100.0, np.array([500.0])) is None
