"""Laws y_max (1 + sum_i C_i x^p_i) with five exponents, which Polydyne and the exponent polynomial share.

Six linear unknowns (y_max and the five y_max C_i) meet five conditions where the flank meets the ramp and the total
lift (Kodama et al., Eqs. (1) to (3)). The exponents, from 2 up, are what a search may choose.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from camopt.cam.families.record import Event, Parameters, Space
from camopt.cam.lift import Lift
from camopt.cam.polynomials import MATCHED, osculating_pieces
from camopt.cam.ramps import Ramp
from camopt.scene import InputError
from camopt.scene.design import ROUNDING
from camopt.scene.units import DEG, MM, MM_PER_DEG

MISSED = 1e-6
"""Relative error of a condition that rounding may leave: solved conditions are met to 1e-9."""
LEAST_REAL_EXPONENT = 8
"""An exponent below this has to be an integer, smooth enough at the nose: nothing can be differentiated by it."""
GAPS = [(2.0, 24.0), (1.0, 24.0), (1.0, 24.0), (1.0, 24.0)]
"""From one exponent to the next, the first being 2: none comes out above 98."""
PLAIN_GAPS = (8.0, 8.0, 8.0, 8.0)


def checked_exponents(exponents: tuple[float, ...], family: str) -> np.ndarray:
    """The exponents (5) as numbers; raises InputError where they are not five distinct and usable numbers."""
    powers = np.array(exponents, dtype=float)
    if len(powers) != 5 or len(set(exponents)) != 5 or powers.min() < 2 or not np.all(np.isfinite(powers)):
        raise InputError(f"{family}: exponents {exponents}: five distinct numbers from 2 up are needed")
    if np.any((powers != np.round(powers)) & (powers < LEAST_REAL_EXPONENT)) or powers.max() > 100:
        raise InputError(f"{family}: exponents {exponents}: each must be an integer or at least 8, and at most 100")
    return powers


def event_pieces(
    powers: np.ndarray,
    half: float,
    flank_end: np.ndarray,
    rise: float,
    ramp_height: float,
    dynamic: tuple[Any, Any],
    shares: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Borders [rad] and pieces of the symmetric cam ramp_height + a y + b y'' between the ramp tops.

    `dynamic` holds a [] and b [rad^2]. The law y = y_max (1 + sum_i C_i x^p_i) has the value and four derivatives
    `flank_end` (5) [m/rad^k] at x = 1; the cam rises by `rise` [m] from the ramp top to the nose. `shares` of the half
    duration are the borders of a flank's pieces, by default `piece_shares`. The arrays are NumPy's or JAX's, but
    `shares`: x^p has no derivative by x at 0 for JAX.
    """
    (a, b), xp = dynamic, powers.__array_namespace__()
    shares = piece_shares(powers) if shares is None else shares
    powers = xp.concatenate([np.zeros(1), powers])  # the first unknown is y_max itself
    rows = xp.stack([_power_derivatives(powers, np.ones(1), k)[0] / half**k for k in range(5)])
    nose = a * _power_derivatives(powers, np.zeros(1), 0) + b * _power_derivatives(powers, np.zeros(1), 2) / half**2
    system = xp.concatenate([rows, nose])
    wanted = xp.concatenate([flank_end, xp.asarray([rise])])
    scale = abs(system).max(axis=1)
    unknowns = xp.linalg.solve(system / scale[:, None], wanted / scale)
    borders = half * xp.asarray(shares)
    derivatives = (
        xp.stack(
            [
                (a * _power_derivatives(powers, shares, k) + b * _power_derivatives(powers, shares, k + 2) / half**2)
                @ unknowns
                / half**k
                for k in range(MATCHED)
            ]
        ).T
        + ramp_height * np.eye(MATCHED)[0]
    )
    mirrored = derivatives[::-1] * (-1.0) ** np.arange(MATCHED)
    pieces = xp.concatenate([osculating_pieces(-borders[::-1], mirrored), osculating_pieces(borders, derivatives)])
    return xp.concatenate([-borders[:0:-1], borders]), pieces


