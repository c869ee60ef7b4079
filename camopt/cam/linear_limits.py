"""Limits of an engineer's drawing that are linear in the lift. Each is declared once, here, for all parts of camopt.

A limit states that a weighted sum of the lift and its derivatives by the cam angle stays below a level at every angle
of a range. The linear programs impose it on control points, the upper bound has multipliers for it, and the verdict
evaluates the exact extremes of the cam's pieces. With the base circle's radius R, the follower's lift y = lift / rocker
ratio, and the cam speed w, a flat follower has (Norton, Cam Design and Manufacturing Handbook, 2009, ch. 7; Dowson,
Taylor and Zhu 1992 for the entrainment velocity)

    radius of curvature     R + y + y''
    face width needed       twice the largest |y'|
    entrainment velocity    w |(R + y) / 2 + y''|

The entrainment velocity is continuous and positive on the base circle. It stays away from zero only if it does not
change its sign, so this limit, too, is linear.

The centre of a roller of the radius r moves on the polar curve P = R + r + y, whose curvature is (P^2 + 2 P'^2 - P P'')
/ (P^2 + P'^2)^(3/2) (Norton 2009, ch. 7). The radius of the cam is at least rho where it is convex if this is at most 1
/ p with p = rho + r, and where it is concave if it is at least -1 / d with d = rho - r. The conditions

    convex      P'' >= P - P^2 / p,    sufficient if P exceeds 4 p / 3
    concave     P'' <= P + P^2 / d

neglect P'^2 on the safe side. The tangent of P^2 at any P0 makes both linear, again on the safe side. The programs of
the free cam approximate the radii more closely (`camopt.cam.families.radius_planes`); all others use these limits.

A piston limits the lift by the room that it leaves for the valve. With the crank's radius r, the rod l, the pin offset
e and the crank angle phi from the vertical, the piston stands r cos(phi) + sqrt(l^2 - (r sin(phi) - e)^2) above the
crank (Heywood, Internal Combustion Engine Fundamentals, 1988, ch. 2). It is highest when crank and rod are in line,
sin(phi) = e / (l + r), and crank angles count from there.
"""

from dataclasses import dataclass
from math import asin, cos

import numpy as np

from camopt.cam.lift import Lift
from camopt.cam.polynomials import PiecewiseLevel, flat_level
from camopt.scene.design import RADII, Design, Piston
from camopt.scene.shapes import Float
from camopt.scene.units import DEG, MM

FLANK = 0.25
"""Share of the lift at which cams are most concave, where the tangent is taken; elsewhere the limit is stricter."""
PIECE = 1.0 * DEG
"""Longest piece of the polynomials for the piston's room [rad of the cam]; their error is a few nanometres."""
SERIES_END = 1e-18
"""Magnitude of a term of a series, relative to its sum, below which the rest is bounded by a geometric series."""


@dataclass(frozen=True)
class LinearLimit:
    """sum_k weights[k] * lift^(k) <= level at every angle of the level.

    `key` is that of the design or of the geometry. `name` distinguishes the limit from others, `value` is the number
    that the scene states, in its key's unit, and `rate` is the change of that number per SI unit of the level. If
    `chosen`, it is one of several ways to satisfy the key, which a cam need not take: no upper bound may use it.
    """

    key: str
    name: str
    weights: tuple[float, ...]
    level: PiecewiseLevel
    value: float
    rate: float
    chosen: bool = False

    @property
    def size(self) -> float:
        """Magnitude of the limit [SI], to which its slack is relative: that of the level, but at least a millimetre."""
        return max(self.level.size, MM)

    def excess(self, lift: Lift, low: float = -np.pi, high: float = np.pi) -> float:
        """The largest amount [SI] by which the cam exceeds the level between two angles; negative if it stays below."""
        low, high = max(low, self.level.low), min(high, self.level.high)
        sums = weighted_sum(lift, self.weights)
        if len(self.level.coefficients) == 1:
            most = float(sums(np.array(low))) if low == high else sums.extremes(0, low, high)[1]
            return most - float(self.level.coefficients[0, 0])
        room = Lift(self.level.borders, -self.level.coefficients, lift.half_duration)
        return sums.shifted(room).extremes(0, low, high)[1] + self.level.error


