"""Polydyne (Dudley 1948; Thoren, Engemann, Stoddart 1952), in the form of Kodama et al., Eqs. (1) to (3).

The required valve lift is y(x) = y_max (1 + sum_i C_i x^p_i) with x = theta / half duration. The cam lift with which a
train of stiffness k_e, spring rate k_sp and mass M follows it at the design speed is y_r + A y + B y'', with A = (k_e +
k_sp) / k_e and B = omega^2 M / k_e. Eq. (2) is printed with A dy/dt; only A y has the right dimension and fits Eq. (3).
Six linear unknowns (y_max and the five y_max C_i) satisfy the five conditions of Eq. (3) and the total lift.
"""

import numpy as np

from camopt.cam.families.powers import power_cam, power_construction, power_space
from camopt.cam.families.record import BuildEvent, Family, Parameter, Parameters, Space, number, numbers
from camopt.cam.lift import Lift
from camopt.cam.ramps import Ramp, symmetric_conditions
from camopt.scene import InputError, Scene, Train, build_train
from camopt.scene.design import Design
from camopt.scene.rest import linearised_at_rest, static_matrices
from camopt.scene.train import GROUND
from camopt.scene.units import DEG, MM

LEAST_SHARE = 1e-9
"""Stiffness towards the cam, relative to the total stiffness at the valve, up to which it may be rounding alone."""
LEAST_SPEED_RPM, MOST_SPEED_RPM = 1.0, 1e6
DESIGN_SPEEDS = 0.4, 1.1
"""Range of design speeds in a search, relative to the highest listed speed."""


def equivalent_train(train: Train) -> tuple[float, float, float]:
    """(stiffness between cam and valve k_e [N/m], spring rate at the valve k_sp [N/m], moving mass M [kg]) of Eq. (2).

    The train is condensed statically to the valve, whatever kinds of elements lie between cam and valve, with the
    contacts between them closed and the seat open. k_sp is the stiffness at the valve with those contacts open; masses
    that are then not connected to the valve do not count. Nonlinear laws are linearised. M weighs each mass with the
    square of its displacement relative to the valve's in a slow lift (Rayleigh). Raises InputError if the valve does
    not move.
    """
    train = linearised_at_rest(train)
    way = np.isin(np.arange(len(train.a)), train.cam_side)
    closed = ~train.contact | (train.preload > 0) | way  # a spring may be declared as a preloaded contact
    closed[train.seat] = False
    pull = -(train.stiffness * (train.cam_driven & closed)) @ train.incidence
    total, lifted = _condensed(train, closed, pull)
    spring, _ = _condensed(train, closed & ~way, pull)
    if total - spring <= LEAST_SHARE * total or lifted[train.valve] <= LEAST_SHARE:
        raise InputError(
            f"polydyne: the train has no equivalent of one mass, because a slow cam does not lift "
            f"{train.mass_names[train.valve]!r} against its spring: check what the cam drives, and hold what carries "
            f"the cam by a spring or a preloaded contact"
        )
    return total - spring, spring, float(train.mass @ (lifted / lifted[train.valve]) ** 2)


def _condensed(train: Train, closed: np.ndarray, pull: np.ndarray) -> tuple[float, np.ndarray]:
    """Stiffness [N/m] at the valve when all masses that `closed` elements join to it follow freely, and the
    displacements at rest (n) [m] under forces `pull` (n) [N]; zeros if no element joins them to the ground."""
    stiffness, _ = static_matrices(train, closed)
    joined = np.isin(np.arange(len(train.mass)), train.valve)
    for _ in train.mass:
        joined |= np.any(stiffness[joined] != 0, axis=0)
    at_ground = closed & (train.a == GROUND) & joined[train.b] | closed & (train.b == GROUND) & joined[train.a]
    rest = np.zeros(len(train.mass))
    if not np.any(at_ground):
        return 0.0, rest
    unit = np.eye(len(train.mass))[train.valve]
    unit_lift, rest[joined] = np.linalg.solve(
        stiffness[np.ix_(joined, joined)], np.column_stack([unit[joined], pull[joined]])
    ).T
    return 1.0 / float(unit_lift @ unit[joined]), rest


