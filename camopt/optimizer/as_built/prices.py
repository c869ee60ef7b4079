"""The cost of each tolerance of a scene in lift area, and the sensitivity of the area to the scene's numbers.

The program of largest area (`openings_program`) is solved for the trains of the scene, for the same trains with one
tolerance left out or halved, and for trains with raised nominal numbers. The draws and the limits on predicted openings
are the same in all of these. The limits are chosen so that the program's cam has the area of the cam at hand, where
that is possible. Two sets of trains show how much the result depends on the draws.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from threadpoolctl import threadpool_limits

from camopt.measure.as_built import trains_as_built
from camopt.optimizer.as_built.checks import check_scatter
from camopt.optimizer.as_built.exact_forces import exact_forces
from camopt.optimizer.as_built.openings_program import OpeningsProgram
from camopt.optimizer.as_built.search import DRAWS_SEED, band_speeds, free_program, opening_limits
from camopt.optimizer.as_built.steps import FIRST_LEVEL
from camopt.scene.as_built import moved_together, scatter_labels, with_scatter
from camopt.scene.errors import InputError
from camopt.scene.parameters import with_numbers
from camopt.scene.rest import is_linear
from camopt.scene.schema import Scene
from camopt.scene.train import build_train

SETS, TRAINS = 2, 150
"""Number of sets of trains, and number of trains in each set."""
LOW_SPEEDS, HIGH_SPEEDS = 1, 2
"""Number of speeds of a train below and above `NEAR_TOP` of the band's top: half as many as in the search."""
CHANGE = 0.02
"""Relative amount by which a number of the scene is raised to find the sensitivity of the area."""
LEVELS = 0.05, 4.0
"""Lowest and highest level of the limits that is tried to give the program's cam the area of the cam at hand."""


@dataclass(frozen=True)
class PriceList:
    """Changes of the largest area ratio with which a share `wanted` of the trains as built pass, by tolerance.

    `left_out` and `halved` are the changes where the tolerance is left out or halved, `worth` is the change per cent by
    which the numbers that it scatters are raised. `noise` and `worth_noise` are the standard errors of one such change,
    pooled over the list.
    """

    wanted: float
    area_ratio: float
    left_out: Mapping[str, float]
    halved: Mapping[str, float]
    noise: float
    worth: Mapping[str, float]
    worth_noise: float

    def as_dict(self) -> dict:
        """The content of yield.json's "prices"."""
        return {key: dict(value) if isinstance(value, Mapping) else value for key, value in vars(self).items()}

    def __str__(self) -> str:
        width = max(map(len, ("tolerance", *self.left_out)))
        lines = [f"{'tolerance':<{width}}  left out    halved  1 % more of its numbers"]
        for label in sorted(self.left_out, key=lambda name: -self.left_out[name]):
            worth = f"{self.worth[label]:+.4f}" if label in self.worth else "–"
            lines.append(f"{label:<{width}}  {self.left_out[label]:+8.4f}  {self.halved[label]:+8.4f}  {worth:>23}")
        lines.append(
            f"changes of the area ratio {self.area_ratio:.4f} that {100 * self.wanted:g} % of trains as built hold; "
            f"standard error {self.noise:.4f}, of a number's worth {self.worth_noise:.4f}"
        )
        return "\n".join(lines)

    def plot(self):
        """The cost of each tolerance and the sensitivities to the scene's numbers, as a matplotlib Figure."""
        from camopt.plots.yields import price_bars

        return price_bars(self.left_out, self.halved, self.noise, self.worth, self.worth_noise)


@threadpool_limits.wrap(limits=1, user_api="blas")  # the matrices are small
def price_list(
    scene: Scene,
    wanted: float,
    *,
    area_ratio: float | None = None,
    trains: int = TRAINS,
    sets: int = SETS,
    seed: int = 0,
    advance: Callable[[float], object] = lambda share: None,
) -> PriceList:
    """The price list of a scene for a share `wanted` of trains as built, from a number of `sets` of `trains` each.

    With a single set the standard errors are unknown and given as zero. The limits on predicted openings are chosen for
    the `area_ratio` of a cam, if one is given. `advance` receives the share of the work that is done. Raises InputError
    for a scene without scatter, and for one that is not linear.
    """
    check_scatter(scene)
    if not is_linear(build_train(scene)):
        raise InputError(
            f"yield: {scene.name} has curved laws, and prices need the closed response of straight ones: leave --price "
            f"out; `camopt yield --halve` says what half of each tolerance buys"
        )
    program, scenes = _LargestArea(scene, wanted, trains), _variants(scene)
    areas, done = {name: np.empty(sets) for name in scenes}, 0
    for k in range(sets):
        level = None
        for name, variant in scenes.items():
            program.draw(variant, seed, first=k * trains)
            level = level or _level(program, area_ratio)
            areas[name][k] = program(level)
            done += 1
            advance(done / sets / len(scenes))
    return _summary(wanted, areas)


