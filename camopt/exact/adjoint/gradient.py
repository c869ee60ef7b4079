"""Values and exact gradients of a motion's metrics: by the cam, by the start state and by the train."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from camopt.cam.lift import Lift
from camopt.exact.adjoint.motion import Gradient, TracedMotion
from camopt.exact.adjoint.slopes import ByTrain, by_train, room_for_bars
from camopt.exact.affine.lines import rest_of
from camopt.exact.kernel.arrays import train_arrays
from camopt.exact.kernel.elements import classify
from camopt.scene.shapes import Float, State
from camopt.scene.train import Train


def value_and_gradient(
    train: Train,
    lift: Lift,
    cam_speed: float,
    metrics: Sequence[str],
    start: State | None = None,
    *,
    revolutions: int = 1,
    revolution: int = 0,
    cotangent: Float[np.ndarray, " l"] | None = None,
    mechanical: bool = False,
    spacing: float | None = None,
) -> Gradient:
    """Values of metrics (l) in one revolution of an event-exact motion and their gradients.

    The motion runs `revolutions` from the state `start` ([m], [m/s], [m]) at -pi, which is held fixed. Without a
    start it runs from rest, and gradients by the train then include how the rest position depends on the train. With
    a `cotangent` of the values only their weighted sum is differentiated, in one sweep. With `mechanical` there
    are gradients by the train's parameters too. `spacing` [rad] has the meaning that it has for `TracedMotion`.

    Raises MotionRefused for endless switching or a motion without bound, InputError for an unknown metric.
    """
    at = rest_of(train) if start is None else start
    motion = TracedMotion(train, lift, cam_speed, at, revolutions, mechanical, spacing)
    gradient = motion.gradient(metrics, revolution, cotangent)
    if start is None and gradient.by_train is not None:
        return replace(gradient, by_train=gradient.by_train + rest_back(train, gradient.by_start))
    return gradient


def rest_back(train: Train, by_start: Float[np.ndarray, "l state"]) -> ByTrain:
    """Gradients by the train, through the state at rest, of l numbers of a motion that starts from rest.

    `by_start` are their gradients by the start state. At rest the forces of all elements without memory balance, and a
    memory is its element's compression. The pieces that hold are taken as fixed, which is right unless one of them only
    just holds.
    """
    arrays, state, n = train_arrays(train), rest_of(train), len(train.mass)
    status = np.empty(len(train.a), dtype=np.int64)
    classify(arrays, 1.0, np.concatenate([state, np.zeros(2)]), status)
    pieces, memory = arrays.first[:-1] + status, list(train.memory)
    d, carries = train.compression(state[:n], 0.0), np.where(arrays.memory < 0, 1.0, 0.0)
    rows, slope, by_memory = train.incidence, carries * arrays.law[pieces, 1], by_start[:, 2 * n :]
    push = np.linalg.solve((rows.T * slope) @ rows, (by_start[:, :n] + by_memory @ rows[memory]).T).T
    on, bars = push @ rows.T * carries, room_for_bars(arrays, (0, 0), len(push), True)
    bars.mass[:, 2] = push
    for e in np.flatnonzero(carries):
        bars.law[:, pieces[e], 0], bars.law[:, pieces[e], 1] = -on[:, e], -on[:, e] * d[e]
    bars.gap[:] = on * slope
    bars.gap[:, memory] -= by_memory
    return by_train(train, bars)
