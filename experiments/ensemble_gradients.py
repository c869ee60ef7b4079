"""Above the speed at which the follower jumps, does the gradient of a mean over neighbouring cams predict the effect of
a step where the gradient of a single cam does not?

The motion is that of `kodama` with a Polydyne at 7000 r/min, the first revolution from rest, with 10 bumps on the lift.
The mean of a metric is J_sigma(z) = E J(z + sigma xi) over cams whose bumps have heights of standard deviation `SIGMA`,
with xi normal; members come in pairs, xi and -xi. There are three gradients of a metric: that of the single cam
(exact), that of the mean (pathwise: exact gradients averaged) and that of the mean by an evolution strategy (function
values only). The pathwise gradient misses the contribution of discontinuities of the metric (a contact that closes once
more or once less), which does not show in the agreement of its two halves; once the motion is chaotic its variance has
no bound, which shows in their disagreement (`split_half_cosine`). Each gradient gives a step of a given length
downhill; the change of the mean is then measured on other members than those of the gradients.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from tqdm import tqdm

from camopt.cam.families.polydyne import polydyne
from camopt.cam.lift import Lift
from camopt.exact.adjoint.motion import TracedMotion, value_and_gradient
from camopt.plots.style import INK, legend_above, lines, new_figure, styled
from camopt.scene import MotionRefused, Train, build_train, load_scene
from camopt.scene.rest import state_at_rest
from camopt.study.gradient.paths import cosine, moved, with_bumps
from experiments.support.record import RESULTS, run_script, write_result

WORKERS = 2
RPM = 7000.0
METRICS = ("bounce_mm", "jump_mm", "seating_velocity_m_per_s", "contact_force_max_N")
SIGMA = 2e-6
"""Standard deviation of the bumps' heights [m]: an ordinary grinding error."""
BUMPS = {"small": 3, "full": 10}
MEMBERS = {"small": 8, "full": 1000}
JUDGES = {"small": 8, "full": 1000}
"""Members of the mean on which a step is evaluated; the strategy has four times as many members as MEMBERS."""
LENGTHS = {"small": (1e-6,), "full": (2e-7, 5e-7, 1e-6, 2e-6, 5e-6)}
"""Lengths of the steps [m]: root of the sum of squared heights."""


class Bumped(NamedTuple):
    """A cam with m bumps in a train at one speed, with l metrics of the first revolution from rest."""

    train: Train
    lift: Lift
    directions: np.ndarray  # (m, p, q), as of `with_bumps`
    cam_speed: float  # rad/s
    metrics: tuple[str, ...] = METRICS

    def values(self, heights: np.ndarray) -> np.ndarray:
        """The metrics (l) with the bumps at heights (m) [m]."""
        lift = moved(self.lift, self.directions, heights)
        return TracedMotion(self.train, lift, self.cam_speed, state_at_rest(self.train)).values(self.metrics)

    def values_and_slopes(self, heights: np.ndarray) -> np.ndarray:
        """The metrics (l) in the first column of (l, 1 + m), and their slopes by the heights [unit per m]."""
        lift = moved(self.lift, self.directions, heights)
        slopes = value_and_gradient(self.train, lift, self.cam_speed, self.metrics)
        return np.column_stack([slopes.values, np.einsum("lpq,mpq->lm", slopes.by_coefficients, self.directions)])


