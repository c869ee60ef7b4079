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
from camopt.cam.ramps import symmetric_conditions
from camopt.scene import InputError, Scene, Train, build_train
from camopt.scene.rest import static_matrices
from camopt.scene.units import DEG, MM

LEAST_SPEED_RPM, MOST_SPEED_RPM = 1.0, 1e6


def equivalent_train(train: Train) -> tuple[float, float, float]:
    """Stiffness cam to valve k_e [N/m], spring rate at the valve k_sp [N/m] and moving mass M [kg] (Eq. (2)).

    Static condensation to the valve with the contacts between cam and valve closed and the seat open; M weighs each
    mass with the square of its share in a slow lift of the valve (Rayleigh).
    """
    closed = ~train.contact | (train.preload > 0)  # a spring may be declared as a preloaded contact
    closed[train.seat] = False
    closed[list(train.cam_side)] = False
    parted, _ = static_matrices(train, closed)
    parted += np.diag(np.where(np.diag(parted) == 0, 1.0, 0.0))  # masses the valve spring does not reach stay put
    closed[list(train.cam_side)] = True
    stiffness, _ = static_matrices(train, closed)
    total, spring = _condensed(stiffness, train.valve), _condensed(parted, train.valve)
    driven = train.cam_side[0]
    pull = np.zeros(len(train.mass))
    for mass, sign in ((train.a[driven], -1.0), (train.b[driven], 1.0)):
        if mass >= 0:
            pull[mass] = sign * train.stiffness[driven]
    share = np.linalg.solve(stiffness, pull)
    return total - spring, spring, float(train.mass @ (share / share[train.valve]) ** 2)


def _condensed(stiffness: np.ndarray, kept: int) -> float:
    """Stiffness seen at one mass when all others follow freely."""
    unit = np.eye(len(stiffness))[kept]
    return 1.0 / float(np.linalg.solve(stiffness, unit)[kept])


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
    Raises InputError for unusable exponents, speed or ramp height, and for a scene whose two ramps differ.
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
    borders, pieces = event_pieces(powers, half, flank_end, rise, ramp.height, *dynamic)
    parameters = {"exponents": [float(p) for p in powers], "design_speed_rpm": speed}
    parameters |= {"A": dynamic[0], "B_deg2": dynamic[1] / DEG**2, "ramp_height_mm": ramp.height / MM}
    return with_ramps(borders, pieces, ramp, ramp, "polydyne", parameters)


def checked_exponents(exponents: tuple[float, ...], family: str) -> np.ndarray:
    """The exponents (5) as numbers; InputError where they are not five distinct usable ones."""
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
    """Ascending borders in [0, 1] of the pieces of sum C_i x^p_i: at each as wide as x^p (p width / x)^12 <= 1 allows,
    which keeps the error of `osculating_pieces` everywhere at its bound. They widen towards the nose."""
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
