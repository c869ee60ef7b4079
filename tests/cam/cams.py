"""Cams and followers of these tests: those that several files take, each in one place."""

from pathlib import Path

import numpy as np

from camopt.cam.families.exponent import exponent
from camopt.cam.families.kurz import kurz
from camopt.cam.families.multi_pol import multi_pol
from camopt.cam.families.polydyne import polydyne
from camopt.cam.families.trapezoid import trapezoid
from camopt.cam.lift import Lift
from camopt.cam.read import read_cam
from camopt.scene import load_scene
from camopt.scene.geometry import Geometry
from camopt.scene.units import DEG, MM

KODAMA = load_scene("kodama")
FITTED = {"sections_deg": (7.5, 11.5, 7.5, 22.7, 22.8), "a12": 0.0114, "j34": -0.00175, "j45": -0.00014}
"""The Multi-Pol member used with the reference train."""
CAMS = {
    "polydyne": polydyne(KODAMA),
    "exponent": exponent(KODAMA),
    "multi-pol": multi_pol(KODAMA, **FITTED),
    "kurz": kurz(KODAMA, (24.0, 25.0, 23.0), a23=-0.0078),
    "trapezoid": trapezoid(KODAMA, (5.0, 8.0, 13.0, 46.0)),
    "4-5-6-7": read_cam("4-5-6-7", KODAMA),
}
POLYDYNE, MULTI_POL = CAMS["polydyne"], CAMS["multi-pol"]
THETA = np.linspace(-np.pi, np.pi, 7207)
MEASURED = Path(__file__).resolve().parents[3] / "shared" / "data" / "lift"
"""Measured lift tables, which lie outside the repository."""


def with_design(geometry: Geometry | None = KODAMA.geometry, **changes):
    """The scene kodama with other keys of its design, and another follower."""
    return KODAMA.model_copy(update={"geometry": geometry, "design": KODAMA.design.model_copy(update=changes)})


def difference(one: Lift, other: Lift, order: int = 0) -> float:
    return float(np.abs(one(THETA, order) - other(THETA, order)).max())


def cam_of(law) -> Lift:
    """A lift law as pieces of degree 9 over 4 deg each, fitted to round-off."""
    borders = np.linspace(-np.pi, np.pi, 91)
    u = np.polynomial.chebyshev.chebpts2(24)
    width = borders[1] - borders[0]
    local = 0.5 * width * (u + 1)
    pieces = [np.polynomial.Polynomial.fit(local, law(start + local), 9).convert().coef for start in borders[:-1]]
    return Lift(borders, np.array([np.pad(c, (0, 10 - len(c))) for c in pieces]), np.pi / 2)


RADIUS, OFFSET, ROLLER = 20 * MM, 4 * MM, 8 * MM
"""A circle about a point away from the cam's axis, and a roller on it."""
FLAT = Geometry(follower="flat", base_radius_mm=16, face_width_mm=12, contact_width_mm=10)
ROLLS = Geometry(follower="roller", base_radius_mm=16, roller_radius_mm=8, contact_width_mm=10)
WIDE = Geometry(follower="flat", base_radius_mm=40)


def eccentric_flat(theta):
    return OFFSET + OFFSET * np.cos(theta)


def eccentric_roller(theta):
    reach = RADIUS + ROLLER
    return OFFSET * np.cos(theta) + np.sqrt(reach**2 - (OFFSET * np.sin(theta)) ** 2) - (RADIUS - OFFSET + ROLLER)


FINGER = {"follower": "finger", "base_radius_mm": 18, "pivot_mm": (-22.0, 14.0), "arm_mm": 24, "valve_arm_mm": 38}
ROCKER = {"follower": "rocker", "base_radius_mm": 20, "pivot_mm": (30.0, -24.0), "arm_mm": 32, "valve_arm_mm": 40}
FOLLOWERS = {
    "flat": Geometry(follower="flat", base_radius_mm=30, rocker_ratio=1.2),
    "roller": Geometry(follower="roller", base_radius_mm=25, roller_radius_mm=9),
    "finger, pad": Geometry(**FINGER, pad_radius_mm=20, valve_arm_deg=-8),
    "finger, roller": Geometry(**FINGER, roller_radius_mm=8, valve_arm_deg=-8),
    "finger, other side": Geometry(**FINGER | {"pivot_mm": (22.0, 14.0)}, roller_radius_mm=8),
    "rocker, pad": Geometry(**ROCKER, pad_radius_mm=25, valve_arm_deg=-6),
    "rocker, roller": Geometry(**ROCKER, roller_radius_mm=10, valve_arm_deg=-6),
}


def swing_to(geometry: Geometry, points: np.ndarray, radius: float) -> np.ndarray:
    """Angle [rad] about the pivot of a finger's or rocker's arm where its circle, about a centre `radius` [m] from each
    of the complex points [m], touches; by the triangle of point, pivot and centre, NaN where the arm does not reach."""
    across, along = geometry.pivot_mm
    pivot, arm = complex(along, across) * MM, geometry.arm_mm * MM
    reach = np.abs(points - pivot)
    with np.errstate(invalid="ignore"):
        inner = np.arccos((arm**2 + reach**2 - radius**2) / (2 * arm * reach))
    return np.angle(points - pivot) - valve_side(geometry) * inner


def valve_side(geometry: Geometry) -> float:
    return -np.sign(geometry.pivot_mm[0]) * (1 if geometry.follower == "finger" else -1)


def valve_lift(geometry: Geometry, angle: np.ndarray) -> np.ndarray:
    """Valve lift [m] of a finger or rocker whose arm stands at these angles of `swing_to`."""
    rest = swing_to(geometry, np.zeros(1), (geometry.base_radius_mm + geometry.contact_radius_mm) * MM)
    opening = -valve_side(geometry) * (np.mod(angle - rest + np.pi, 2 * np.pi) - np.pi)
    shut = geometry.valve_arm_deg * DEG
    return geometry.valve_arm_mm * MM * (np.sin(shut + opening) - np.sin(shut))


def resting(points: np.ndarray, geometry: Geometry, theta: float) -> float:
    """Valve lift [m] of the follower that rests on points (p, 2) [m] of a contour at one cam angle [rad].

    Nothing is known of normals and envelopes. Minus infinity where no point lies under the follower.
    """
    z = (points[:, 0] + 1j * points[:, 1]) * np.exp(-1j * theta)
    base, radius = geometry.base_radius_mm * MM, (geometry.contact_radius_mm or 0.0) * MM
    if geometry.follower == "flat":
        return geometry.rocker_ratio * (z.real.max() - base)
    if geometry.follower == "roller":
        near = z[(np.abs(z.imag) <= radius) & (z.real > 0)]
        along = near.real + np.sqrt(radius**2 - near.imag**2)
        return geometry.rocker_ratio * (along.max(initial=-np.inf) - base - radius)
    return float(np.nanmax(valve_lift(geometry, swing_to(geometry, z, radius))))
