"""The methods that are tried on the extremes, by name, each as `prepare(train, lift, cam_speed, steps)`.

Only the smooth methods import JAX, and only when they are asked for. They are not refined by their step but by the
width of the contact's layer and the error permitted; both are halved where the other methods halve their step.
"""

from functools import partial

import numpy as np

from camopt import exact
from camopt.cam.lift import Lift
from camopt.scene import MotionRefused, Response, Train
from camopt.scene.response import Revolve
from camopt.verifier.convergence import Prepare
from camopt.verifier.methods import dop853, houbolt, rkg, tmm

STEP_METHODS: dict[str, Prepare] = {
    "rkg": rkg.prepare,
    "tmm": tmm.prepare,
    "tmm-exponential": partial(tmm.prepare, exponential=True),
    "houbolt": houbolt.prepare,
    "houbolt-explicit": partial(houbolt.prepare, explicit=True),
}
"""Methods with fixed steps, which locate no switching."""
LOCATING: dict[str, Prepare] = {"event": exact.prepare, "dop853": dop853.prepare}
"""Methods that locate every switching."""
DIAL = 1024
"""Setting with which the smooth methods begin, in place of steps; at four times this they have their defaults."""
SINGLE_EPS, SINGLE_TOLERANCE = 1e-6, 1e-7
"""Width of the layer and error permitted [m] at four times DIAL in single precision, which rounds lifts to 1e-9 m: the
edge of a narrower layer would be shorter than that."""


def smooth(train: Train, lift: Lift, cam_speed: float, dial: int, narrower: float = 1.0) -> Revolve:
    """The smooth path in double precision; its width and the error permitted are divided by `narrower`."""
    from camopt.smooth.contact import Layer
    from camopt.smooth.simulate import EPS, TOLERANCE, prepare

    wide = 4 * DIAL / dial / narrower
    return prepare(train, lift, cam_speed, layer=Layer(wide * EPS), tolerance=max(wide, 1.0) * TOLERANCE)


def smooth_float32(train: Train, lift: Lift, cam_speed: float, dial: int) -> Revolve:
    """The smooth path in single precision. The revolution raises MotionRefused where no grid resolves the motion."""
    import jax.numpy as jnp

    from camopt.smooth.contact import Layer
    from camopt.smooth.scan import DrivenSystem
    from camopt.smooth.simulate import STEPS, compiled_response, lift_samples
    from camopt.smooth.system import build_system, stacked

    single, wide = jnp.float32, 4 * DIAL / dial
    samples = jnp.asarray(lift_samples(lift), single)
    driven = DrivenSystem(build_system(train, single), samples, single(cam_speed))
    eps, tolerance = (jnp.asarray(wide * q, single) for q in (SINGLE_EPS, SINGLE_TOLERANCE))

    def revolve(state: np.ndarray) -> Response:
        y0 = stacked(state, len(train.mass)).astype(single)
        motion = compiled_response(driven, y0, Layer(eps), tolerance, steps=4 * STEPS)
        angle, rise, x, v, force = (np.asarray(q, dtype=float) for q in motion[:5])
        memory = np.zeros((len(angle), 0)) if motion.memory is None else np.asarray(motion.memory, dtype=float)
        if not np.all(np.isfinite(x)):
            raise MotionRefused("smooth path in single precision: no grid of the steps allowed resolves the motion")
        distinct = np.append(True, np.diff(angle) > 0)
        angle[-1] = np.pi  # its rounding to single precision lies beyond
        return Response(train, cam_speed, *(q[distinct] for q in (angle, rise, x, v, force, memory)))

    return revolve


SMOOTH: dict[str, Prepare] = {"smooth": smooth, "smooth-float32": smooth_float32}
