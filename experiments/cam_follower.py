"""At what speed does the follower of arXiv 0711.1008 leave its cam, how does it move then, and which cam keeps contact
to the highest speed?

A rigid follower of 1.221 kg on a spring of 1430.8 N/m, with restitution 0.8, on a cam of circular arcs
(siconos-tutorials, CamFollower, CamState.h), symmetric about beta = pi. camopt's contact is stiff, with the damping
that gives this restitution; the motions are computed with three stiffnesses to show which results depend on the
stiffness. Long motions are classified by their states at -180 deg over the last revolutions.
"""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from scipy.optimize import brentq

from camopt.cam.lift import Lift
from camopt.exact import prepare
from camopt.highs import minimise
from camopt.scene import build_train, load_scene, state_at_rest
from camopt.scene.response import record_of
from camopt.scene.train import Train
from camopt.scene.units import DEG, MM, RPM
from experiments.support.panels import Panel, panels
from experiments.support.record import RESULTS, run_script, write_result

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
    """The source's cam: every arc as polynomials of so high a degree that only rounding errors remain."""
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
    """Damping [N s/m] of a non-pulling contact from which a mass rebounds at `restitution` times its approach speed.

    During contact the mass moves as a damped oscillator; the force is zero again at w t = pi - atan2(2 z sqrt(1 - z^2),
    1 - 2 z^2) with the damping ratio z (Schwager and Poeschel 2007, Granular Matter 9).
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

    A linear program in the accelerations at the knots. The lower limit holds at every angle, because it is imposed on
    the four control points of the cubic in each interval.
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
    low, high = np.append(np.full(len(rows), -decline * shift), 0.0), np.append(np.full(len(rows), np.inf), 0.0)
    optimum = minimise(-lift[-1], np.array([*rows, speed[-1]]), low, high, np.tile([-np.inf, most], (knots, 1)))
    return Rise(-optimum.value, np.linspace(0.0, angle, knots), optimum.x)


def least_decline(height: float, most: float, shift: float, angle: float, knots: int) -> float:
    """The least `decline` [1/rad^2] at which the linear program's rise reaches `height` [m]."""
    bound = bound_on_decline(height, most, shift, angle)
    short = lambda ratio: highest_rise(ratio * bound, most, shift, angle, knots).lift - height  # noqa: E731
    return bound * brentq(short, 1.0, 2.0, xtol=1e-12)


def bound_on_decline(height: float, most: float, shift: float, angle: float) -> float:
    """The least `decline` [1/rad^2] of any rise of that height and angle with accelerations up to `most` [m/rad^2].

    The best rise accelerates with `most` as long as possible and then follows the spring: lift = most theta^2 / 2 up to
    a switch at t, then lift + shift = (height + shift) cos(sqrt(decline) (angle - theta)). A rise that accelerates
    less, or leaves the spring's arc, is lower at the end. The switch and the decline are the two unknowns of two
    equations.
    """

    def apart(t: float) -> tuple[float, float]:
        """(decline of the arc that has the lift of the switch t, residual of the velocity there)."""
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


SCENE = Path(__file__).parent / "support" / "cam_follower.toml"
PUBLISHED_RPM = (358, 660, 700)
STIFFNESS = {"small": (1e8,), "full": (1e8, 1e9, 1e10)}
FADING = {"small": 100, "full": 1000}
"""Revolutions before a long motion is recorded."""
LOOKED_AT = {"small": 32, "full": 256}
SAME = 1e-6
"""Distance of two states [m] below which they count as one."""
NEIGHBOUR = 1e-9
"""Distance [m] at which a second motion starts, which measures the growth of small differences."""
OVERDAMPED = 20.0
"""Damping ratio of the contact for the detachment speed: at a step of acceleration the force overshoots by 1/1600."""
KNOTS = {"small": 101, "full": 801}
PUSHES = (None, 1.0, 10.0)
"""Largest accelerations [m/rad^2] of the cams with the highest detachment speed; None: that of the source's cam."""


def main(size: str, folder=RESULTS) -> dict:
    """Detachment, motions and the cams that keep contact to the highest speed."""
    scene = load_scene(SCENE)
    cam, nominal = profile(), build_train(scene)
    speed, angle = rigid_detachment(cam, nominal)
    content: dict = {
        "lift_m": cam.max_lift,
        "detachment": {"rigid_rpm": speed / RPM, "cam_angle_deg": 180.0 + abs(angle) / DEG},
        "motions": [motion(nominal, cam, k, rpm, size) for rpm in PUBLISHED_RPM for k in STIFFNESS[size]],
        "longest_on": [longest_on(nominal, cam, push, KNOTS[size]) for push in PUSHES],
    }
    content["detachment"]["compliant_rpm"] = {f"{k:g}": first_loss(nominal, cam, k) for k in STIFFNESS[size]}
    figures = {"motions": draw(nominal, cam)} if size == "full" else {}
    return write_result("cam_follower", size, content, figures, folder)


