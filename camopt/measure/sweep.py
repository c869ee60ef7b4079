"""Sweep of a band of speeds by one cheap method: worst speed of each metric, and speeds where bounce and jump start."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from camopt.cam.lift import Lift
from camopt.measure.resonance import Resonance
from camopt.scene.quantities import LESS_IS_WORSE, QUANTITIES, is_number
from camopt.scene.schema import Scene
from camopt.scene.settled import SettledMetrics
from camopt.scene.shapes import Float
from camopt.scene.train import build_train

STARTS = {"first_jump_rpm": "jump_mm", "first_bounce_rpm": "bounce_mm"}
"""Metrics by key of a verdict's `limits`: the metric exceeds its limit from the speed on that the key names."""
STARTS_MM = 0.05
"""Limit of bounce and jump [mm] for the starting speeds if the scene sets none."""
SEARCH_STEP_RPM = 40.0
"""Step of the search for the starting speeds [r/min]."""
START_RPM = 10.0
"""Accuracy of the starting speeds [r/min]."""
CHUNK = 4
"""Speeds evaluated together in the search for the starting speeds; few, since motions beyond these cost most."""
FINEST_RPM, PEAKS = 1.0, 3
"""Accuracy of the speeds of maxima [r/min], and number of local maxima of each metric that are refined."""
COARSELY = 10.0, 1
"""FINEST_RPM and PEAKS of a coarse refinement."""

SettledMany = Callable[..., SettledMetrics]
"""A function that measures the settled motions of trains and lifts at cam speeds [rad/s] together, such as
`camopt.exact.settled.settled_metrics`."""


def badness(name: str, values: np.ndarray) -> np.ndarray:
    """The values of a metric with the sign for which larger is worse; infinite for NaN."""
    return np.nan_to_num(-values if name in LESS_IS_WORSE else values, nan=np.inf)


@dataclass(frozen=True, repr=False)
class Band:
    """A swept band. A bounce of NaN means that the valve never seats or that the motion is refused."""

    from_rpm: float
    to_rpm: float
    step_rpm: float
    metrics: dict[float, dict[str, float]]  # by ascending speed [r/min] and name
    methods: dict[float, str]  # method of the metrics, by speed
    resonances: tuple[Resonance, ...] = ()  # narrower than the step; evaluated at speeds of their own
    resonances_left_out: int = 0
    refined: bool = True  # whether the sweep was refined around the worst speeds

    def __repr__(self) -> str:
        return f"Band({self.from_rpm:g} to {self.to_rpm:g} r/min, {len(self.metrics)} speeds)"

    @cached_property
    def speeds_rpm(self) -> Float[np.ndarray, " m"]:
        """The ascending speeds [r/min]."""
        return np.array([*self.metrics])

    @cached_property
    def figures(self) -> dict[str, Float[np.ndarray, " m"]]:
        """The values of every metric at `speeds_rpm`, by name."""
        return {name: np.array([row[name] for row in self.metrics.values()]) for name in QUANTITIES}

    def worst(self, name: str) -> tuple[float, float]:
        """Worst speed [r/min] of a metric, and its value there; NaN is worse than any value."""
        i = int(np.argmax(badness(name, self.figures[name])))
        return float(self.speeds_rpm[i]), float(self.figures[name][i])

    def peaks(self, name: str) -> list[float]:
        """Speeds [r/min] of the local maxima of a metric (minima if less is worse), the worst first.

        A plateau counts as one maximum, at its first speed.
        """
        bad = badness(name, self.figures[name])
        before, after = np.append(-np.inf, bad[:-1]), np.append(bad[1:], -np.inf)
        at = np.flatnonzero((bad > before) & (bad >= after))
        return self.speeds_rpm[at[np.argsort(-bad[at], kind="stable")]].tolist()

    def with_judged(self, method: str, judged: dict[float, dict[str, float]]) -> "Band":
        """The band with the metrics of `method` at all `judged` speeds [r/min] inside it.

        At speeds of the sweep they replace the sweep's metrics.
        """
        inside = {speed: row for speed, row in judged.items() if self.from_rpm <= speed <= self.to_rpm}
        metrics = dict(sorted((self.metrics | inside).items()))
        return replace(self, metrics=metrics, methods=self.methods | dict.fromkeys(inside, method))


def at_speeds(
    many: SettledMany, scene: Scene, lift: Lift, speeds_rpm: Sequence[float] | np.ndarray
) -> list[dict[str, float]]:
    """Worst metrics of the settled motion at each speed [r/min], by name; NaN if the motion is refused."""
    settled = many([build_train(scene)], [lift], [scene.cam_speed(s) for s in speeds_rpm])
    worst = {name: settled.worst(name)[0, 0] for name in QUANTITIES}
    return [{name: float(values[i]) for name, values in worst.items()} for i in range(len(speeds_rpm))]


class SpeedCache:
    """The metrics of one cam at speeds computed so far by `many` of event-exact; no speed is computed twice.

    The sweep of the band, its refinement and the search for the starting speeds share one cache.
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
        """The computed metrics at all speeds inside the band."""
        low, high = self.ends
        metrics = {speed: row for speed, row in sorted(self.metrics.items()) if low <= speed <= high}
        return Band(low, high, step_rpm, metrics, dict.fromkeys(metrics, "event"))


def sweep(
    swept: SpeedCache,
    step_rpm: float,
    refine: tuple[str, ...] = ("bounce_mm",),
    lightly_damped: Iterable[Resonance] = (),
    *,
    coarsely: bool = False,
) -> Band:
    """Sweep the band in steps of `step_rpm` and at its resonances, then refine the peaks of the metrics `refine`.

    The refinement repeatedly quarters the step, down to FINEST_RPM, about the PEAKS worst local maxima found for each
    metric; with `coarsely` these are COARSELY. Bounce over speed is rough: the largest value found need not be largest.
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
    """The lowest speed [r/min] at which each metric exceeds its limit, with an accuracy of START_RPM.

    The search proceeds upward from half the band's lowest speed to 1.5 times its highest, in steps of `step_rpm` and at
    every speed in the cache, and then bisects. A valve that does not seat exceeds the limit. The result is the lowest
    speed of the search if the metric exceeds its limit there already, and None if it never does.
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


def reserve_sentences(starts: Mapping, design: Mapping, band_rpm: tuple[float, float]) -> list[str]:
    """A sentence for each of the speeds `starts` [r/min], by the keys of STARTS, from which on a limit is exceeded.

    `design` holds the scene's limits by their keys [mm]; without a limit `STARTS_MM` is used. The speed None means that
    the limit is not exceeded below 1.5 times the band's top. The terminal and the report print the same sentences.
    """
    sentences = []
    for key, name in STARTS.items():
        if key not in starts:
            continue
        limit_mm, at = design.get(QUANTITIES[name].limit), starts[key]
        limit, word = limit_mm if is_number(limit_mm) else STARTS_MM, name.removesuffix("_mm").capitalize()
        if is_number(at):
            sentences.append(f"{word} exceeds {limit:g} mm from {at:.5g} r/min on, {_position_in_band(at, *band_rpm)}.")
        else:
            sentences.append(f"{word} does not exceed {limit:g} mm below 1.5 times the band's top.")
    return sentences


def _position_in_band(at_rpm: float, low_rpm: float, high_rpm: float) -> str:
    if at_rpm < low_rpm:
        return "below the band"
    return f"{100 * (at_rpm / high_rpm - 1):.1f} % above the band" if at_rpm > high_rpm else "within the band"
