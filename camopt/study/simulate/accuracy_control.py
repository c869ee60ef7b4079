"""A motion at an asked accuracy: the dial of a method turned until the answer stands, with the error estimated.

A method's dial is its step times the train's highest rate [rad], or of the smooth path the layer's width [m]. It starts
where the stored curves say that half of all motions are right, and is halved until the valve's position at every angle
differs from the coarser answers by no more than a part of what was asked: no method that steps across contacts has an
order that would allow less. Where the dial ends first, or where the motion multiplies even round-off beyond what was
asked, the answer is a range: the estimate says how wide.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from camopt.measure.hermite import Hermite
from camopt.scene.errors import InputError, MotionRefused
from camopt.scene.response import Response
from camopt.scene.units import UM
from camopt.verifier.accuracy import effort_of
from camopt.verifier.stored_curves import stored_curves

ANGLES = 1440
"""Angles per revolution at which answers are compared."""
ESTIMATES = {"event": (2, 4.0), "dop853": (2, 4.0), "smooth": (2, 1.0)}
STEPPING = (3, 1.5)
"""How many coarser answers count, and the estimate over the largest difference to them. The methods that locate every
switching differ by round-off alone, which chance makes small now and then; the smooth path's error falls with its width
and is a third of the difference. A method that steps across contacts (STEPPING) is late there by a share of its step
that is as good as drawn anew at every setting: where such an error is uniform and the step is halved until the estimate
is within what was asked, two coarser answers break one promise in ten, three with half as much again one in 240."""
FINEST_UM = 1e-3
"""Least error that is stated: positions are read from cubics, and digits below a nanometre would pretend."""
MOST_VALUES = 2e7
"""Numbers that a record may hold (160 MB): the finest step."""


@dataclass(frozen=True)
class Delivered:
    """A motion, what was asked of it and what was estimated for it."""

    response: Response
    asked: str | float
    asked_um: float
    estimate_um: np.ndarray  # (revolutions): largest error of the valve's position in each
    setting: float  # of the dial

    @property
    def reached(self) -> bool:
        return bool(self.estimate_um.max() <= self.asked_um)

    def sentence(self) -> str:
        """What was asked and what was delivered, in words."""
        asked = f"accuracy asked: {self.asked_um:g} um" + (f" ({self.asked})" if isinstance(self.asked, str) else "")
        if self.reached:
            return f"{asked}; estimated error of the valve's position: {self.estimate_um.max():.2g} um"
        ranges = ", ".join(f"+-{e:.2g} um in revolution {i}" for i, e in enumerate(self.estimate_um, 1))
        return f"{asked}; not reached: this motion is known to a range only, {ranges}"

    def attributes(self) -> dict:
        """As attributes of a dataset."""
        return {
            "accuracy_asked": self.asked,
            "accuracy_asked_um": self.asked_um,
            "accuracy_estimated_um": float(self.estimate_um.max()),
            "accuracy_estimated_by_revolution_um": self.estimate_um,
            "accuracy_reached": int(self.reached),  # netCDF knows no truth values
        }


Run = Callable[[float], Response]
"""The motion at a setting of the dial."""


def deliver(run: Run, method: str, accuracy: str | float, revolutions: int, least: float) -> Delivered:
    """The motion of `run` at an accuracy: a name or micrometres of the valve's position.

    `least` is the finest setting allowed. Raises InputError for an unknown accuracy, MotionRefused where no setting
    gives a motion.
    """
    asked_um = effort_of(accuracy).tolerance_um
    if not (np.isfinite(asked_um) and asked_um > 0):
        raise InputError(f"accuracy {accuracy}: a number of micrometres above 0 is needed")
    coarser, margin = ESTIMATES.get(method, STEPPING)
    setting = 2 ** (coarser - 1) * max(stored_curves()[method].coarsest(asked_um, typical=True), 4 * least)
    answers: list[np.ndarray] = []
    done, estimate, refusal = None, np.full(revolutions, np.inf), None
    while setting / 2 >= least * (1 - 1e-9):
        setting /= 2
        try:
            done = run(setting)
        except MotionRefused as error:
            refusal, answers = error, []
            continue
        answers.append(valve_position(done, revolutions))
        if len(answers) > coarser:
            apart = apart_um(answers[-1], answers[-coarser - 1 : -1], revolutions)
            estimate = np.maximum(FINEST_UM, margin * apart)
            if estimate.max() <= asked_um:
                break
    if done is None:
        raise refusal or MotionRefused(f"{method}: no step within the memory allowed resolves this motion")
    return Delivered(done, accuracy, asked_um, estimate, setting)


def valve_position(response: Response, revolutions: int) -> np.ndarray:
    """Valve position (revolutions * ANGLES + 1) [m]."""
    valve = response.train.valve
    grid = np.linspace(-np.pi, 2 * np.pi * revolutions - np.pi, revolutions * ANGLES + 1)
    curve = Hermite(response.angle, response.x[:, valve], response.v[:, valve] / response.cam_speed)
    return np.asarray(curve(grid))


def apart_um(answer: np.ndarray, coarser: list[np.ndarray], revolutions: int) -> np.ndarray:
    """Largest difference in each revolution [um]."""
    difference = np.max([np.abs(answer - other) for other in coarser], axis=0) / UM
    return difference[1:].reshape(revolutions, -1).max(axis=1)
