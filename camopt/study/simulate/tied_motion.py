"""A motion whose contacts between cam and valve are tied by a share: that of the rows of a search, state by state."""

import jax.numpy as jnp
import numpy as np

from camopt.cam.lift import Lift
from camopt.scene import MotionRefused, Response, Train
from camopt.scene.smoothing import Smoothing
from camopt.scene.units import RPM
from camopt.smooth.periodic_slopes import TiedMotions
from camopt.smooth.simulate import lift_samples
from camopt.smooth.tied import path_angles


def tied_motion(train: Train, lift: Lift, cam_speed: float, revolutions: int, smoothing: Smoothing) -> Response:
    """Motion from rest over `revolutions` with tied contacts; raises MotionRefused where it has no bound."""
    motions = TiedMotions(train, np.array([cam_speed]), (-lift.half_duration, lift.half_duration), smoothing)
    steps, samples = smoothing.steps, jnp.asarray(lift_samples(lift, smoothing.steps))
    driven, states, forces = motions.driven(samples), [motions.rest[None]], []
    for _ in range(revolutions):
        states.append(motions.revolution(samples, states[-1][-1]).states)
        forces.append(driven.forces(path_angles(steps), states[-1]))
    if not bool(jnp.all(jnp.isfinite(states[-1]))):
        raise MotionRefused(
            f"the smoothed motion with tied contacts grows without bound at {cam_speed / RPM:g} r/min of the camshaft: "
            f"give a larger width_um, or another speed"
        )
    y, n = np.asarray(jnp.concatenate(states))[..., 0], len(train.mass)
    force = np.asarray(jnp.concatenate([forces[-1][-1:], *forces]))[..., 0]  # at the start as a revolution later
    angle = np.linspace(-np.pi, (2 * revolutions - 1) * np.pi, revolutions * steps + 1)
    return Response(train, cam_speed, angle, lift(angle), y[:, 0, :n], y[:, 1, :n], force, y[:, 0, n:])
