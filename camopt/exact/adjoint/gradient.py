"""Values and exact gradients of a motion's metrics: by the cam, by the start state and by the train."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from camopt.cam.lift import Lift
from camopt.exact.adjoint.motion import ByTrain, Gradient, TracedMotion
from camopt.scene.rest import rest_position, state_at_rest, static_matrices
from camopt.scene.shapes import Float, State
from camopt.scene.train import GROUND, Train


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

    The motion runs `revolutions` from the state `start` ([m], then [m/s]) at -pi, which is held fixed. Without a
    start it runs from rest, and gradients by the train then include how the rest position depends on the train. With
    a `cotangent` of the values only their weighted sum is differentiated, in one sweep. With `mechanical` there
    are gradients by the train's parameters too. `spacing` [rad] has the meaning that it has for `TracedMotion`.

    Raises MotionRefused for endless switching or a motion without bound, InputError for an unknown metric or for laws
    that are not linear.
    """
    at = state_at_rest(train) if start is None else start
    motion = TracedMotion(train, lift, cam_speed, at, revolutions, mechanical, spacing)
    gradient = motion.gradient(metrics, revolution, cotangent)
    if start is None and gradient.by_train is not None:
        return replace(gradient, by_train=gradient.by_train + rest_back(train, gradient.by_start))
    return gradient


def periodic_value_and_gradient(
    train: Train,
    lift: Lift,
    cam_speed: float,
    metrics: Sequence[str],
    state: State,
    *,
    mechanical: bool = False,
) -> tuple[Gradient, Float[np.ndarray, "two_n two_n"]]:
    """Values and total gradients of metrics in the periodic motion through `state`, and the cycle map's Jacobian.

    `state` must repeat after one revolution; its own change with cam and train is included by implicit
    differentiation, z = P(z, p): dJ/dp = J_p + J_z (1 - P_z)^-1 P_p. Two revolutions are traced, so that windows that
    run into the next one are whole. `by_start` is the adjoint J_z (1 - P_z)^-1, not a free gradient: the start follows.
    """
    cycle = TracedMotion(train, lift, cam_speed, state, 1, mechanical)
    jacobian = cycle.pull_back(ends=np.eye(len(state))).by_start
    gradient = TracedMotion(train, lift, cam_speed, state, 2, mechanical).gradient(metrics)
    adjoint = np.linalg.solve((np.eye(len(state)) - jacobian).T, gradient.by_start.T).T
    through_start = cycle.pull_back(ends=adjoint)
    by_train = gradient.by_train
    if by_train is not None and through_start.by_train is not None:
        by_train = by_train + through_start.by_train
    by_coefficients = gradient.by_coefficients + through_start.by_coefficients
    return replace(gradient, by_coefficients=by_coefficients, by_start=adjoint, by_train=by_train), jacobian


def rest_back(train: Train, by_start: Float[np.ndarray, "l two_n"]) -> ByTrain:
    """Gradients by the train, through the rest position, of l numbers of a motion that starts from rest.

    `by_start` are their gradients by the start state. Rest solves K x = load over the closed contacts. The set
    of closed contacts is taken as fixed, which is right unless one of them only just touches.
    """
    n = len(train.mass)
    x = rest_position(train)
    d = train.compression(x, 0.0)
    closed = ~train.contact | (train.preload + train.stiffness * d > 0.0)
    push = np.linalg.solve(static_matrices(train, closed)[0], by_start[:, :n].T).T
    padded = np.concatenate([push, np.zeros((len(push), 1))], axis=1)  # index -1 reads the ground
    assert GROUND == -1
    on = (padded[:, train.a] - padded[:, train.b]) * closed
    zero = np.zeros_like(push)
    return ByTrain(zero, zero.copy(), push, -on * d, np.zeros_like(on), -on, on * train.stiffness)
