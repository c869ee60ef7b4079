"""One speed of `camopt tradeoff`: train, cam, rest state, and how figures are taken from a motion."""

from collections.abc import Callable

import numpy as np

from camopt.cam.lift import Lift
from camopt.measure.hermite import Hermite
from camopt.measure.metrics import measure
from camopt.scene import Response, Scene, build_train
from camopt.scene.response import end_state, joined
from camopt.scene.rest import state_at_rest
from camopt.scene.units import MM
from camopt.study.tradeoff.measurement import timed

FIGURES = ("bounce_mm", "jump_mm", "seating_velocity_m_per_s")
ANGLES = 720
"""Angles of the revolution at which lifts are compared."""


class RevolutionCase:
    """A speed: train, cam and rest state, and how figures are taken."""

    def __init__(self, scene: Scene, cam: Lift, speed_rpm: float):
        self.scene, self.cam, self.speed_rpm = scene, cam, speed_rpm
        self.train, self.cam_speed = build_train(scene), scene.cam_speed(speed_rpm)
        self.rest = state_at_rest(self.train)
        self.name = f"revolution at {speed_rpm:g} r/min"

    def two(self, revolve) -> Response:
        """Two revolutions from rest: the bounce of the first ends in the second."""
        first = revolve(self.rest)
        return joined([first, revolve(end_state(first))])

    def figures(self, motion: Response) -> dict:
        """Bounce, jump, seating velocity, and the valve's lift over the first revolution."""
        metrics = measure(motion, self.cam)
        return {**{name: metrics[name][0] for name in FIGURES}, "lift_mm": valve_lift(motion)}

    def measured(self, run: Callable[[], Response]) -> dict:
        times, motion = timed(run, 2)
        assert isinstance(motion, Response)
        return {**times, "figures": self.figures(motion)}


def valve_lift(motion: Response) -> np.ndarray:
    """Valve position at ANGLES + 1 angles of the first revolution [mm]."""
    grid, valve = np.linspace(-np.pi, np.pi, ANGLES + 1), motion.train.valve
    curve = Hermite(motion.angle, motion.x[:, valve], motion.v[:, valve] / motion.cam_speed)
    return np.asarray(curve(grid)) / MM
