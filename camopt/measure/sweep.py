"""A band of speeds by one cheap method: the worst speed of each metric, and where bounce and jump start."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from camopt.cam.lift import Lift
from camopt.measure.resonance import Resonance
from camopt.scene.quantities import LESS_IS_WORSE, QUANTITIES
from camopt.scene.schema import Scene
from camopt.scene.settled import SettledMetrics
from camopt.scene.shapes import Float
from camopt.scene.train import build_train

STARTS_MM = 0.05
"""Bounce or jump that counts as started where the scene sets no limit."""
SEARCH_STEP_RPM = 40.0
START_RPM = 10.0
"""Accuracy with which the starting speeds are located."""
CHUNK = 4
"""Speeds looked at together while the starting speeds are searched. Beyond the first of them a motion costs most."""
FINEST_RPM = 1.0
"""Accuracy with which the speeds of maxima are located."""
PEAKS = 3
"""Local maxima of each limited metric that are refined, the worst first."""
COARSELY = 10.0, 1
"""FINEST_RPM and PEAKS of a coarse refinement."""

SettledMany = Callable[..., SettledMetrics]
"""A method that measures settled motions of trains and lifts at cam speeds [rad/s] together:
`camopt.exact.settled.settled_metrics`."""


@dataclass(frozen=True, repr=False)
class Band:
    """A swept band: ascending speeds, every metric at each of them by its name, and the method of each speed's figures.

    A bounce of NaN means that the valve never seats, or that the motion is refused.
    """

    from_rpm: float
    to_rpm: float
    step_rpm: float
    speeds_rpm: Float[np.ndarray, " m"]
    figures: dict[str, Float[np.ndarray, " m"]]
    methods: tuple[str, ...]
    resonances: tuple[Resonance, ...] = ()  # narrower than the step, looked at
    resonances_left_out: int = 0
    refined: bool = True  # around the worst speeds

    def __repr__(self) -> str:
        return f"Band({self.from_rpm:g} to {self.to_rpm:g} r/min, {len(self.speeds_rpm)} speeds)"

    def worst_index(self, name: str) -> int:
        """Index of the worst speed for a metric; NaN is worse than any value."""
        sign = -1.0 if name in LESS_IS_WORSE else 1.0
        return int(np.argmax(np.nan_to_num(sign * self.figures[name], nan=np.inf)))

    def worst(self, name: str) -> tuple[float, float]:
        """(speed [r/min], value) of the worst speed for a metric."""
        i = self.worst_index(name)
        return float(self.speeds_rpm[i]), float(self.figures[name][i])

    def peaks(self, name: str) -> list[float]:
        """Speeds [r/min] of the local maxima of a metric (minima where less is worse), the worst first.

        A plateau counts as one maximum, at its first speed.
        """
        sign = -1.0 if name in LESS_IS_WORSE else 1.0
        badness = np.nan_to_num(sign * self.figures[name], nan=np.inf)
        before, after = np.append(-np.inf, badness[:-1]), np.append(badness[1:], -np.inf)
        at = np.flatnonzero((badness > before) & (badness >= after))
        return self.speeds_rpm[at[np.argsort(-badness[at], kind="stable")]].tolist()

    def with_judged(self, method: str, judged: dict[float, dict[str, float]]) -> "Band":
        """The band with the metrics of `method` at some speeds, `judged` (speed [r/min] -> metric -> value).

        At speeds of the sweep they replace its metrics; other speeds inside the band are added,
        and those outside are left out.
        """
        rows = {float(s): (m, {}) for s, m in zip(self.speeds_rpm, self.methods, strict=True)}
        for i, (_, row) in enumerate(rows.values()):
            row.update({name: float(values[i]) for name, values in self.figures.items()})
        rows |= {s: (method, row) for s, row in judged.items() if self.from_rpm <= s <= self.to_rpm}
        speeds = sorted(rows)
        figures = {name: np.array([rows[s][1][name] for s in speeds]) for name in self.figures}
        return replace(self, speeds_rpm=np.array(speeds), figures=figures, methods=tuple(rows[s][0] for s in speeds))


def at_speeds(
    many: SettledMany, scene: Scene, lift: Lift, speeds_rpm: Sequence[float] | np.ndarray
) -> list[dict[str, float]]:
    """Worst figures of the settled motion at each speed [r/min]: metric name -> value, NaN where it is refused."""
    settled = many([build_train(scene)], [lift], [scene.cam_speed(s) for s in speeds_rpm])
    worst = {name: settled.worst(name)[0, 0] for name in QUANTITIES}
    return [{name: float(values[i]) for name, values in worst.items()} for i in range(len(speeds_rpm))]


class SpeedCache:
    """The metrics of one cam at the speeds computed so far by `many`, of event-exact; no speed is computed twice.

    The same speeds serve the band, its refinement and the search for the starts of jump and bounce: a peak that one of
    them finds is used by all.
    """

    def __init__(self, many: SettledMany, scene: Scene, lift: Lift):
        self.ends = scene.required_operation.band_rpm
        self.metrics: dict[float, dict[str, float]] = {}
        self._compute = partial(at_speeds, many, scene, lift)

    def __call__(self, speeds_rpm: Iterable[float]) -> list[dict[str, float]]:
        """Metrics at these speeds [r/min]."""
        speeds = [float(s) for s in speeds_rpm]
        new = sorted({*speeds} - self.metrics.keys())
        if new:
            self.metrics.update(zip(new, self._compute(new), strict=True))
        return [self.metrics[s] for s in speeds]

    def band(self, step_rpm: float) -> Band:
        """The metrics at the speeds inside the band."""
        low, high = self.ends
        speeds = [s for s in sorted(self.metrics) if low <= s <= high]
        figures = {name: np.array([self.metrics[s][name] for s in speeds]) for name in QUANTITIES}
        return Band(low, high, step_rpm, np.array(speeds), figures, ("event",) * len(speeds))


def sweep(
    swept: SpeedCache,
    step_rpm: float,
    refine: tuple[str, ...] = ("bounce_mm",),
    lightly_damped: Iterable[Resonance] = (),
    *,
    coarsely: bool = False,
) -> Band:
    """The band in steps of `step_rpm` and at its resonances, then around the peaks of `refine` to FINEST_RPM.

    The refinement quarters the step about the PEAKS worst local maxima of each metric found so far; `coarsely` has
    COARSELY in their places. Where the motion bounces, bounce against speed is rough: what is refined is the largest
    found, not proved to be the largest.
    """
    finest, most = COARSELY if coarsely else (FINEST_RPM, PEAKS)
    low, high = swept.ends
    swept([*np.arange(low, high, step_rpm), high])
    swept({float(np.clip(s, low, high)) for r in lightly_damped for s in r.speeds_rpm()})
    step = step_rpm
    while refine and step > finest:
        step = max(finest, round(step / 4))
        band = swept.band(step_rpm)
        peaks = {s for name in refine for s in band.peaks(name)[:most]}
        swept({float(s) for peak in peaks for s in np.clip(round(peak) + step * np.arange(-3, 4), low, high)})
    return swept.band(step_rpm)


def first_exceeding(
    swept: SpeedCache, limits: dict[str, float], step_rpm: float = SEARCH_STEP_RPM
) -> dict[str, float | None]:
    """The lowest speed [r/min] at which each metric exceeds its limit, to START_RPM.

    The search goes upward from half the band's lowest speed to 1.5 times its highest, in steps of `step_rpm` and at
    every speed that was looked at before; the first speed found is then refined by bisection. A valve that does not
    seat counts as exceeding. A metric that exceeds its limit at the lowest speed already gets that speed, and one that
    never does gets None.
    """
    low, high = swept.ends
    grid = sorted({*np.arange(0.5 * low, 1.5 * high, step_rpm).tolist(), 1.5 * high, *swept.metrics})
    first: dict[str, float | None] = dict.fromkeys(limits)
    for begin in range(0, len(grid), CHUNK):
        missing = [name for name in limits if first[name] is None]
        if not missing:
            break
        rows = swept(grid[begin : begin + CHUNK])
        for name in missing:
            over = [begin + i for i, row in enumerate(rows) if not row[name] <= limits[name]]
            if over:
                first[name] = _bisect(swept, name, limits[name], grid[max(0, over[0] - 1)], grid[over[0]])
    return first


def _bisect(swept: SpeedCache, name: str, limit: float, below: float, above: float) -> float:
    while above - below > START_RPM:
        middle = float(round(0.5 * (below + above)))
        below, above = (below, middle) if not swept([middle])[0][name] <= limit else (middle, above)
    return float(above)
