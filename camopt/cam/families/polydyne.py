"""Polydyne (Dudley 1948; Thoren, Engemann, Stoddart 1952), in the form of Kodama et al., Eqs. (1) to (3).

The wanted valve lift is y(x) = y_max (1 + sum_i C_i x^p_i), x = theta / half duration; the cam lift that makes a
train of stiffness k_e, spring rate k_sp and mass M follow it at the design speed is y_r + A y + B y'', with
A = (k_e + k_sp) / k_e and B = omega^2 M / k_e. Eq. (2) is printed with A dy/dt; only A y has the right dimension and
agrees with Eq. (3). Six linear unknowns (y_max and the five y_max C_i) meet the five conditions of Eq. (3) and the
total lift.
"""

import numpy as np

from camopt.cam.lift import Lift, with_ramps
from camopt.cam.osculating import MATCHED, osculating_pieces
from camopt.cam.ramps import Ramp, symmetric_conditions
from camopt.scene import InputError, Scene, Train, build_train
from camopt.scene.rest import static_matrices
from camopt.scene.train import GROUND
from camopt.scene.units import DEG, MM, MM_PER_DEG

LEAST_SHARE = 1e-9
"""Part of the valve's stiffness that is the cam's, below which rounding alone may have made it."""
ROUNDING = 1e-9
"""Relative excess over the maximum lift, and relative fall on the opening flank, that rounding explains."""
MISSED = 1e-6
"""Relative error of a condition that rounding may leave: solved conditions are met to 1e-9."""

LEAST_SPEED_RPM, MOST_SPEED_RPM = 1.0, 1e6


def equivalent_train(train: Train) -> tuple[float, float, float]:
    """(stiffness between cam and valve k_e [N/m], spring rate at the valve k_sp [N/m], moving mass M [kg]) of Eq. (2).

    Static condensation to the valve, whatever kinds of elements stand between cam and valve: their contacts are closed
    and the seat is open. k_sp is what the valve still feels when those contacts part; masses that nothing joins to the
    valve then do not count. M weighs each mass with the square of its share in a slow lift
    of the valve (Rayleigh). Raises InputError where a slow cam does not move the valve.
    """
    way = np.isin(np.arange(len(train.a)), train.cam_side)
    closed = ~train.contact | (train.preload > 0) | way  # a spring may be declared as a preloaded contact
    closed[train.seat] = False
    pull = np.zeros(len(train.mass) + 1)  # the last entry takes what pulls at the ground
    for e in np.flatnonzero(train.cam_driven & closed):
        pull[[train.a[e], train.b[e]]] += train.stiffness[e] * np.array([-1.0, 1.0])
    total, lifted = _condensed(train, closed, pull[:-1])
    spring, _ = _condensed(train, closed & ~way, pull[:-1])
    if total - spring <= LEAST_SHARE * total or lifted[train.valve] <= LEAST_SHARE:
        raise InputError(
            f"polydyne: the train has no equivalent of one mass, because a slow cam does not lift "
            f"{train.mass_names[train.valve]!r} against its spring: check what the cam drives, and hold what carries "
            f"the cam by a spring or a preloaded contact"
        )
    return total - spring, spring, float(train.mass @ (lifted / lifted[train.valve]) ** 2)


def _condensed(train: Train, closed: np.ndarray, pull: np.ndarray) -> tuple[float, np.ndarray]:
    """Stiffness [N/m] seen at the valve when all masses that `closed` elements join to it follow freely, and where
    they come to rest (n) [m] under forces `pull` (n) [N]; zeros where no element joins them to the ground."""
    stiffness, _ = static_matrices(train, closed)
    joined = np.isin(np.arange(len(train.mass)), train.valve)
    for _ in train.mass:
        joined |= np.any(stiffness[joined] != 0, axis=0)
    at_ground = closed & (train.a == GROUND) & joined[train.b] | closed & (train.b == GROUND) & joined[train.a]
    rest = np.zeros(len(train.mass))
    if not np.any(at_ground):
        return 0.0, rest
    unit = np.eye(len(train.mass))[train.valve]
    given, rest[joined] = np.linalg.solve(
        stiffness[np.ix_(joined, joined)], np.column_stack([unit[joined], pull[joined]])
    ).T
    return 1.0 / float(given @ unit[joined]), rest