def linear_limits(design: Design, centres: tuple[float, ...] = ()) -> list[LinearLimit]:
    """The linear limits of a design; `centres` [rad] has the middle of each duration, by default zero.

    A duration of at least D at a lift is imposed as that lift at both ends of an interval D, one of at most D as a lift
    below that outside it. The middle of the interval is free, so that a cam may have the duration about another middle.
    """
    half = design.duration_deg / 2 * DEG
    limits = []
    for angle, least, most in design.lift_at:
        at = angle * DEG, angle * DEG
        if least > 0:
            name = f"lift_at's least lift at {angle:g} deg"
            limits.append(LinearLimit("lift_at", name, (-1.0,), flat_level(-least * MM, *at), least, -1 / MM))
        if most < design.max_lift_mm:
            name = f"lift_at's largest lift at {angle:g} deg"
            limits.append(LinearLimit("lift_at", name, (1.0,), flat_level(most * MM, *at), most, 1 / MM))
    for i, row in enumerate(design.duration_at):
        limits += _durations(row, centres[i] if centres else 0.0, half)
    if design.piston is not None:
        assert design.cam_per_crank is not None, "the scene asks for it"
        room = piston_room(design.piston, design.cam_per_crank, np.pi)
        clearance = design.piston.clearance_mm
        limits.append(LinearLimit("piston", "piston.clearance_mm", (1.0,), room, clearance, -1 / MM))
    return limits + _of_a_flat_follower(design, half) + _of_a_roller(design, half)


def radii_held_near(design: Design) -> tuple[str, ...]:
    """Keys of the limits on radii, under a roller or pad, that programs linearise near a cam and solve repeatedly."""
    if design.geometry is None or design.geometry.contact_radius_mm is None:
        return ()
    return tuple(key for key in RADII if getattr(design, key) is not None)


def at_least(least_deg: float) -> str:
    """The name of the limit that a duration at a lift is at least this long."""
    return f"duration_at's lift for a duration of at least {least_deg:g} deg"


def _durations(row: tuple[float, float, float], centre: float, half: float) -> list[LinearLimit]:
    """The limits on the duration at one lift, about one centre [rad]."""
    height, least, most = row
    limits = []
    for sign in (-1, 1):
        at = np.clip(centre + sign * least * DEG / 2, -half, half)
        if least > 0:
            level = flat_level(-height * MM, at, at)
            limits.append(LinearLimit("duration_at", at_least(least), (-1.0,), level, height, -1 / MM, chosen=True))
        begins = np.clip(centre + sign * most * DEG / 2, -half, half)
        if abs(begins) < half:
            name = f"duration_at's lift for a duration of at most {most:g} deg"
            level = flat_level(height * MM, *sorted((begins, sign * half)))
            limits.append(LinearLimit("duration_at", name, (1.0,), level, height, 1 / MM, chosen=True))
    return limits


def _of_a_flat_follower(design: Design, half: float) -> list[LinearLimit]:
    geometry = design.geometry
    if geometry is None or geometry.follower != "flat":
        return []
    y, base, limits = 1 / geometry.rocker_ratio, geometry.base_radius_mm * MM, []

    def add(key: str, weights: tuple[float, ...], level: float, value: float, rate: float) -> None:
        limits.append(LinearLimit(key, key, weights, flat_level(level, -half, half), value, rate))

    if (radius := design.nose_radius_min_mm) is not None:
        add("nose_radius_min_mm", (-y, 0.0, -y), base - radius * MM, radius, -1 / MM)
    if (width := geometry.face_width_mm) is not None:
        for sign in (1, -1):  # the opening flank, the closing one
            add("face_width_mm", (0.0, sign * y), width / 2 * MM, width, 2 / MM)
    if (velocity := design.entrainment_min_m_per_s) is not None:
        assert design.slowest is not None, "the scene asks for it"
        level = base / 2 - velocity / design.slowest
        add("entrainment_min_m_per_s", (-y / 2, 0.0, -y), level, velocity, -design.slowest)
    return limits


