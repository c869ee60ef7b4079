"""A motion at a requested accuracy: the dial of a method is refined until the answer converges; the error is estimated.

The dial of a method is its step times the train's highest rate [rad], or the layer width [m] of the smooth path. It
starts at the value that, by the stored curves, is accurate enough for half of all motions. It is halved until the
valve's position at every angle differs from the coarser answers by no more than a fraction of the requested error,
because methods that step across contacts have no order of convergence. Where the dial reaches its limit first, or the
motion amplifies even round-off beyond the requested error, the answer is a range.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from tqdm import tqdm

from camopt.measure.hermite import Hermite
from camopt.scene import MotionRefused, Response
from camopt.scene.units import UM
from camopt.verifier.accuracy import effort_of, stored_curves

ANGLES = 1440
"""Number of angles per revolution at which answers are compared."""
CHORDS_DIAL = "event with chords"
"""The name in ESTIMATES of event-exact on a train with curved laws, which it replaces by chords."""
ESTIMATES = {"event": (2, 4.0), "dop853": (2, 4.0), "smooth": (2, 1.0), CHORDS_DIAL: (2, 3.0)}
STEPPING = (3, 1.5)
"""By method, the number of coarser answers and the factor on the largest difference from them that estimates the error;
STEPPING is for methods that step across contacts. Methods that locate every switching differ by round-off alone, which
is occasionally small by chance. The errors of the smooth path and of chords decrease with the dial; in hammering
contacts that of chords was up to twice the difference (`kodama-hertz`). For a method that steps across contacts (see
`camopt.verifier.convergence.MARGIN`) two coarser answers underestimate once in ten times, three with 1.5 once in
240."""
FINEST_UM = 1e-3
"""Least stated error [um]: positions are read from cubics, and digits below a nanometre would not be meaningful."""
MOST_VALUES = 2e7
"""Largest number of values of a record (160 MB), which limits the finest step."""


@dataclass(frozen=True)
class Delivered:
    """A motion with its requested accuracy and its estimated error."""

    response: Response
    requested: str | float
    requested_um: float
    estimate_um: np.ndarray  # (revolutions), largest error of the valve's position
    setting: float  # of the dial
    budget: int  # largest number of settings of the dial

    @property
    def reached(self) -> bool:
        return bool(self.estimate_um.max() <= self.requested_um)

    def sentence(self) -> str:
        """A sentence on the requested and the estimated error."""
        name = f" ({self.requested})" if isinstance(self.requested, str) else ""
        requested = f"requested accuracy: {self.requested_um:g} um{name}"
        if self.reached:
            return f"{requested}; {error_text(self.estimate_um)[0]}"
        missed = f"{requested}; not reached within the budget of {self.budget} settings"
        if not np.isfinite(self.estimate_um).all():
            return f"{missed}, too few of which gave a motion: the error is not known"
        ranges = ", ".join(f"+-{e:.2g} um in revolution {i}" for i, e in enumerate(self.estimate_um, 1))
        return f"{missed}: the valve's position is known to a range only, at best {ranges}"

    def attributes(self) -> dict:
        """The accuracy as attributes of a dataset."""
        return {
            "accuracy_statement": self.sentence(),
            "accuracy_asked": self.requested,
            "accuracy_asked_um": self.requested_um,
            **error_text(self.estimate_um)[1],
            "accuracy_reached": int(self.reached),  # netCDF has no booleans
        }


def error_text(estimate_um: np.ndarray) -> tuple[str, dict]:
    """Estimated errors (revolutions) [um] as a sentence, and as attributes of a dataset."""
    largest = float(estimate_um.max())
    attributes = {"accuracy_estimated_um": largest, "accuracy_estimated_by_revolution_um": estimate_um}
    return f"estimated error of the valve's position: {largest:.2g} um", attributes


Run = Callable[[float], Response]
"""The motion at a setting of the dial."""


def deliver(
    run: Run, method: str, accuracy: str | float, revolutions: int, least: float, *, progress: bool = False
) -> Delivered:
    """The motion of `run` at an accuracy: a name, or micrometres of the valve's position.

    `method` is a name in ESTIMATES or a method that steps; `least` is the finest setting allowed. If no motion is
    within the requested error, the motion with the least estimated error is returned. With `progress` a bar shows the
    used share of the budget, in which every setting counts twice as much as the previous one. Raises InputError for an
    unknown accuracy, MotionRefused where no setting gives a motion.
    """
    effort = effort_of(accuracy)
    target_um = effort.tolerances.tolerance_um if isinstance(accuracy, str) else float(accuracy)
    coarser = ESTIMATES.get(method, STEPPING)[0]
    curve = stored_curves()["event" if method == CHORDS_DIAL else method]
    first = 2 ** (coarser - 2) * max(curve.coarsest(target_um, typical=True), 4 * least)
    budget = 1 + int(np.log2(first / least) + 1e-9)
    answers: list[np.ndarray] = []
    best, refusal = None, None
    with tqdm(total=2**budget - 1, disable=None if progress else True, desc=f"{target_um:g} um", unit="") as bar:
        for attempt in range(budget):
            setting = first / 2**attempt
            try:
                motion = run(setting)
            except MotionRefused as error:
                refusal, answers = error, []
                bar.update(2**attempt)
                continue
            answers.append(valve_position(motion, revolutions))
            answer = Delivered(motion, accuracy, target_um, estimate_um(answers, method, revolutions), setting, budget)
            best = answer if best is None or answer.estimate_um.max() <= best.estimate_um.max() else best
            bar.update(2**attempt)
            bar.set_postfix_str(f"setting {attempt + 1} of {budget}, error {best.estimate_um.max():.2g} um")
            if best.reached or best.estimate_um.max() <= FINEST_UM:
                break
    if best is None:
        raise refusal or MotionRefused(
            f"{method}: no step within the memory allowed resolves this motion: ask a larger error or another method"
        )
    return best


def estimate_um(answers: list[np.ndarray], method: str, revolutions: int) -> np.ndarray:
    """Estimated error (revolutions) [um] of the last answer from the coarser ones; infinite where these are too few."""
    coarser, margin = ESTIMATES.get(method, STEPPING)
    if len(answers) <= coarser:
        return np.full(revolutions, np.inf)
    return np.maximum(FINEST_UM, margin * apart_um(answers[-1], answers[-coarser - 1 : -1], revolutions))


def valve_position(response: Response, revolutions: int, angles: int = ANGLES) -> np.ndarray:
    """Valve position (revolutions * angles + 1) [m] at equal angles."""
    valve = response.train.valve
    grid = np.linspace(-np.pi, 2 * np.pi * revolutions - np.pi, revolutions * angles + 1)
    curve = Hermite(response.angle, response.x[:, valve], response.v[:, valve] / response.cam_speed)
    return np.asarray(curve(grid))


def apart_um(answer: np.ndarray, coarser: list[np.ndarray], revolutions: int) -> np.ndarray:
    """Largest difference from the coarser answers in each revolution [um]."""
    difference = np.abs(answer - np.array(coarser)).max(axis=0) / UM
    return difference[1:].reshape(revolutions, -1).max(axis=1)