def polydyne(
    scene: Scene,
    exponents: tuple[float, ...] = (2, 10, 18, 26, 34),
    design_speed_rpm: float | None = None,
    *,
    ramp_height_mm: float | None = None,
    dynamic: tuple[float, float] | None = None,
) -> Lift:
    """The Polydyne cam of a scene's duration, maximum lift and ramps.

    `exponents`: five distinct numbers from 2 up, integers or at least 8; `design_speed_rpm`: the crankshaft speed at
    which the valve follows y exactly, by default the highest listed speed; `dynamic`: A [] and B [rad^2] in place of
    those of the train. `ramp_height_mm` replaces that of the scene on both sides (the paper's Table 4 uses 0.250). The
    cam is symmetric. Raises InputError for unusable exponents, speed or ramp height, a scene whose two ramps differ, a
    train without an equivalent of one mass, and a dynamic correction that leaves the family: a cam that exceeds the
    maximum lift or whose opening flank falls.
    """
    operation = scene.operation
    if scene.design is None or operation is None:
        raise InputError("polydyne: the scene needs [design] and [operation]")
    conditions = scene
    if ramp_height_mm is not None:
        heights = {"ramp_height_mm": ramp_height_mm, "closing_ramp_height_mm": ramp_height_mm}
        conditions = scene.model_copy(update={"design": scene.design.model_copy(update=heights)})
    design, ramp = symmetric_conditions(conditions, "polydyne")
    speed = operation.speeds_rpm[-1] if design_speed_rpm is None else design_speed_rpm
    if not LEAST_SPEED_RPM <= speed <= MOST_SPEED_RPM:
        raise InputError(
            f"polydyne: a design speed of {speed:g} r/min: one from {LEAST_SPEED_RPM:g} to {MOST_SPEED_RPM:g} is needed"
        )
    if dynamic is None:
        k_e, k_sp, mass = equivalent_train(build_train(scene))
        dynamic = 1 + k_sp / k_e, scene.cam_speed(speed) ** 2 * mass / k_e
    a, b = dynamic
    parameters = {"design_speed_rpm": speed, "A": a, "B_deg2": b / DEG**2, "ramp_height_mm": ramp.height / MM}
    law = a, b, [0.0, 0.0, 0.0, -ramp.velocity / b, 0.0]  # Eq. (3)
    return power_cam(
        "polydyne", exponents, design, ramp, law, lambda why: _refusal(why, exponents, parameters, design), **parameters
    )


def _refusal(why: str, exponents: tuple[float, ...], parameters: dict[str, float], design: Design) -> str:
    """The sentence on a dynamic correction that leaves the family, with its remedy."""
    speed, follows = parameters["design_speed_rpm"], abs(parameters["B_deg2"] / parameters["A"]) ** 0.5
    shows = design.duration_deg / 2 / max(exponents)
    stiff = follows < shows
    train = "follows its cam within" if stiff else "lags behind its cam by"
    speeds = "a higher speed_rpm, higher exponents" if stiff else "a lower speed_rpm, lower exponents"
    return (
        f"polydyne: the dynamic correction gives no valid cam at exponents {'/'.join(f'{p:g}' for p in exponents)} and "
        f"speed_rpm {speed:g}: {why}; the train {train} {follows:.2g} deg, and the highest exponent shapes the ramp's "
        f"end within {shows:.2g} deg; try {speeds}, or the family exponent, which leaves the correction out"
    )


def _construction(_: Scene, cam: Lift) -> tuple[Parameters, BuildEvent]:
    a, b = cam.parameters["A"], cam.parameters["B_deg2"] * DEG**2
    speed = cam.parameters["design_speed_rpm"]

    def dynamic(p: Parameters, ramp: Ramp) -> tuple:
        b_at_speed = b * (p["speed_rpm"] / speed) ** 2  # B = omega^2 M / k_e
        return a, b_at_speed, [0, 0, 0, -ramp.velocity / b_at_speed, 0]

    return power_construction(cam, {"speed_rpm": speed}, dynamic)


def _space(scene: Scene, jerk: bool, **fixed) -> Space:
    top = scene.required_operation.speeds_rpm[-1]
    bounds = [(DESIGN_SPEEDS[0] * top, DESIGN_SPEEDS[1] * top)]
    return power_space(lambda exponents, speed: polydyne(scene, exponents, speed, **fixed), bounds, [top])


FAMILY = Family(
    "polydyne",
    polydyne,
    {
        "exponents": Parameter("exponents", numbers),
        "speed_rpm": Parameter("design_speed_rpm", number),
        "ramp_height_mm": Parameter("ramp_height_mm", number, searched=False),
    },
    _construction,
    space=_space,
    line=("#D55E00", (0, (6, 1.5))),
)
