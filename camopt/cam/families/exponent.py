"""Exponent polynomial: the lift law of Eq. (1) of Kodama et al. as the cam lift itself, without dynamic correction.

It is often wrongly called Polydyne. Its powers are those of Dudley (1948). The coefficients of its five powers and its
height satisfy six conditions: where the flank meets the ramp, its height and velocity are the ramp's and its
acceleration, jerk and snap are zero; the sixth condition is the maximum lift.
"""

from camopt.cam.families.powers import power_cam, power_construction, power_space
from camopt.cam.families.record import Family, Parameter, Parameters, numbers
from camopt.cam.lift import Lift
from camopt.cam.ramps import Ramp, symmetric_conditions
from camopt.scene import Scene


def exponent(scene: Scene, exponents: tuple[float, ...] = (2, 10, 18, 26, 34)) -> Lift:
    """The exponent polynomial of a scene's duration, maximum lift and ramps, y_r + y_m (1 + sum_i C_i x^p_i).

    `exponents`: five distinct numbers from 2 up, integers or at least 8. Raises InputError for unusable exponents, for
    a scene whose two ramps differ, and for exponents too close together for a cam.
    """
    design, ramp = symmetric_conditions(scene, "exponent")
    named = f"exponent: exponents {'/'.join(f'{p:g}' for p in exponents)} give no cam"
    return power_cam(
        "exponent", exponents, design, ramp, _dynamic({}, ramp),
        lambda why: f"{named}: {why}; give exponents further apart",
    )  # fmt: skip


def _dynamic(_: Parameters, ramp: Ramp) -> tuple:
    return 1.0, 0.0, [0.0, -ramp.velocity, 0.0, 0.0, 0.0]


FAMILY = Family(
    "exponent",
    exponent,
    {"exponents": Parameter("exponents", numbers)},
    lambda _, cam: power_construction(cam, {}, _dynamic),
    space=lambda scene, jerk: power_space(lambda exponents: exponent(scene, exponents), [], []),
    line=("#E69F00", (0, (3, 1.2))),
)
