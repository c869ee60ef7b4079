"""A band of speeds by one cheap method: the worst speed of each metric, and where bounce and jump start."""

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from camopt.cam.lift import Lift
from camopt.scene.errors import MotionRefused
from camopt.scene.quantities import QUANTITIES
from camopt.scene.response import Revolve
from camopt.scene.rest import rest_position
from camopt.scene.schema import Scene
from camopt.scene.train import Train, build_train
from camopt.verify.settle import LESS_IS_WORSE, settle

STARTS_MM = 0.05
"""Bounce or jump that counts as started where the scene sets no limit."""
SEARCH_STEP_RPM = 40.0
START_RPM = 10.0
"""To what the starting speeds are located."""

AtSpeed = Callable[[Train, Lift, float], Revolve]
"""The sweeping method: train, lift, cam speed [rad/s]."""


@dataclass(frozen=True)
class Band:
    """A swept band: speeds (m) r/min ascending, metrics by name (m), and the method of each speed's figures (m).

    A bounce of NaN means that the valve never seats, or that the motion is refused.
    """

    from_rpm: float
    to_rpm: float
    step_rpm: float
    speeds_rpm: np.ndarray
    figures: dict[str, np.ndarray]
    methods: tuple[str, ...]

    def worst_index(self, name: str) -> int:
        """Index of the worst speed for a metric; NaN is worse than any value."""
        sign = -1.0 if name in LESS_IS_WORSE else 1.0
        return int(np.argmax(np.nan_to_num(sign * self.figures[name], nan=np.inf)))

    def worst(self, name: str) -> tuple[float, float]:
        """(speed [r/min], value) of the worst speed for a metric."""
        i = self.worst_index(name)
        return float(self.speeds_rpm[i]), float(self.figures[name][i])

    def with_judged(self, method: str, judged: dict[float, dict[str, float]]) -> "Band":
        """The band with the figures of `judged` (speed [r/min] -> metric -> value), which are `method`'s, put in place
        of the sweep's or between them; speeds outside the band are left out."""
        found = {float(s): (m, {}) for s, m in zip(self.speeds_rpm, self.methods, strict=True)}
        for i, (_, row) in enumerate(found.values()):
            row.update({name: float(values[i]) for name, values in self.figures.items()})
        found |= {s: (method, row) for s, row in judged.items() if self.from_rpm <= s <= self.to_rpm}
        speeds = sorted(found)
        figures = {name: np.array([found[s][1][name] for s in speeds]) for name in self.figures}
        return replace(self, speeds_rpm=np.array(speeds), figures=figures, methods=tuple(found[s][0] for s in speeds))


def at_speeds(
    prepare: AtSpeed, scene: Scene, lift: Lift, speeds_rpm: Iterable[float], workers: int = 2
) -> list[dict[str, float]]:
    """Worst figures of the settled motion at each speed [r/min]: metric name -> value.

    The speeds are dealt to threads; each has its own copy of the train, because methods keep tables by train.
    """
    speeds = list(speeds_rpm)
    train = build_train(scene)
    start = np.concatenate([rest_position(train), np.zeros(len(train.mass))])

    def deal(worker: int) -> list[dict[str, float]]:
        own = replace(train)
        return [_figures(prepare, own, lift, scene.cam_speed(s), start) for s in speeds[worker::workers]]

    with ThreadPoolExecutor(workers) as pool:
        hands = list(pool.map(deal, range(workers)))
    return [hands[i % workers][i // workers] for i in range(len(speeds))]


def _figures(prepare: AtSpeed, train: Train, lift: Lift, cam_speed: float, start: np.ndarray) -> dict[str, float]:
    try:
        figures = settle(prepare(train, lift, cam_speed), start).metrics(lift)
    except MotionRefused:
        return dict.fromkeys(QUANTITIES, np.nan)  # ranks as the worst, so that the verdict looks at it
    return {name: figures.worst(name) for name in QUANTITIES}


def sweep(
    prepare: AtSpeed,
    scene: Scene,
    lift: Lift,
    step_rpm: float,
    refine: tuple[str, ...] = ("bounce_mm",),
    workers: int = 2,
    method: str = "event",
) -> Band:
    """The scene's band in steps of `step_rpm`, then around the worst speed of each metric in `refine` to 1 r/min.

    The refinement quarters the step about the worst speed found so far. Where the motion bounces, bounce against speed
    is rough: what is refined is the largest found, not proved to be the largest. `method` is the name of `prepare`.
    """
    assert scene.operation is not None, "load_scene(..., need='operation') guarantees it"
    low, high = scene.operation.band_rpm
    found = dict(_with_speeds(prepare, scene, lift, [*np.arange(low, high, step_rpm), high], workers))
    step = step_rpm
    while step > 1.0:
        step = max(1.0, round(step / 4))
        wanted: set[float] = set()
        band = _band(low, high, step_rpm, found, method)
        for name in refine:
            near = round(band.worst(name)[0]) + step * np.arange(-3, 4)
            wanted |= {float(s) for s in np.clip(near, low, high)}
        new = sorted(wanted - found.keys())
        found.update(_with_speeds(prepare, scene, lift, new, workers))
    return _band(low, high, step_rpm, found, method)


def first_exceeding(
    prepare: AtSpeed, scene: Scene, lift: Lift, limits: dict[str, float], workers: int = 2
) -> dict[str, float | None]:
    """Lowest speed [r/min], to 10 r/min, at which each metric exceeds its limit; None if not below 1.5 x band's top.

    Looked for upward from half the band's bottom in steps of 40 r/min, then bisected; a valve that does not seat
    counts as exceeding. A metric that exceeds already at the lowest speed gets that speed.
    """
    assert scene.operation is not None, "load_scene(..., need='operation') guarantees it"
    low, high = scene.operation.band_rpm
    grid = np.append(np.arange(0.5 * low, 1.5 * high, SEARCH_STEP_RPM), 1.5 * high)
    first: dict[str, float | None] = dict.fromkeys(limits)
    chunk = 8 * workers
    for begin in range(0, len(grid), chunk):
        missing = [name for name in limits if first[name] is None]
        if not missing:
            break
        rows = at_speeds(prepare, scene, lift, grid[begin : begin + chunk], workers)
        for name in missing:
            over = [i for i, row in enumerate(rows) if not row[name] <= limits[name]]
            if over:
                i = begin + over[0]
                exceeds = partial(_exceeds, prepare, scene, lift, name, limits[name])
                first[name] = _bisect(exceeds, grid[i - 1], grid[i]) if i else float(grid[0])
    return first


def _exceeds(prepare: AtSpeed, scene: Scene, lift: Lift, name: str, limit: float, speed_rpm: float) -> bool:
    return not at_speeds(prepare, scene, lift, [speed_rpm], 1)[0][name] <= limit


def _bisect(exceeds: Callable[[float], bool], below: float, above: float) -> float:
    while above - below > START_RPM:
        middle = 0.5 * (below + above)
        below, above = (below, middle) if exceeds(middle) else (middle, above)
    return float(above)


def _with_speeds(prepare, scene, lift, speeds, workers):
    return zip((float(s) for s in speeds), at_speeds(prepare, scene, lift, speeds, workers), strict=True)


def _band(low: float, high: float, step_rpm: float, found: dict[float, dict[str, float]], method: str) -> Band:
    speeds = sorted(found)
    figures = {name: np.array([found[s][name] for s in speeds]) for name in QUANTITIES}
    return Band(low, high, step_rpm, np.array(speeds), figures, (method,) * len(speeds))