def _of_a_roller(design: Design, half: float) -> list[LinearLimit]:
    geometry = design.geometry
    if geometry is None or geometry.roller_radius_mm is None or geometry.follower != "roller":
        return []
    y, roller = 1 / geometry.rocker_ratio, geometry.roller_radius_mm * MM
    base, rise = geometry.base_radius_mm * MM + roller, design.max_lift_mm * MM * y

    def limit(key: str, radius: float, sign: float, at: float) -> LinearLimit:
        """sign P'' <= sign P + (2 at P - at^2) / size, with P = base + y lift."""
        size = radius * MM - sign * roller
        weights = (-y * (sign + 2 * at / size), 0.0, sign * y)
        square = 2 * at * base - at**2
        level = flat_level(sign * base + square / size, -half, half)
        return LinearLimit(key, key, weights, level, radius, -(size**2) / square / MM, chosen=True)

    limits = []
    if (nose := design.nose_radius_min_mm) is not None:
        limits.append(limit("nose_radius_min_mm", nose, -1.0, base + rise))
    if (concave := design.concave_radius_min_mm) is not None:
        limits.append(limit("concave_radius_min_mm", concave, 1.0, base + FLANK * rise))
    return limits


def weighted_sum(lift: Lift, weights: tuple[float, ...]) -> Lift:
    """sum_k weights[k] * lift^(k), as a lift law."""
    total, c = np.zeros_like(lift.coefficients), lift.coefficients
    for weight in weights:
        total = total + weight * c
        c = np.pad(c[:, 1:] * np.arange(1, c.shape[1]), ((0, 0), (0, 1)))
    return Lift(lift.borders, total, lift.half_duration)


def piston_drop(piston: Piston, crank: Float[np.ndarray, "*k"], order: int = 0) -> Float[np.ndarray, "*k"]:
    """Distance of the piston below its highest position [m], or its derivative, at crank angles from there [rad]."""
    r, rod, e = (x * MM for x in (piston.stroke_mm / 2, piston.rod_mm, piston.pin_offset_mm))
    phi = crank + asin(e / (rod + r))
    side = r * np.sin(phi) - e
    upright = np.sqrt(rod**2 - side**2)
    if order == 1:
        return r * np.sin(phi) + side * r * np.cos(phi) / upright
    return np.sqrt((rod + r) ** 2 - e**2) - r * np.cos(phi) - upright


def piston_room(piston: Piston, cam_per_crank: float, half: float) -> PiecewiseLevel:
    """The largest lift [m] that keeps the clearance, at cam angles from -half to half [rad]. It consists of cubic
    Hermite pieces, whose error is width^4 / 384 times a bound on the fourth derivative."""
    from scipy.interpolate import CubicHermiteSpline  # imported here because only a scene with a piston needs it

    slope = cos(piston.valve_angle_deg * DEG)
    room = (piston.gap_at_top_mm - piston.clearance_mm) * MM
    edges = np.linspace(-half, half, int(np.ceil(2 * half / PIECE)) + 1)
    crank = piston.lobe_centre_deg * DEG + edges / cam_per_crank
    value = room + slope * piston_drop(piston, crank)
    rate = slope * piston_drop(piston, crank, 1) / cam_per_crank
    pieces = CubicHermiteSpline(edges, value, rate).c[::-1].T
    fourth = slope * largest_fourth_derivative(piston) / cam_per_crank**4
    return PiecewiseLevel(edges, pieces, float(np.diff(edges).max()) ** 4 / 384 * fourth)


def largest_fourth_derivative(piston: Piston) -> float:
    """A bound on the fourth derivative of the piston's position by the crank angle [m/rad^4].

    With u = (r sin(phi) - e) / l, the root is l (1 - sum over n of a_n u^(2n)) with positive a_n, and the fourth
    derivative of a trigonometric polynomial of degree 2n is at most (2n)^4 times its largest value (Bernstein 1912).
    """
    r, rod, e = (x * MM for x in (piston.stroke_mm / 2, piston.rod_mm, piston.pin_offset_mm))
    share = ((r + abs(e)) / rod) ** 2
    total, term, n = 0.0, share / 2, 1  # term: a_n u^(2n)
    while True:
        total += term * (2 * n) ** 4
        if share * ((n + 1) / n) ** 4 < 1:  # from here on the terms fall at least as fast as a geometric series
            rest = term * (2 * n) ** 4 / (1 - share * ((n + 1) / n) ** 4)
            if rest < SERIES_END * total or n > 10_000:
                return r + rod * (total + rest)
        term *= share * (2 * n - 1) / (2 * n + 2)
        n += 1
