"""Numbers of a scene that a design may choose within ranges: spring rate, preload, lash, ramp.

They go to where the no-jump program under one margin at all design speeds finds the largest area, by L-BFGS-B (Byrd,
Lu, Nocedal and Zhu 1995, in SciPy) and the exact slopes of that area, from the program's duals. Where no cam keeps the
margin, the shortfall guides the search. The cam is then designed for the scene that has these values.
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
"""Speeds of the program over a band."""
EVALUATIONS = 30
SHORTFALL = 1e-3
"""Area ratio that stands for one newton that a margin is short of, where no cam keeps it."""
STEP = 1e-6
"""Part of its range by which a number moves for a slope."""
LEAST_GAIN = 1e-7
"""Share of the area whose gain by a step ends the search."""


@dataclass(frozen=True)
class FreeNumber(Tied):
    """A number that may be chosen from `low` to `high` in its key's unit; others move in proportion to it."""

    low: float
    high: float


def free_numbers(scene: Scene, asked: Mapping[str, Sequence[float]]) -> tuple[FreeNumber, ...]:
    """The numbers that are asked for by name, with their ranges (low, high).

    A name is that of a tolerance of the scene, whose numbers move together, NAME.KEY of a mass or an element, or one of
    `RAMP`. Raises InputError for another one, for an empty range, and for bounds of which all the lowest or all the
    highest values give an invalid scene.
    """
    found = tuple(free_number(scene, name, *map(float, ends)) for name, ends in asked.items())
    for which, values in (("lowest", [one.low for one in found]), ("highest", [one.high for one in found])):
        checked_scene(with_values(scene, found, values), f"{scene.name} with the {which} free numbers", ("design",))
    return found


def free_number(scene: Scene, name: str, low: float = -np.inf, high: float = np.inf) -> FreeNumber:
    """The number of a name, as of `free_numbers`, which raises the same errors."""
    if not low < high:
        raise InputError(f"free {name}={low:g}:{high:g}: expected LOW:HIGH with LOW below HIGH, such as 200:320")
    tolerance = next((one for one in scene.tolerance if one.label == name), None)
    if tolerance is not None:
        numbers = [number for group in moved_together(scene, tolerance) for number in group]
    else:
        numbers = settable(scene, name) if name in RAMP else matching(scene, name)
    if not numbers:
        raise no_such_number(scene, name, "free", [*(one.label for one in scene.tolerance), *RAMP])
    if missing := [number.named(scene) for number in numbers if number.of(scene) is None]:
        raise InputError(f"free {name!r}: the scene {scene.name} does not state {missing[0]}: add it to the scene")
    if len(numbers) > 1 and numbers[0].of(scene) == 0.0:
        raise InputError(
            f"free {name!r}: its first number is zero, in proportion to which no others can move: give it another value"
        )
    return FreeNumber(name, tuple(numbers), low, high)


def with_values(scene: Scene, free: Sequence[FreeNumber], values: Sequence[float] | np.ndarray) -> Scene:
    """The scene with the free numbers at these values."""
    for one, value in zip(free, values, strict=True):
        scene = one.put(scene, float(value))
    return scene


def with_best_values(
    scene: Scene, free: Sequence[FreeNumber], speeds: str, effort: Accuracy, progress: bool = False
) -> tuple[Scene, dict]:
    """The scene with the best values of its free numbers, and `free` of design.json: by name the value beside the given
    one and the range."""
    given, ranges = [one.of(scene) for one in free], [(one.low, one.high) for one in free]
    programs = Programs(lambda x: with_values(scene, free, x), speeds, effort, usual_margin(build_train(scene)))
    with tqdm(total=EVALUATIONS, desc="free numbers", disable=None if progress else True, leave=False) as bar:
        best = programs.largest(given, ranges, show=lambda _: bar.update())
    pairs = zip(free, best.values, given, strict=True)
    return with_values(scene, free, best.values), {
        one.name: {"of": one.named(scene), "value": value, "as_given": was, "low": one.low, "high": one.high}
        for one, value, was in pairs
    }


class LargestOverParameters(NamedTuple):
    """The values whose program has the largest area, its area ratio there and at the start, and how often it was
    solved."""

    values: tuple[float, ...]
    area_ratio: float
    at_start: float
    evaluations: int


class BudgetExhausted(Exception):
    """As many programs were solved as may be."""


@dataclass(frozen=True)
class Programs:
    """The no-jump programs, under one margin, of the scenes that `scene_of` makes of values."""

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
        """The values within these ranges whose program has the largest area; that of the start is taken as it is,
        within the ranges or not."""
        low, high = np.array(ranges, dtype=float).T
        at_start, begin, met = self.value(np.asarray(start, dtype=float)), np.clip(start, low, high), []

        def fall(share: np.ndarray) -> tuple[float, np.ndarray]:
            if len(met) == evaluations - 1:
                raise BudgetExhausted
            values = low + np.clip(share, 0.0, 1.0) * (high - low)
            area, slopes = self.value_and_slopes(values, STEP * np.where(share > 0.5, low - high, high - low))
            met.append((area, values))
            show(area)
            return -area, -slopes * (high - low)

        with suppress(BudgetExhausted):
            minimize(
                fall, (begin - low) / np.where(high > low, high - low, 1.0), jac=True, method="L-BFGS-B",
                bounds=[(0.0, float(h > l)) for l, h in zip(low, high, strict=True)], options={"ftol": LEAST_GAIN},
            )  # fmt: skip
        area, values = max(met, key=lambda pair: pair[0])
        return LargestOverParameters(tuple(values.tolist()), area, at_start, len(met) + 1)

    def value(self, values: np.ndarray) -> float:
        """The largest area ratio, or what stands for the shortfall where no cam keeps the margin."""
        return self._solved(self._program(values))[0]

    def value_and_slopes(self, values: np.ndarray, steps: np.ndarray) -> tuple[float, np.ndarray]:
        """The same with its slope by every value: of the area by the program's duals, exact but for the size of the
        steps, of a shortfall by its differences; zero where a number does not move or no program on either side is
        alike."""
        value, found = self._solved(self._program(values))
        along, slopes = np.diag(steps), np.zeros(len(values))
        for k in np.flatnonzero(steps):
            for step in (along[k], -along[k]):
                other = self._program(values + step)
                beside = self._solved(other)[0] if found is None else found.value_in(other)
                if beside is not None:
                    slopes[k] = (beside - value) / step[k]
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
            found = program.solve(self.margin_N)
            return found.area_ratio, found
        except NoCamHoldsContact as short:
            return -SHORTFALL * min(short.shortfall_N, 1e6), None
