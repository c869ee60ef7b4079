"""Event-exact motion of a train with linear laws: every switching located to round-off, no stability limit.

The papers' transition matrix method with the exact exponential, the lift as exact polynomial pieces, and each contact's
switching found inside the step on the power series of the motion.
"""

import numpy as np

from camopt.cam.lift import Lift
from camopt.exact.kernel import CHATTER, NEED_PROPAGATOR, NOT_FINITE, revolve
from camopt.exact.propagators import default_step, propagators
from camopt.scene.errors import MotionRefused
from camopt.scene.response import Response, Revolve
from camopt.scene.train import Train

MOST_SWITCHINGS = 20_000
"""Contact switchings in one revolution beyond which the motion is refused as chatter."""


def train_arrays(train: Train) -> tuple:
    """The train as the plain arrays that the compiled kernel reads."""
    names = ("mass", "mass_damping", "mass_force", "a", "b", "contact", "cam_driven")
    return tuple(getattr(train, k) for k in (*names, "stiffness", "damping", "preload", "gap"))


def prepare(train: Train, lift: Lift, cam_speed: float, steps_per_revolution: int | None = None) -> Revolve:
    """One event-exact revolution as a function of its start state (2n).

    `cam_speed` [rad/s]. The step decides only how often the motion is sampled and how finely switchings are sought; by
    default it follows the highest mode and is the same at all speeds, so that one set of propagators serves them.
    Raises MotionRefused for endless switching or a motion without bound, InputError for laws that are not linear.
    """
    train.require_linear("event-exact", 'simulate with method "dop853", "rkg" or "smooth"')
    period = 2 * np.pi / cam_speed
    step = default_step(train) if steps_per_revolution is None else period / steps_per_revolution
    step = min(step, default_step(train), period / 360)
    n, e = len(train.mass), len(train.a)
    table = propagators(train, step, lift.coefficients.shape[1])
    arrays = train_arrays(train)
    samples = int(period / step) + len(lift.borders) + 2 * MOST_SWITCHINGS + 16
    rows = np.empty((samples, 2 + 2 * n + e))

    def one_revolution(state: np.ndarray) -> Response:
        code = NEED_PROPAGATOR
        while code == NEED_PROPAGATOR:
            x, v = state[:n].copy(), state[n:].copy()
            code, count, switchings = revolve(
                arrays, lift.borders, lift.coefficients, cam_speed, step, *table.built, x, v, rows
            )
            if code == NEED_PROPAGATOR:
                table.build(count)
        if code in (CHATTER, NOT_FINITE):
            what = (
                f"contacts switch more than {MOST_SWITCHINGS} times" if code == CHATTER else "the motion has no bound"
            )
            raise MotionRefused(
                f"event-exact at {cam_speed * 30 / np.pi:g} cam r/min: {what} in one revolution "
                f"({switchings} switchings): give the contacts damping, or check masses and stiffnesses"
            )
        done = rows[:count].copy()
        angle = done[:, 0] * cam_speed - np.pi
        angle[-1] = np.pi
        x, v, force = done[:, 2 : 2 + n], done[:, 2 + n : 2 + 2 * n], done[:, 2 + 2 * n :]
        return Response(train, cam_speed, angle, done[:, 1], x, v, force)

    return one_revolution