def with_contact(train: Train, stiffness: float, damping: float) -> Train:
    """The train with another stiffness and damping of the contact at the cam, its first element."""
    stiffnesses, dampings = train.stiffness.copy(), train.damping.copy()
    stiffnesses[0], dampings[0] = stiffness, damping
    return replace(train, stiffness=stiffnesses, damping=dampings)


def first_loss(nominal: Train, cam: Lift, stiffness: float) -> float:
    """Speed [r/min], to 0.01, above which the force of an overdamped contact reaches zero."""
    train = with_contact(nominal, stiffness, 2.0 * OVERDAMPED * np.sqrt(stiffness * nominal.mass[0]))

    def lost(rpm: float) -> bool:
        revolve = prepare(train, cam, rpm * RPM)
        return bool(np.any(revolve(revolve.advance(state_at_rest(train))).force[:, 0] <= 0.0))

    low, high = 100.0, 130.0
    while high - low > 0.01:
        middle = (low + high) / 2
        low, high = (low, middle) if lost(middle) else (middle, high)
    return high


def motion(nominal: Train, cam: Lift, stiffness: float, rpm: float, size: str) -> dict:
    """Period of a long motion in revolutions, or None, its hops, and the growth of small differences."""
    train = with_contact(nominal, stiffness, damping_of(RESTITUTION, stiffness, nominal.mass[0]))
    revolve, state = prepare(train, cam, rpm * RPM), state_at_rest(train)
    state = revolve.advance(state, FADING[size])
    near, growth, states, hops = state + np.array([NEIGHBOUR, 0.0]), [], [state], []
    for _ in range(LOOKED_AT[size]):
        response = revolve(state)
        hops.append(float(response.separation(0).max()))
        state, near = revolve.advance(state), revolve.advance(near)
        apart = max(abs(near[0] - state[0]), 1e-15)
        growth.append(np.log(apart / NEIGHBOUR))
        near = state + (near - state) * NEIGHBOUR / apart
        states.append(state)
    x = np.array(states)[:, 0]
    repeats = [p for p in range(1, len(x) // 2) if np.abs(x[p:] - x[:-p])[-len(x) // 2 :].max() < SAME]
    return {
        "speed_rpm": rpm,
        "stiffness_N_per_m": stiffness,
        "period_revolutions": repeats[0] if repeats else None,
        "largest_hop_mm": [min(hops) / MM, max(hops) / MM],
        "growth_per_revolution": float(np.exp(np.mean(growth))),
    }


def longest_on(train: Train, cam: Lift, push: float | None, knots: int) -> dict:
    """Detachment speed of the best symmetric cam of the same rise and dwell for a rigid follower, with its bound."""
    most = cam.extremes(2)[1] if push is None else push
    natural = np.sqrt(train.stiffness[1] / train.mass[0])
    shift = train.preload[1] / train.stiffness[1]
    bound = natural / np.sqrt(bound_on_decline(cam.max_lift, most, shift, TIP))
    best = cam_of(highest_rise(least_decline(cam.max_lift, most, shift, TIP, knots), most, shift, TIP, knots))
    return {
        "acceleration_max_m_per_rad2": most,
        "detachment_rpm": rigid_detachment(best, train)[0] / RPM,
        "bound_rpm": bound / RPM,
        "lift_m": best.max_lift,
    }


def draw(nominal: Train, cam: Lift) -> Figure:
    """Follower and cam over three revolutions at the published speeds, after the start-up transient has decayed."""
    train, rows = with_contact(nominal, 1e9, damping_of(RESTITUTION, 1e9, nominal.mass[0])), []
    for rpm in PUBLISHED_RPM:
        revolve = prepare(train, cam, rpm * RPM)
        motion = record_of(revolve, revolve.advance(state_at_rest(train), FADING["full"]), 3)
        lifts = {"cam": motion.lift, "follower": motion.x[:, 0]}
        curves = [(name, motion.angle / DEG, lift / MM) for name, lift in lifts.items()]
        rows.append([Panel("lift [mm]", curves, f"{rpm} r/min")])
    return panels(rows, "cam angle [deg]", width=7.0, row_height=2.0)


if __name__ == "__main__":
    run_script(main, __doc__)
