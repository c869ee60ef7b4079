"""One settled revolution of the simulated motion: the force between cam and follower, and the valve's own lift."""

from contextlib import suppress

import numpy as np

from camopt.cam.lift import Lift
from camopt.scene import MotionRefused, Response, Scene, Train, build_train
from camopt.scene.units import DEG

REVOLUTIONS = 6
"""From rest to the revolution that is read: five to six are usually taken as settled (Wagstaff 1967, as MOTORI 2004
quotes)."""


def settled_force(scene: Scene, train: Train, lift: Lift, speed_rpm: float) -> tuple[np.ndarray, np.ndarray, str]:
    """Cam angles (k) [rad] of one revolution, the cam's force [N] there, and the method; see `_settled`."""
    motion, angle, last, method = _settled(scene, train, lift, speed_rpm)
    return angle, motion.force[last, int(np.argmax(train.cam_driven))], method


def settled_valve(scene: Scene, lift: Lift, speed_rpm: float) -> tuple[np.ndarray, np.ndarray, str]:
    """Cam angles (k) [rad] of one revolution, how far the valve is off its seat there [m], never below zero, and the
    method; see `_settled`."""
    motion, angle, last, method = _settled(scene, build_train(scene), lift, speed_rpm)
    return angle, np.maximum(motion.seat_separation()[last], 0.0), method


def _settled(scene: Scene, train: Train, lift: Lift, speed_rpm: float) -> tuple[Response, np.ndarray, slice, str]:
    """The motion from rest, angles (k) [rad] and samples of its last revolution, and the method: event-exact, or rkg
    where that refuses.

    Event-exact is not asked where the train's laws are beyond it. Raises InputError as
    `camopt.study.simulate.motion.recorded` does.
    """
    from camopt.study.simulate.motion import recorded

    motion, method = None, "event-exact"
    if train.straight:
        with suppress(MotionRefused):
            motion = recorded(scene, lift, speed_rpm, "event", revolutions=REVOLUTIONS)
    if motion is None:
        motion, method = recorded(scene, lift, speed_rpm, "rkg", revolutions=REVOLUTIONS), "rkg"
    steps = (len(motion.angle) - 1) // REVOLUTIONS
    return motion, (np.arange(steps + 1) * (360.0 / steps) - 180.0) * DEG, slice(-steps - 1, None), method