@threadpool_limits.wrap(limits=1, user_api="blas")
def estimated_area_ratio(scene: Scene, wanted: float, seed: int = 0) -> float | None:
    """An estimate of the largest area ratio with which a share `wanted` of the trains as built pass.

    It comes from the first program of the search, without simulation of any motion, and may be too large. It is None
    for a train that is not linear, whose forces take too long to compute for an estimate.
    """
    if not is_linear(build_train(scene)):
        return None
    program = _LargestArea(scene, wanted, TRAINS)
    program.draw(scene, seed)
    return program(FIRST_LEVEL)


class _LargestArea:
    """The largest area ratio of a scene by the level of the limits on predicted openings, for `trains` drawn trains, of
    which as many are dropped as the share `wanted` allows."""

    def __init__(self, scene: Scene, wanted: float, trains: int):
        self._plain, self._z = free_program(scene)
        self._cam_speeds = band_speeds(scene, LOW_SPEEDS, HIGH_SPEEDS)
        self._limits, self._trains = opening_limits(scene, self._cam_speeds), trains
        self._lost = int((1.0 - wanted) * trains + 1e-9)

    def draw(self, scene: Scene, seed: int, first: int = 0) -> None:
        """Draws the trains as built of a scene from number `first` on and builds their program."""
        drawn = trains_as_built(scene, self._trains, seed=seed + DRAWS_SEED, first=first)
        theta, forces = exact_forces(drawn, self._plain.train, self._plain.cam, self._cam_speeds)
        self._program = OpeningsProgram(self._plain, theta, self._cam_speeds, forces)

    def __call__(self, level: float) -> float:
        return self._program.largest(self._z, level * self._limits, self._lost).area_ratio


def _level(area_at: Callable[[float], float], area_ratio: float | None) -> float:
    """The level at which the program's cam has this area ratio; FIRST_LEVEL if there is none between the LEVELS."""
    low, high = LEVELS
    if area_ratio is None or not area_at(low) < area_ratio < area_at(high):
        return FIRST_LEVEL
    return float(brentq(lambda level: area_at(level) - area_ratio, low, high, xtol=0.01))  # pyright: ignore[reportArgumentType]


def _variants(scene: Scene) -> dict[tuple[str, str], Scene]:
    """Scenes by change and tolerance: as it is, without each tolerance, with each one halved, with raised numbers."""
    labels = scatter_labels(scene)
    variants = {("as given", ""): scene}
    variants |= {("left out", label): with_scatter(scene, {label: 0.0}) for label in labels}
    variants |= {("halved", label): with_scatter(scene, {label: 0.5}) for label in labels}
    for tolerance in scene.tolerance:
        numbers = [n for together in moved_together(scene, tolerance) for n in together]
        raised = {number: (1.0 + CHANGE) * number.of(scene) for number in numbers}
        variants["raised", tolerance.label] = with_numbers(scene, raised)
    return variants


def _summary(wanted: float, areas: Mapping[tuple[str, str], np.ndarray]) -> PriceList:
    """The price list from the area ratios (sets) of all variants."""
    changes = {name: area - areas["as given", ""] for name, area in areas.items() if name[0] != "as given"}

    def of(kind: str, unit: float = 1.0) -> dict[str, float]:
        return {name[1]: float(change.mean()) / unit for name, change in changes.items() if name[0] == kind}

    def noise(*kinds: str) -> float:
        apart = [np.ptp(change) for (kind, _), change in changes.items() if kind in kinds]
        return float(np.sqrt(np.mean(np.square(apart)))) / 2 if apart else 0.0

    percent = 100 * CHANGE
    return PriceList(
        wanted, float(areas["as given", ""].mean()), of("left out"), of("halved"), noise("left out", "halved"),
        of("raised", percent), noise("raised") / percent,
    )  # fmt: skip
