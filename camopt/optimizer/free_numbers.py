"""Numbers of a scene that a design may choose within ranges: spring rate, preload, lash, ramp.

They are chosen so that the no-jump program, with one margin at all design speeds, has the largest area, by L-BFGS-B
(Byrd, Lu, Nocedal and Zhu 1995, in SciPy) with the exact slopes of that area from the program's duals. Where no cam
keeps the margin, the shortfall is minimised instead. The cam is then designed for the scene with these values.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize
from tqdm import tqdm

from camopt.optimizer.accuracy import Accuracy
from camopt.optimizer.program.no_jump import NoCamHoldsContact, NoJumpOptimum, NoJumpProgram, no_jump_program
from camopt.optimizer.program.phases import usual_margin
from camopt.optimizer.program.program_cam import program_cam
from camopt.scene.as_built import moved_together
from camopt.scene.errors import InputError
from camopt.scene.load import checked_scene
from camopt.scene.parameters import Tied, matching, no_such_number, settable
from camopt.scene.schema import Scene
from camopt.scene.train import build_train

RAMP = ("design.ramp_height_mm", "design.ramp_velocity_mm_per_deg")
BAND_SPEEDS = 9
"""Number of speeds of the program over a band."""
EVALUATIONS = 30
SHORTFALL = 1e-3
"""Loss of area ratio that stands for one newton of shortfall, where no cam keeps the margin."""
STEP = 1e-6
"""Step of a number for a slope, relative to its range."""
LEAST_GAIN = 1e-7
"""The search ends when a step gains a smaller share of the area."""


@dataclass(frozen=True)
class FreeNumber(Tied):
    """A number that may be chosen from `low` to `high`, in its key's unit; the others move in proportion to it."""

    low: float
    high: float


def free_numbers(scene: Scene, ranges: Mapping[str, Sequence[float]]) -> tuple[FreeNumber, ...]:
    """The free numbers with their names and ranges (low, high).

    A name is that of a tolerance of the scene, whose numbers move together, NAME.KEY of a mass or an element, or one of
    `RAMP`. Raises InputError for any other name, for an empty range, and if the scene with all the lowest or all the
    highest values is invalid.
    """
    free = tuple(free_number(scene, name, *map(float, ends)) for name, ends in ranges.items())
    for which, values in (("lowest", [number.low for number in free]), ("highest", [number.high for number in free])):
        checked_scene(with_values(scene, free, values), f"{scene.name} with the {which} free numbers", ("design",))
    return free


def free_number(scene: Scene, name: str, low: float = -np.inf, high: float = np.inf) -> FreeNumber:
    """The free number of a name; names and errors are those of `free_numbers`."""
    if not low < high:
        raise InputError(f"free {name}={low:g}:{high:g}: expected LOW:HIGH with LOW below HIGH, such as 200:320")
    tolerance = next((t for t in scene.tolerance if t.label == name), None)
    if tolerance is not None:
        numbers = [number for group in moved_together(scene, tolerance) for number in group]
    else:
        numbers = settable(scene, name) if name in RAMP else matching(scene, name)
    if not numbers:
        raise no_such_number(scene, name, "free", [*(t.label for t in scene.tolerance), *RAMP])
    if missing := [number.named(scene) for number in numbers if number.of(scene) is None]:
        raise InputError(f"free {name!r}: the scene {scene.name} does not state {missing[0]}: add it to the scene")
    if len(numbers) > 1 and numbers[0].of(scene) == 0.0:
        raise InputError(
            f"free {name!r}: its first number is zero, in proportion to which no others can move: give it another value"
        )
    return FreeNumber(name, tuple(numbers), low, high)


def with_values(scene: Scene, free: Sequence[FreeNumber], values: Sequence[float] | np.ndarray) -> Scene:
    """The scene with the free numbers at these values."""
    for number, value in zip(free, values, strict=True):
        scene = number.put(scene, float(value))
    return scene


