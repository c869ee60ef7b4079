"""The cam and follower of arXiv 0711.1008: profile, damping of a restitution, and the cam that keeps it on longest.

The profile is made of circular arcs (siconos-tutorials, CamFollower, CamState.h), symmetric about beta = pi.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq, linprog

from camopt.cam.lift import Lift
from camopt.scene.train import Train

BASE, FREE_END = 0.40, 0.30
"""Base circle radius and the position of the spring's free end [m]."""
K1, RHO1, K2, RHO3, TILT = 0.45, 0.85, 0.40393320723821, 0.15, np.radians(20.0)
FLANK, TIP = 1.050328174371336, 1.22173047639603
"""Angles after pi/2 at which the flank ends and at which the follower reaches the dwell [rad]."""
PIECES_PER_ARC, DEGREE = 16, 10
RESTITUTION = 0.8


def arcs(beta: np.ndarray) -> np.ndarray:
    """Lift [m] at cam angles beta [rad] in [0, pi] of the source."""
    flank = -K1 * np.sin(beta) + np.sqrt(RHO1**2 - (K1 * np.cos(beta)) ** 2)
    tip = -K2 * np.cos(beta + TILT) + np.sqrt(np.maximum(RHO3**2 - (K2 * np.sin(beta + TILT)) ** 2, 0.0))
    angle = beta - np.pi / 2
    choose = [angle <= 0.0, angle <= FLANK, angle <= TIP]
    return np.select(choose, [np.full_like(beta, BASE), flank, tip], K2 + RHO3) - BASE


def profile() -> Lift:
    """The source's cam: every arc as polynomials of so high a degree that rounding is what is left."""
    marks = np.pi / 2 + np.array([-np.pi / 2, 0.0, FLANK, TIP, np.pi / 2])
    half = np.concatenate([np.linspace(a, b, PIECES_PER_ARC, endpoint=False) for a, b in pairwise(marks)])
    half = np.append(half, np.pi)
    borders = np.concatenate([half - np.pi, np.pi - half[-2::-1]])
    rows = []
    for low, high in pairwise(borders):
        fit = np.polynomial.Chebyshev.interpolate(
            lambda s, a=low, b=high: arcs(np.pi - np.abs(a + (b - a) * s)), DEGREE, [0, 1]
        )
        power = fit.convert(kind=np.polynomial.Polynomial, domain=[-1, 1], window=[-1, 1])
        rows.append(np.resize(power.coef, DEGREE + 1) / (high - low) ** np.arange(DEGREE + 1))
    return Lift(borders, np.array(rows), np.pi / 2, "circular arcs")


def rigid_detachment(lift: Lift, train: Train) -> tuple[float, float]:
    """(cam speed [rad/s], angle [rad]) at which a rigid follower first leaves the cam.

    It leaves where mass * speed^2 * lift'' falls below -(preload + stiffness * lift) of its spring, element 1.
    """
    least, where = np.inf, 0.0
    for i, (low, high) in enumerate(pairwise(lift.borders)):
        at = np.linspace(0.0, high - low, 401)
        rise = np.polynomial.Polynomial(lift.coefficients[i])
        falling, held = -rise.deriv(2)(at), train.preload[1] + train.stiffness[1] * rise(at)
        with np.errstate(divide="ignore"):
            square = np.where(falling > 0.0, held / (train.mass[0] * falling), np.inf)
        k = int(np.argmin(square))
        if square[k] < least:
            least, where = float(square[k]), float(low + at[k])
    return float(np.sqrt(least)), where


def damping_of(restitution: float, stiffness: float, mass: float) -> float:
    """Damping [N s/m] with which a mass leaves a contact that only pushes at `restitution` times its approach speed.

    While they touch, x = sin(w t) exp(-z t / ...) as of any damped oscillator; the force is zero again at w t =
    pi - atan2(2 z sqrt(1 - z^2), 1 - 2 z^2) with the damping ratio z (Schwager and Poeschel 2007, Granular Matter 9).
    """

    def returned(ratio: float) -> float:
        root = np.sqrt(1.0 - ratio**2)
        phase = np.pi - np.arctan2(2 * ratio * root, 1 - 2 * ratio**2)
        return float(np.exp(-ratio / root * phase))

    ratio = brentq(lambda z: returned(z) - restitution, 1e-9, 0.99)
    return 2.0 * ratio * np.sqrt(stiffness * mass)


