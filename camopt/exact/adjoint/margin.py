"""The contact force margin: what the least contact force would be if the contacts could also pull, with its gradient.

The least contact force cannot fall below zero: where a contact parts, the force is zero and so is its gradient, and the
motion beyond soon forgets its cam. If the contacts between cam and valve are held closed, they pull instead of parting.
The motion is then linear except for the seat, and the least force of the held contacts is the margin. While no contact
parts, the margin equals the least contact force, except for what happens inside the lash, which held contacts cross
without touching (a few newtons on `kodama`). A negative margin says how much force is missing.
"""

from dataclasses import replace

import numpy as np

from camopt.cam.lift import Lift
from camopt.exact.adjoint.gradient import periodic_value_and_gradient, value_and_gradient
from camopt.exact.adjoint.motion import Gradient
from camopt.exact.engine import prepare
from camopt.scene.errors import MotionRefused
from camopt.scene.rest import state_at_rest
from camopt.scene.tied_contacts import HOLDING_N, held_closed
from camopt.scene.train import Train

NAME = "contact_force_margin_N"
MOST_REVOLUTIONS = 200
REPEATS = 1e-11, 1e-8
"""The held motion counts as periodic when, over a revolution, positions change by less than the first number [m] and
velocities by less than the second [m/s]."""


def contact_force_margin(
    train: Train, lift: Lift, cam_speed: float, *, settled: bool = False, mechanical: bool = False
) -> Gradient:
    """Least force [N] of the contacts between cam and valve, held closed, within half the duration from the nose.

    The force is that of the first revolution from rest. With `settled` it is that of the periodic motion, and the
    gradient includes how that motion changes with cam and train. The result is a `Gradient` of one number; with
    `mechanical` it has gradients by the train's parameters too. Raises InputError for laws that are not linear, and
    MotionRefused where the held motion does not settle or pulls with more than `HOLDING_N`.
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
    """The state (2n) at -pi that repeats after a revolution; raises MotionRefused where the motion does not settle."""
    revolve, state, allowed = prepare(held, lift, cam_speed), state_at_rest(held), np.repeat(REPEATS, len(held.mass))
    for _ in range(MOST_REVOLUTIONS):
        last, state = state, revolve.advance(state)
        if np.all(np.abs(state - last) < allowed):
            return state
    raise MotionRefused(
        f"at {cam_speed * 30 / np.pi:g} cam r/min the motion with held contacts does not repeat within "
        f"{MOST_REVOLUTIONS} revolutions: the valve bounces on its seat; take the margin of the first revolution"
    )