def piece_shares(powers: np.ndarray) -> np.ndarray:
    """Ascending borders in [0, 1] of the pieces of sum C_i x^p_i.

    Each piece is as wide as x^p (p width / x)^12 <= 1 allows, which keeps the error of `osculating_pieces` at its bound
    everywhere. The pieces widen towards the nose.
    """
    high = powers[powers >= 2 * MATCHED]  # lower powers are met exactly
    borders = [1.0]
    while borders[-1] > 0.0:
        width = np.min(borders[-1] ** (1 - high / (2 * MATCHED)) / high, initial=1.0)
        borders.append(max(0.0, borders[-1] - width))
    return np.array(borders[::-1])


def _power_derivatives(powers: np.ndarray, x: np.ndarray, order: int) -> np.ndarray:
    """d^order/dx^order of x^p for every x (k) and power (q), shape (k, q); x >= 0."""
    xp = powers.__array_namespace__()
    factor = xp.prod(xp.stack([powers - i for i in range(order)]), axis=0) if order else xp.ones_like(powers)
    left = xp.where(factor != 0, powers - order, 0.0)
    return factor * x[:, None] ** left


def no_member(lift: Lift, top: float, ramp: Ramp) -> str:
    """Why a solution of the six conditions is no cam under the maximum lift `top` [m], as a clause; "" where it is."""
    half, largest = lift.half_duration, lift.max_lift
    slowest, fastest = lift.extremes(1, -half, 0.0)
    missed = abs(lift(-half) - ramp.height) / top, abs(lift(-half, 1) / ramp.velocity - 1), abs(lift(0.0) / top - 1)
    if max(missed) > MISSED:
        return "rounding leaves its six conditions unmet"
    if largest > top * (1 + ROUNDING):
        return f"the cam would rise to {largest / MM:.4g} mm where max_lift_mm is {top / MM:g}"
    if slowest < -ROUNDING * fastest:
        return f"the opening flank would fall, by up to {-slowest / MM_PER_DEG:.3g} mm/deg"
    return ""


def power_construction(
    cam: Lift, own: Parameters, dynamic: Callable[[Parameters, Ramp], tuple]
) -> tuple[Parameters, Event]:
    """Own parameters of a cam of powers, `own` beside its exponents of at least 8, and its event built from them.

    `dynamic(parameters, ramp)` gives A, B [rad^2] and the five conditions at the flank's end [m/rad^k].
    """
    exponents = np.array(cam.parameters["exponents"])
    free = exponents >= LEAST_REAL_EXPONENT
    kept, placed = np.where(free, 0.0, exponents), np.eye(len(exponents))[:, free]
    shares = piece_shares(exponents)

    def event(p: Parameters, ramp: Ramp, _: Ramp):
        a, b, flank_end = dynamic(p, ramp)
        flank_end = p["exponents"].__array_namespace__().asarray(flank_end)
        half, rise = p["duration_deg"] * DEG / 2, p["max_lift_mm"] * MM - ramp.height
        return event_pieces(kept + placed @ p["exponents"], half, flank_end, rise, ramp.height, (a, b), shares)

    return {"exponents": exponents[free]} | own, event


def power_space(member: Callable[..., Lift], bounds: Sequence[tuple[float, float]], known: Sequence[float]) -> Space:
    """The gaps between the exponents, and parameters of the family's own with their bounds and a known point.

    `member(exponents, *own)` designs a member. An exponent below 8 is rounded: only integers are smooth enough there.
    """

    def member_at(x: np.ndarray) -> Lift:
        found = [2.0]
        for gap in x[:4]:
            power = found[-1] + float(gap)
            found.append(power if power >= LEAST_REAL_EXPONENT else float(round(power)))
        return member(tuple(found), *(float(value) for value in x[4:]))

    return Space([*GAPS, *bounds], member_at, [[*PLAIN_GAPS, *known]])
