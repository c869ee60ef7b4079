"""Laws y_max (1 + sum_i C_i x^p_i) with five exponents, which Polydyne and the exponent polynomial have in common.

Six linear unknowns (y_max and the five y_max C_i) satisfy five conditions where the flank meets the ramp and the total
lift (Kodama et al., Eqs. (1) to (3)). A search may choose the exponents, from 2 up.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from camopt.cam.families.record import BuildEvent, Parameters, Space
from camopt.cam.lift import Lift, with_ramps
from camopt.cam.polynomials import MATCHED, osculating_pieces, power_derivatives
from camopt.cam.ramps import Ramp
from camopt.scene import InputError
from camopt.scene.design import ROUNDING, Design
from camopt.scene.units import DEG, MM, MM_PER_DEG

MISSED = 1e-6
"""Relative error of a condition that rounding may leave; solved conditions are satisfied to 1e-9."""
LEAST_REAL_EXPONENT = 8
"""An exponent below this must be an integer, for smoothness at the nose; no derivative with respect to it exists."""
GAPS = [(2.0, 24.0), (1.0, 24.0), (1.0, 24.0), (1.0, 24.0)]
"""Bounds on the gaps between successive exponents, which start at 2: none exceeds 98."""
PLAIN_GAPS = (8.0, 8.0, 8.0, 8.0)
"""Gaps of the member that joins the first population of a search."""


def power_cam(
    family: str,
    exponents: tuple[float, ...],
    design: Design,
    ramp: Ramp,
    dynamic: tuple[float, float, Sequence[float]],
    refusal: Callable[[str], str],
    **parameters: float,
) -> Lift:
    """The cam of these exponents between two equal ramps; `dynamic` is as for `event_pieces`.

    Raises InputError for exponents that are not five distinct and usable numbers, for ramps that do not fit, and, with
    the sentence `refusal` of the reason, if the six conditions have no solution that is a cam.
    """
    powers = np.array(exponents, dtype=float)
    if len(powers) != 5 or len(set(exponents)) != 5 or powers.min() < 2 or not np.all(np.isfinite(powers)):
        raise InputError(f"{family}: exponents {exponents}: five distinct numbers from 2 up are needed")
    if np.any((powers != np.round(powers)) & (powers < LEAST_REAL_EXPONENT)) or powers.max() > 100:
        raise InputError(f"{family}: exponents {exponents}: each must be an integer or at least 8, and at most 100")
    half, top = design.duration_deg * DEG / 2, design.max_lift_mm * MM
    try:
        event = event_pieces(powers, half, top - ramp.height, ramp.height, dynamic)
        lift = with_ramps(*event, ramp, ramp, family, {"exponents": powers.tolist(), **parameters})
    except InputError:  # ramps that do not fit, whatever the exponents
        raise
    except (np.linalg.LinAlgError, ValueError):
        raise InputError(refusal("its six conditions have no common solution")) from None
    if why := _why_no_cam(lift, top, ramp):
        raise InputError(refusal(why))
    return lift


def event_pieces(
    powers: np.ndarray,
    half: float,
    rise: float,
    ramp_height: float,
    dynamic: tuple[Any, Any, Any],
    shares: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Borders [rad] and pieces of the symmetric cam ramp_height + a y + b y'' between the ramp tops.

    `dynamic` has a [], b [rad^2], and the value and four derivatives (5) [m/rad^k] of the law y = y_max (1 + sum_i C_i
    x^p_i) at x = 1; the cam rises by `rise` [m] from the ramp top to the nose. `shares` of the half duration are the
    borders of a flank's pieces, by default `piece_shares`. The arrays are NumPy's or JAX's, except `shares`, because
    JAX has no derivative of x^p by x at 0.
    """
    (a, b, flank_end), xp = dynamic, powers.__array_namespace__()
    shares = piece_shares(powers) if shares is None else shares
    powers = xp.concatenate([np.zeros(1), powers])  # the first unknown is y_max itself
    rows = xp.stack([power_derivatives(powers, np.ones(1), k)[0] / half**k for k in range(5)])
    nose = a * power_derivatives(powers, np.zeros(1), 0) + b * power_derivatives(powers, np.zeros(1), 2) / half**2
    system = xp.concatenate([rows, nose])
    wanted = xp.asarray([*flank_end, rise])
    scale = abs(system).max(axis=1)
    unknowns = xp.linalg.solve(system / scale[:, None], wanted / scale)
    borders = half * xp.asarray(shares)
    derivatives = (
        xp.stack(
            [
                (a * power_derivatives(powers, shares, k) + b * power_derivatives(powers, shares, k + 2) / half**2)
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
    """Ascending borders in [0, 1] of the pieces of sum C_i x^p_i, each as wide as x^p (p width / x)^12 <= 1 permits:
    the error of `osculating_pieces` equals its bound everywhere, and the pieces widen towards the nose."""
    high = powers[powers >= 2 * MATCHED]  # lower powers are met exactly
    borders = [1.0]
    while borders[-1] > 0.0:
        width = np.min(borders[-1] ** (1 - high / (2 * MATCHED)) / high, initial=1.0)
        borders.append(max(0.0, borders[-1] - width))
    return np.array(borders[::-1])


def _why_no_cam(lift: Lift, top: float, ramp: Ramp) -> str:
    """Why a solution of the six conditions is no cam under the maximum lift `top` [m], as a clause; "" if it is one."""
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
    cam: Lift, family_parameters: Parameters, dynamic: Callable[[Parameters, Ramp], tuple]
) -> tuple[Parameters, BuildEvent]:
    """The free parameters of a cam of powers, `family_parameters` and exponents of at least 8, and the function that
    builds its event, in which `dynamic(parameters, ramp)` returns the `dynamic` of `event_pieces`."""
    exponents = np.array(cam.parameters["exponents"])
    free = exponents >= LEAST_REAL_EXPONENT
    fixed, into_free = np.where(free, 0.0, exponents), np.eye(len(exponents))[:, free]
    shares = piece_shares(exponents)

    def event(p: Parameters, ramp: Ramp, _: Ramp):
        half, rise = p["duration_deg"] * DEG / 2, p["max_lift_mm"] * MM - ramp.height
        return event_pieces(fixed + into_free @ p["exponents"], half, rise, ramp.height, dynamic(p, ramp), shares)

    return {"exponents": exponents[free]} | family_parameters, event


def power_space(member: Callable[..., Lift], bounds: Sequence[tuple[float, float]], known: Sequence[float]) -> Space:
    """The search space: the gaps between the exponents, those below 8 being rounded, and further parameters of the
    family with their bounds and a known point; `member(exponents, *own)` designs a member."""

    def member_at(x: np.ndarray) -> Lift:
        exponents = [2.0]
        for gap in x[:4]:
            power = exponents[-1] + float(gap)
            exponents.append(power if power >= LEAST_REAL_EXPONENT else float(round(power)))
        return member(tuple(exponents), *(float(value) for value in x[4:]))

    return Space([*GAPS, *bounds], member_at, [[*PLAIN_GAPS, *known]])
