"""The force between cam and follower over one settled revolution, and the torque of a camshaft.

The shaft is rigid and turns at constant speed. The power of a lobe's force F on the valve's axis, F lift' omega,
therefore equals that of its torque. Sliding friction is neglected: the mean torque covers the train's damping losses.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np

from camopt.cam.lift import Lift
from camopt.scene import InputError, MotionRefused, Response, Scene, Train, build_train
from camopt.scene.rest import static_forces
from camopt.scene.shapes import Float
from camopt.scene.units import DEG

REVOLUTIONS = 6
"""Revolutions from rest, the last of which is used: five to six usually settle (Wagstaff 1967, in MOTORI 2004)."""
STEP_DEG = 0.5
MOST_LOBES = 100


def last_revolution(scene: Scene, lift: Lift, speed_rpm: float) -> tuple[Response, str]:
    """The last revolution of the motion from rest, at cam angles from -pi to pi, and the method: event-exact, or rkg
    where event-exact refuses or laws are curved. Raises InputError as `camopt.study.simulate.motion.recorded` does."""
    from camopt.study.simulate.motion import recorded

    motion, method = None, "event-exact"
    if build_train(scene).straight:
        with suppress(MotionRefused):
            motion = recorded(scene, lift, speed_rpm, "event", revolutions=REVOLUTIONS)
    if motion is None:
        motion, method = recorded(scene, lift, speed_rpm, "rkg", revolutions=REVOLUTIONS), "rkg"
    steps = (len(motion.angle) - 1) // REVOLUTIONS
    last = {name: getattr(motion, name)[-steps - 1 :] for name in ("lift", "x", "v", "force")}
    angle = (np.arange(steps + 1) * (360.0 / steps) - 180.0) * DEG
    return replace(motion, angle=angle, **last), method


def driven_element(scene: Scene) -> tuple[Train, int]:
    """The train and the index of its cam-driven element; raises InputError where it has none."""
    train = build_train(scene)
    if not np.any(train.cam_driven):
        raise InputError(
            f"scene {scene.name}: no element is cam driven, so the cam carries no force: set cam_driven = true in one"
        )
    return train, int(np.argmax(train.cam_driven))


@dataclass(frozen=True)
class CamshaftTorque:
    """The total `torque` [N m] of all lobes over one turn, at cam angles `theta` [rad] of the first lobe; `speed_rpm`
    is the crankshaft speed, None at standstill."""

    theta: Float[np.ndarray, " k"] = field(repr=False)
    torque: Float[np.ndarray, " k"] = field(repr=False)
    lobes: int
    speed_rpm: float | None

    def __str__(self) -> str:
        at = "standing still" if self.speed_rpm is None else f"at {self.speed_rpm:g} r/min"
        lobes = "1 lobe" if self.lobes == 1 else f"{self.lobes} lobes"
        mean = float(np.mean(self.torque[:-1]))
        return f"torque of {lobes} {at}: {self.torque.min():z.3f} to {self.torque.max():z.3f} N m, mean {mean:z.3f}"


def camshaft_torque(
    scene: Scene, cam: Lift, phases_deg: Sequence[float] = (0.0,), speed_rpm: float | None = None
) -> CamshaftTorque:
    """The torque of a shaft with equal lobes, which lag the first lobe by these cam angles.

    At a crankshaft speed the force is that of the sixth revolution from rest; without one it is that of the train at
    rest at each lift. Raises InputError for more than `MOST_LOBES` lobes, and as the simulation does.
    """
    if not 0 < len(phases_deg) <= MOST_LOBES:
        raise InputError(f"camshaft: {len(phases_deg)} lobes: from 1 to {MOST_LOBES} are needed")
    train, element = driven_element(scene)
    theta = np.linspace(-180.0, 180.0, round(360 / STEP_DEG) + 1) * DEG
    if speed_rpm is None:
        force = static_forces(train, cam(theta))[:, element]
    else:
        motion, _ = last_revolution(scene, cam, speed_rpm)
        force = np.interp(theta, motion.angle, motion.force[:, element], period=2 * np.pi)
    lobe = force * cam(theta, 1)
    total = sum(np.interp(theta - phase * DEG, theta, lobe, period=2 * np.pi) for phase in phases_deg)
    return CamshaftTorque(theta, np.asarray(total), len(phases_deg), speed_rpm)
