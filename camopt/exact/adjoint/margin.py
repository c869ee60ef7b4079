"""The contact force margin: what the least contact force would be if the contacts could also pull, with its gradient.

The least contact force stops at zero where a contact parts, and its gradient with it; beyond, the motion soon forgets
its cam. Held closed, the contacts pull instead: one linear motion but for the seat, whose least force is the margin.
While nothing parts the margin is the least contact force but for what happens inside the lash, which held contacts
cross without touching (on `kodama` a few newtons); negative, it says how much force is missing.
"""

from dataclasses import replace

import numpy as np

from camopt.cam.lift import Lift
from camopt.exact.adjoint.gradient import periodic_value_and_gradient, rest_state, value_and_gradient
from camopt.exact.adjoint.motion import Gradient
from camopt.exact.engine import prepare
from camopt.scene.errors import MotionRefused
from camopt.scene.tied_contacts import HOLDING_N, held_closed
from camopt.scene.train import Train

NAME = "contact_force_margin_N"
MOST_REVOLUTIONS = 200
REPEATS = 1e-11, 1e-8
"""Change of positions [m] and velocities [m/s] over a revolution below which the held motion repeats itself."""


def contact_force_margin(
    train: Train, lift: Lift, cam_speed: float, *, settled: bool = False, mechanical: bool = False
) -> Gradient:
    """Least force [N] of the contacts between cam and valve, held closed, within half the duration of the nose.

    In the first revolution from rest, or with `settled` in the periodic motion, whose own change with cam and train is
    then in the gradient. A `Gradient` of one number; `mechanical` as there. Raises InputError for laws that are not
    linear, MotionRefused where the held motion does not settle or pulls with more than `HOLDING_N`.
    """
    held, names = held_closed(train), ["contact_force_min_N"]
    if settled:
        state = _periodic_state(held, lift, cam_speed)
        found, _ = periodic_value_and_gradient(held, lift, cam_speed, names, state, mechanical=mechanical)
    else:
        found = value_and_gradient(held, lift, cam_speed, names, mechanical=mechanical)
    if found.values[0] <= 0.0:
        raise MotionRefused(f"held closed, a contact between cam and valve pulls with more than {HOLDING_N:g} N")
    return replace(found, metrics=(NAME,), values=found.values - HOLDING_N, runner_up=found.runner_up - HOLDING_N)


def _periodic_state(held: Train, lift: Lift, cam_speed: float) -> np.ndarray:
    """State (2n) at -pi that repeats; raises MotionRefused where the motion has not settled."""
    revolve, state, allowed = prepare(held, lift, cam_speed), rest_state(held), np.repeat(REPEATS, len(held.mass))
    for _ in range(MOST_REVOLUTIONS):
        last, state = state, revolve.advance(state)
        if np.all(np.abs(state - last) < allowed):
            return state
    raise MotionRefused(
        f"at {cam_speed * 30 / np.pi:g} cam r/min the motion with held contacts does not repeat within "
        f"{MOST_REVOLUTIONS} revolutions: the valve bounces on its seat; take the margin of the first revolution"
    )