def polydyne(
    scene: Scene,
    exponents: tuple[float, ...] = (2, 10, 18, 26, 34),
    design_speed_rpm: float | None = None,
    ramp_height_mm: float | None = None,
    dynamic: tuple[float, float] | None = None,
) -> Lift:
    """The Polydyne cam of a scene's duration, maximum lift and ramps.

    `exponents`: five distinct numbers from 2 up, integers or at least 8; `design_speed_rpm`: crankshaft speed at which
    the valve follows y exactly, the highest listed by default; `dynamic`: A [] and B [rad^2] in place of the train's.
    `ramp_height_mm` replaces the scene's on both sides (the paper's Table 4 uses 0.250). The cam is symmetric.
    Raises InputError for unusable exponents, speed or ramp height, a scene whose two ramps differ, a train without an
    equivalent of one mass, and a dynamic correction that leaves the family: a cam that exceeds the maximum lift or
    falls while it should rise.
    """
    powers = checked_exponents(exponents, "polydyne")
    design, operation = scene.design, scene.operation
    if design is None or operation is None:
        raise InputError("polydyne: the scene needs [design] and [operation]")
    if ramp_height_mm is not None:
        design = design.model_copy(update={"ramp_height_mm": ramp_height_mm, "closing_ramp_height_mm": ramp_height_mm})
        scene = scene.model_copy(update={"design": design})
    design, ramp = symmetric_conditions(scene, "polydyne")
    speed = operation.speeds_rpm[-1] if design_speed_rpm is None else design_speed_rpm
    if not LEAST_SPEED_RPM <= speed <= MOST_SPEED_RPM:
        raise InputError(
            f"polydyne: a design speed of {speed:g} r/min: one from {LEAST_SPEED_RPM:g} to {MOST_SPEED_RPM:g} is needed"
        )
    if dynamic is None:
        k_e, k_sp, mass = equivalent_train(build_train(scene))
        dynamic = 1 + k_sp / k_e, scene.cam_speed(speed) ** 2 * mass / k_e
    half, rise = design.duration_deg * DEG / 2, design.max_lift_mm * MM - ramp.height
    flank_end = np.array([0.0, 0.0, 0.0, -ramp.velocity / dynamic[1], 0.0])  # Eq. (3)
    parameters = {"exponents": [float(p) for p in powers], "design_speed_rpm": speed}
    parameters |= {"A": dynamic[0], "B_deg2": dynamic[1] / DEG**2, "ramp_height_mm": ramp.height / MM}
    try:
        borders, pieces = event_pieces(powers, half, flank_end, rise, ramp.height, *dynamic)
        lift = with_ramps(borders, pieces, ramp, ramp, "polydyne", parameters)
    except InputError:  # ramps that do not fit: no fault of the correction
        raise
    except (np.linalg.LinAlgError, ValueError):
        raise InputError(_left("its six conditions have no common solution", parameters, half)) from None
    if why := no_member(lift, design.max_lift_mm * MM, ramp):
        raise InputError(_left(why, parameters, half))
    return lift


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


def _left(why: str, parameters: dict, half: float) -> str:
    """The sentence of a dynamic correction that leaves the family, with its remedy."""
    exponents, speed = parameters["exponents"], parameters["design_speed_rpm"]
    follows = abs(parameters["B_deg2"] / parameters["A"]) ** 0.5
    shows = half / DEG / max(exponents)
    stiff = follows < shows
    train = "follows its cam within" if stiff else "lags behind its cam by"
    speeds = "a higher speed_rpm, higher exponents" if stiff else "a lower speed_rpm, lower exponents"
    return (
        f"polydyne: the dynamic correction leaves the family at exponents {'/'.join(f'{p:g}' for p in exponents)} and "
        f"speed_rpm {speed:g}: {why}; the train {train} {follows:.2g} deg, and the highest exponent shapes the ramp's "
        f"end within {shows:.2g} deg; try {speeds}, or the family exponent, which leaves the correction out"
    )


def checked_exponents(exponents: tuple[float, ...], family: str) -> np.ndarray:
    """The exponents (5) as numbers; raises InputError where they are not five distinct and usable numbers."""
    powers = np.array(exponents, dtype=float)
    if len(powers) != 5 or len(set(exponents)) != 5 or powers.min() < 2 or not np.all(np.isfinite(powers)):
        raise InputError(f"{family}: exponents {exponents}: five distinct numbers from 2 up are needed")
    if np.any((powers != np.round(powers)) & (powers < 8)) or powers.max() > 100:
        raise InputError(f"{family}: exponents {exponents}: each must be an integer or at least 8, and at most 100")
    return powers


def event_pieces(
    powers: np.ndarray,
    half: float,
    flank_end: np.ndarray,
    rise: float,
    ramp_height: float,
    a: float,
    b: float,
    shares: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Borders [rad] and pieces of the symmetric cam ramp_height + a y + b y'' between the ramp tops.

    y = y_max (1 + sum_i C_i x^p_i) has the value and four derivatives `flank_end` (5) [m/rad^k] at x = 1; the cam rises
    by `rise` [m] from the ramp top to the nose. `shares` of the half duration are the borders of a flank's pieces, by
    default `piece_shares`. The arrays are NumPy's or JAX's, but `shares`: x^p has no derivative by x at 0 for JAX.
    """
    xp = powers.__array_namespace__()
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
