"""The contact force margin (see `camopt.exact.adjoint.margin`) on the smooth path."""

import jax
import jax.numpy as jnp

from camopt.scene.tied_contacts import HOLDING_N, held_closed
from camopt.scene.train import Train
from camopt.smooth.contact import Layer
from camopt.smooth.metrics import event_metrics
from camopt.smooth.rest import rest_state
from camopt.smooth.scan import DrivenSystem
from camopt.smooth.simulate import EPS, STEPS, TOLERANCE, response_arrays
from camopt.smooth.system import build_system


def contact_force_margin(
    train: Train, samples: jax.Array, cam_speed, half_duration, *, eps=EPS, tolerance=TOLERANCE, steps: int = STEPS
) -> jax.Array:
    """Least force [N] of the contacts between cam and valve, held closed, in the first revolution from rest.

    `samples` are those of `lift_samples`, `cam_speed` is in rad/s and `half_duration` in rad, `eps` [m] is the width of
    the contacts' layer, `tolerance` and `steps` are those of `response_arrays`. The result is differentiable in
    `samples` and `cam_speed`. It is NaN where `steps` do not suffice or where the contacts pull with more than
    `HOLDING_N`. Raises InputError where `held_closed` does.
    """
    held = held_closed(train)
    system = build_system(held)
    driven = DrivenSystem(system, samples, cam_speed)
    motion = response_arrays(driven, rest_state(held), Layer(eps), tolerance, steps=steps)
    least = event_metrics(system, motion, cam_speed, half_duration, 0)["contact_force_min_N"]
    return jnp.where(least > 0.0, least - HOLDING_N, jnp.nan)
