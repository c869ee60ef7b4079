"""The force between cam and follower under way: one settled revolution of the simulated motion."""

from contextlib import suppress

import numpy as np

from camopt.cam.lift import Lift
from camopt.scene import MotionRefused, Scene, Train
from camopt.scene.units import DEG

REVOLUTIONS = 6
"""From rest to the revolution that is read: five to six are usually taken as settled (Wagstaff 1967, as MOTORI 2004
quotes)."""


def settled_force(scene: Scene, train: Train, lift: Lift, speed_rpm: float) -> tuple[np.ndarray, np.ndarray, str]:
    """Cam angles (k) [rad] of one revolution, the cam's force [N] there, and the method: event-exact, or rkg where
    that refuses.

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
    force = motion.force[-steps - 1 :, int(np.argmax(train.cam_driven))]
    return (np.arange(steps + 1) * (360.0 / steps) - 180.0) * DEG, force, method
