"""Exponent polynomial: the lift law of Eq. (1) of Kodama et al. as the cam lift itself, without dynamic correction.

It is often miscalled Polydyne. Its powers are those of Dudley (1948). The five exponents meet five conditions where the
flank meets the ramp: the ramp's height, its velocity, and no acceleration, jerk or snap. The maximum lift is the sixth
condition.
"""

import numpy as np

from camopt.cam.families.powers import checked_exponents, event_pieces, no_member, power_construction, power_space
from camopt.cam.families.record import Family, Parameter, Parameters, numbers
from camopt.cam.lift import Lift, with_ramps
from camopt.cam.ramps import Ramp, symmetric_conditions
from camopt.scene import InputError, Scene
from camopt.scene.units import DEG, MM


def exponent(scene: Scene, exponents: tuple[float, ...] = (2, 10, 18, 26, 34)) -> Lift:
    """The exponent polynomial of a scene's duration, maximum lift and ramps, y_r + y_m (1 + sum_i C_i x^p_i).

    `exponents`: five distinct numbers from 2 up, integers or at least 8. Raises InputError for unusable exponents or a
    scene whose two ramps differ, and for exponents so close that rounding or the conditions leave no cam.
    """
    powers = checked_exponents(exponents, "exponent")
    design, ramp = symmetric_conditions(scene, "exponent")
    half, rise = design.duration_deg * DEG / 2, design.max_lift_mm * MM - ramp.height
    flank_end = np.array([0.0, -ramp.velocity, 0.0, 0.0, 0.0])
    named = f"exponent: exponents {'/'.join(f'{p:g}' for p in powers)} give no cam"
    try:
        borders, pieces = event_pieces(powers, half, flank_end, rise, ramp.height, (1.0, 0.0))
        lift = with_ramps(borders, pieces, ramp, ramp, "exponent", {"exponents": [float(p) for p in powers]})
    except (np.linalg.LinAlgError, ValueError):
        raise InputError(f"{named}: its six conditions have no common solution; give exponents further apart") from None
    if why := no_member(lift, design.max_lift_mm * MM, ramp):
        raise InputError(f"{named}: {why}; give exponents further apart")
    return lift


def _dynamic(p: Parameters, ramp: Ramp) -> tuple:
    return 1.0, 0.0, [0.0, -ramp.velocity, 0.0, 0.0, 0.0]


FAMILY = Family(
    "exponent",
    exponent,
    {"exponents": Parameter("exponents", numbers)},
    lambda _, cam: power_construction(cam, {}, _dynamic),
    space=lambda scene, jerk: power_space(lambda exponents: exponent(scene, exponents), [], []),
    line=("#E69F00", (0, (3, 1.2))),
)
