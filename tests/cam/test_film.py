"""The oil film's thickness against a worked example, its powers, and the published range of a flat follower's."""

import numpy as np
import pytest

from camopt.cam.geometry import contact
from camopt.cam.hertz import film_ratio
from camopt.scene.geometry import Geometry
from camopt.scene.units import DEG, MM, RPM
from tests.cam.cams import MULTI_POL as CAM

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
