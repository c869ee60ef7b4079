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
from camopt.study.timing import timed

FIGURES = ("bounce_mm", "jump_mm", "seating_velocity_m_per_s")
ANGLES = 720
"""Angles of the revolution at which lifts are compared."""


class RevolutionCase:
    """A speed: train, cam and rest state, and how figures are taken from a motion."""

    def __init__(self, scene: Scene, cam: Lift, speed_rpm: float):
        self.scene, self.cam, self.speed_rpm = scene, cam, speed_rpm
        self.train, self.cam_speed = build_train(scene), scene.cam_speed(speed_rpm)
        self.rest = state_at_rest(self.train)
        self.name = f"revolution at {speed_rpm:g} r/min"

    def figures(self, revolve: Callable[[np.ndarray], Response]) -> dict:
        """Bounce, jump and seating velocity of the first of two revolutions from rest, since its bounce ends in the
        second, and its valve lift [mm]."""
        return self._figures(self._two(revolve))

    def measured(self, revolve: Callable[[np.ndarray], Response]) -> dict:
        """The same with the times of a revolution, as a record."""
        times, motion = timed(lambda: self._two(revolve), 2)
        return {**times, "figures": self._figures(motion)}

    def _two(self, revolve) -> Response:
        first = revolve(self.rest)
        return joined([first, revolve(end_state(first))])

    def _figures(self, motion: Response) -> dict:
        metrics = measure(motion, self.cam)
        return {**{name: metrics[name][0] for name in FIGURES}, "lift_mm": valve_lift(motion)}


def valve_lift(motion: Response) -> np.ndarray:
    """Valve position at ANGLES + 1 angles of the first revolution [mm]."""
    grid, valve = np.linspace(-np.pi, np.pi, ANGLES + 1), motion.train.valve
    curve = Hermite(motion.angle, motion.x[:, valve], motion.v[:, valve] / motion.cam_speed)
    return np.asarray(curve(grid)) / MM