class Rise(NamedTuple):
    """A rise of the follower from rest to rest."""

    lift: float  # m, its height
    knots: np.ndarray  # rad
    acceleration: np.ndarray  # m/rad^2, at the knots, linear between them


def highest_rise(decline: float, most: float, shift: float, angle: float, knots: int) -> Rise:
    """The highest rise within `angle` [rad] whose acceleration stays below `most` [m/rad^2] and never sinks below
    -decline * (shift + lift), which is where a follower on a spring leaves the cam.

    A linear program in the accelerations at the knots. The lower limit holds at every angle, because the cubic in each
    interval stands with its four control points.
    """
    h = angle / (knots - 1)
    eye = np.eye(knots)
    speed, lift = np.zeros((knots, knots)), np.zeros((knots, knots))
    for i in range(1, knots):  # integrals of the straight lines, exact
        speed[i] = speed[i - 1] + h / 2 * (eye[i - 1] + eye[i])
        lift[i] = lift[i - 1] + h * speed[i - 1] + h**2 / 6 * (2 * eye[i - 1] + eye[i])
    rows = []
    for i in range(knots - 1):
        control = [lift[i], lift[i] + h / 3 * speed[i], lift[i + 1] - h / 3 * speed[i + 1], lift[i + 1]]
        rows += [eye[i] * (1 - k / 3) + eye[i + 1] * k / 3 + decline * control[k] for k in range(4)]
    found = linprog(
        -lift[-1],
        A_ub=-np.array(rows),
        b_ub=np.full(len(rows), decline * shift),
        A_eq=speed[-1:],
        b_eq=[0.0],
        bounds=[(None, most)] * knots,
        method="highs",
    )
    if found.x is None:
        raise RuntimeError(found.message)
    return Rise(float(-found.fun), np.linspace(0.0, angle, knots), found.x)


def least_decline(height: float, most: float, shift: float, angle: float, knots: int) -> float:
    """The least `decline` [1/rad^2] at which the linear program's rise reaches `height` [m]."""
    bound = bound_on_decline(height, most, shift, angle)
    short = lambda ratio: highest_rise(ratio * bound, most, shift, angle, knots).lift - height  # noqa: E731
    return bound * brentq(short, 1.0, 2.0, xtol=1e-12)


def bound_on_decline(height: float, most: float, shift: float, angle: float) -> float:
    """The least `decline` [1/rad^2] of any rise of that height and angle with accelerations up to `most` [m/rad^2].

    The best rise pushes with `most` as long as it can and then follows the spring: theta^2 / 2 with a switch at t, then
    lift + shift = (height + shift) cos(sqrt(decline) (angle - theta)). Whoever pushes less, or leaves the spring's arc,
    is lower at the end. So the switch and the decline are the two unknowns of two equations.
    """

    def apart(t: float) -> tuple[float, float]:
        """(decline that the arc needs at the switch t for its lift, and what is left of its velocity there)."""
        low = most * t**2 / 2
        root = np.arccos((low + shift) / (height + shift)) / (angle - t)
        return root**2, (height + shift) * root * np.sin(root * (angle - t)) - most * t

    longest = min(angle, np.sqrt(2 * height / most)) * (1 - 1e-12)
    switch = brentq(lambda t: apart(t)[1], 1e-9, longest, xtol=1e-15)
    return apart(switch)[0]


def cam_of(rise: Rise) -> Lift:
    """The symmetric cam of a rise that ends in the source's dwell."""
    start, h = TIP, float(np.diff(rise.knots[:2])[0])
    speed = lift = 0.0
    up = []
    for a, b in pairwise(rise.acceleration):
        up.append([lift, speed, a / 2, (b - a) / (6 * h)])
        lift, speed = lift + speed * h + (2 * a + b) * h**2 / 6, speed + (a + b) * h / 2
    opening = -np.pi / 2 + rise.knots
    down = [np.polynomial.Polynomial(row)(np.polynomial.Polynomial([h, -1.0])).coef for row in up[::-1]]
    dwell = [lift, 0.0, 0.0, 0.0]
    rows = [[0.0] * 4, *up, dwell, *[np.resize(np.append(d, [0] * 4), 4) for d in down], [0.0] * 4]
    borders = np.concatenate([[-np.pi], opening, -opening[::-1], [np.pi]])
    assert abs(start - rise.knots[-1]) < 1e-12
    return Lift(borders, np.array(rows), np.pi / 2, "longest on")