def drawn_heights(members: int, bumps: int, sigma_m: float, seed: int) -> np.ndarray:
    """Heights (members / 2, bumps) [m] of the bumps of the first member of every pair."""
    return sigma_m * np.random.default_rng(seed).normal(size=(members // 2, bumps))


def of_pairs(numbers: Callable[[np.ndarray], np.ndarray], heights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(heights (k, m), numbers (k, 2, ...) of the cams with these and with the opposite heights), without the pairs in
    which a motion is refused or a number is not finite."""

    def of_pair(one: np.ndarray) -> np.ndarray | None:
        try:
            pair = np.array([numbers(one), numbers(-one)])
        except MotionRefused:
            return None
        return pair if np.all(np.isfinite(pair)) else None

    with ThreadPoolExecutor(WORKERS) as pool:
        pairs = list(pool.map(of_pair, heights))
    complete = [i for i, pair in enumerate(pairs) if pair is not None]
    return heights[complete], np.array([pairs[i] for i in complete])


def pathwise(bumped: Bumped, heights: np.ndarray) -> np.ndarray:
    """Slopes (k, l, m) of every pair of members; their mean is the gradient of the mean metrics."""
    _, pairs = of_pairs(bumped.values_and_slopes, heights)
    return pairs[..., 1:].mean(axis=1)


def evolution_strategy(bumped: Bumped, heights: np.ndarray, sigma_m: float) -> np.ndarray:
    """The same from function values only: noisier, but unbiased also where the metric is discontinuous.

    It is E [J(z + sigma xi) - J(z - sigma xi)] xi / (2 sigma) (Nesterov, Spokoiny 2017).
    """
    heights, values = of_pairs(bumped.values, heights)
    rise = (values[:, 0] - values[:, 1]) / (2.0 * sigma_m**2)
    return rise[:, :, None] * heights[:, None, :]


def split_half_cosine(slopes: np.ndarray) -> list[float]:
    """Cosines (l) between the mean slopes of the two halves of (k, l, m); far from 1 means noise."""
    halves = slopes[: len(slopes) // 2].mean(axis=0), slopes[len(slopes) // 2 :].mean(axis=0)
    return [cosine(a, b) for a, b in zip(*halves, strict=True)]


def main(size: str = "full", folder: Path = RESULTS) -> dict:
    """The three gradients of each metric, the predicted change of a step downhill, and the change of the mean."""
    scene = load_scene("kodama")
    bumped = Bumped(build_train(scene), *with_bumps(polydyne(scene), BUMPS[size]), scene.cam_speed(RPM))
    slopes = pathwise(bumped, drawn_heights(MEMBERS[size], BUMPS[size], SIGMA, seed=1))
    strategy = evolution_strategy(bumped, drawn_heights(4 * MEMBERS[size], BUMPS[size], SIGMA, seed=2), SIGMA)
    gradients = {
        "single cam": bumped.values_and_slopes(np.zeros(BUMPS[size]))[:, 1:],
        "mean, pathwise": slopes.mean(axis=0),
        "mean, evolution strategy": strategy.mean(axis=0),
    }
    noise = SIGMA * np.random.default_rng(3).normal(size=(JUDGES[size], BUMPS[size]))

    def members(heights: np.ndarray) -> np.ndarray:
        """Values (k, l) of the evaluation members about the cam with the bumps at heights (m) [m]."""
        return np.array([bumped.values(heights + one) for one in noise])

    before, rows = members(np.zeros(BUMPS[size])), []
    for i, metric in enumerate(METRICS):
        for name, gradient in tqdm(gradients.items(), desc=metric, disable=None):
            downhill = -gradient[i] / np.linalg.norm(gradient[i])
            for length in LENGTHS[size]:
                change = members(length * downhill)[:, i] - before[:, i]
                rows.append({
                    "metric": metric, "gradient": name, "length_um": 1e6 * length,
                    "promised": float(gradient[i] @ downhill * length), "change": float(change.mean()),
                    "standard_error": float(change.std() / np.sqrt(len(change))),
                    "cosine_with_strategy": cosine(gradient[i], strategy.mean(axis=0)[i]),
                })  # fmt: skip
    content = {
        "speed_rpm": RPM, "sigma_um": 1e6 * SIGMA, "members": MEMBERS[size], "metrics": METRICS,
        "mean": before.mean(axis=0).tolist(), "scatter": before.std(axis=0).tolist(),
        "split_half_cosine": split_half_cosine(slopes),
        "strategy_split_half_cosine": split_half_cosine(strategy), "rows": rows,
    }  # fmt: skip
    return write_result("ensemble_gradients", size, content, {} if size == "small" else {"steps": figure(rows)}, folder)


@styled
def figure(rows: list[dict]) -> Figure:
    """Change of the mean over the change that each gradient predicted, against the length of the step."""
    drawing = new_figure(3.0 * len(METRICS), 3.2)
    for axis, metric in zip(drawing.subplots(1, len(METRICS), sharey=True), METRICS, strict=True):
        here = [r for r in rows if r["metric"] == metric]
        for number, name in enumerate(dict.fromkeys(r["gradient"] for r in here)):
            curve = [r for r in here if r["gradient"] == name]
            share, error = (np.array([r[key] / r["promised"] for r in curve]) for key in ("change", "standard_error"))
            axis.errorbar([r["length_um"] for r in curve], share, np.abs(error), marker="os^"[number], ms=4, capsize=2,
                          color=list(lines().values())[number][0], label=name)  # fmt: skip
        axis.axhline(1.0, color=INK, linestyle=(0, (5, 3)), linewidth=0.9)
        axis.axhline(0.0, color=INK, linewidth=0.6)
        axis.set(xscale="log", title=metric, xlabel="length of the step [um]", ylim=(-0.5, 3.5))
        axis.set_xticks(sorted({r["length_um"] for r in here}), [f"{1e6 * length:g}" for length in LENGTHS["full"]])
        axis.minorticks_off()
    drawing.axes[0].set_ylabel("change of the mean / promised change")
    legend_above(drawing, drawing.axes[0])
    return drawing


if __name__ == "__main__":
    run_script(main, __doc__)