def with_best_values(
    scene: Scene, free: Sequence[FreeNumber], speeds: str, effort: Accuracy, progress: bool = False
) -> tuple[Scene, dict]:
    """The scene with its free numbers at their best; `free` of design.json: value, original value, range of each."""
    original, ranges = [number.of(scene) for number in free], [(number.low, number.high) for number in free]
    programs = Programs(lambda x: with_values(scene, free, x), speeds, effort, usual_margin(build_train(scene)))
    with tqdm(total=EVALUATIONS, desc="free numbers", disable=None if progress else True, leave=False) as bar:
        best = programs.largest(original, ranges, show=lambda _: bar.update())
    rows = zip(free, best.values, original, strict=True)
    return with_values(scene, free, best.values), {
        n.name: {"of": n.named(scene), "value": value, "as_given": before, "low": n.low, "high": n.high}
        for n, value, before in rows
    }


class LargestOverParameters(NamedTuple):
    """The values whose program has the largest area, the area ratio there and at the start, and the evaluations."""

    values: tuple[float, ...]
    area_ratio: float
    at_start: float
    evaluations: int


class BudgetExhausted(Exception):
    """The permitted number of programs has been solved."""


@dataclass(frozen=True)
class Programs:
    """The no-jump programs, with one margin, of the scenes that `scene_of` makes from values."""

    scene_of: Callable[[np.ndarray], Scene]
    speeds: str
    effort: Accuracy
    margin_N: float

    def largest(
        self,
        start: Sequence[float],
        ranges: Sequence[tuple[float, float]],
        evaluations: int = EVALUATIONS,
        show: Callable[[float], object] = lambda area: None,
    ) -> LargestOverParameters:
        """The values within these ranges whose program has the largest area; the start itself may lie outside."""
        low, high = np.array(ranges, dtype=float).T
        at_start, begin, solved = self.value(np.asarray(start, dtype=float)), np.clip(start, low, high), []

        def loss_and_slopes(share: np.ndarray) -> tuple[float, np.ndarray]:
            if len(solved) == evaluations - 1:
                raise BudgetExhausted
            values = low + np.clip(share, 0.0, 1.0) * (high - low)
            area, slopes = self.value_and_slopes(values, STEP * np.where(share > 0.5, low - high, high - low))
            solved.append((area, values))
            show(area)
            return -area, -slopes * (high - low)

        with suppress(BudgetExhausted):
            minimize(
                loss_and_slopes, (begin - low) / np.where(high > low, high - low, 1.0), jac=True, method="L-BFGS-B",
                bounds=[(0.0, float(h > l)) for l, h in zip(low, high, strict=True)], options={"ftol": LEAST_GAIN},
            )  # fmt: skip
        area, values = max(solved, key=lambda pair: pair[0])
        return LargestOverParameters(tuple(values.tolist()), area, at_start, len(solved) + 1)

    def value(self, values: np.ndarray) -> float:
        """The largest area ratio or, where no cam keeps the margin, minus the scaled shortfall."""
        return self._solved(self._program(values))[0]

    def value_and_slopes(self, values: np.ndarray, steps: np.ndarray) -> tuple[float, np.ndarray]:
        """The same with its slope by every value. The slope of an area follows from the program's duals, exact but for
        the size of the steps; that of a shortfall is a difference quotient. It is zero where a step is zero or no
        program on either side has the same structure."""
        value, optimum = self._solved(self._program(values))
        along, slopes = np.diag(steps), np.zeros(len(values))
        for k in np.flatnonzero(steps):
            for step in (along[k], -along[k]):
                program = self._program(values + step)
                stepped = self._solved(program)[0] if optimum is None else optimum.value_in(program)
                if stepped is not None:
                    slopes[k] = (stepped - value) / step[k]
                    break
        return value, slopes

    def _program(self, values: np.ndarray) -> NoJumpProgram:
        scene = self.scene_of(values)
        design, operation = scene.required_design, scene.required_operation
        cam, band = program_cam(design, self.effort.knot_deg), np.linspace(*operation.band_rpm, BAND_SPEEDS)
        speeds = operation.speeds_rpm if self.speeds == "nominal" else band
        return no_jump_program(build_train(scene), design, cam, [scene.cam_speed(s) for s in speeds])

    def _solved(self, program: NoJumpProgram) -> tuple[float, NoJumpOptimum | None]:
        try:
            optimum = program.solve(self.margin_N)
            return optimum.area_ratio, optimum
        except NoCamHoldsContact as error:
            return -SHORTFALL * min(error.shortfall_N, 1e6), None
