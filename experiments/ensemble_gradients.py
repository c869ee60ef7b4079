"""Above the jump: does the gradient of a mean over neighbouring cams say what a step does, where a single one does not?

`kodama` with a Polydyne at 7000 r/min, the first revolution from rest, 10 bumps on the lift. The mean of a metric is
J_sigma(z) = E J(z + sigma xi) over cams whose bumps have heights of standard deviation `SIGMA`, with xi normal; members
come in pairs, xi and -xi. Three gradients of a metric: of the single cam (exact), of the mean (pathwise: exact
gradients averaged) and of the mean by an evolution strategy (values only). The pathwise one misses what steps of the
metric contribute (a contact that closes once more or once less), which agreement of its halves does not show; once the
motion is chaotic its variance has no bound, which their disagreement shows (`split_half_cosine`). Each proposes a step
of a given length downhill; other members than those of the gradients then say by how much the mean changed.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from tqdm import tqdm

from camopt.cam.families.polydyne import polydyne
from camopt.cam.lift import Lift
from camopt.exact.adjoint.motion import TracedMotion, value_and_gradient
from camopt.exact.affine.lines import rest_of
from camopt.plots.style import INK, legend_above, lines, new_figure, styled
from camopt.scene import InputError, MotionRefused, Train, build_train, load_scene
from camopt.scene.rest import state_at_rest
from camopt.scene.shapes import Float
from camopt.study.gradient.paths import cosine, moved, with_bumps
from experiments.support.record import RESULTS, run_script, write_result

FEWEST_PAIRS = 2
WORKERS = 2


@dataclass(frozen=True)
class CamEnsemble:
    """Cams about a `lift` that differ by normal heights of standard deviation `sigma_m` [m] along each of m directions.

    `directions` are changes of `lift.coefficients` per metre, as of `with_bumps`. `members` is even: they come in pairs
    whose heights are opposite. Raises InputError for numbers that make no ensemble.
    """

    lift: Lift
    directions: Float[np.ndarray, "m p q"]
    sigma_m: float
    members: int
    seed: int

    def __post_init__(self):
        if self.members % 2 or self.members < 2 * FEWEST_PAIRS:
            raise InputError(
                f"members = {self.members}: an ensemble needs an even number of at least {2 * FEWEST_PAIRS}"
            )
        if not self.sigma_m > 0.0:
            raise InputError(
                f"sigma_m = {self.sigma_m:g}: the cams of an ensemble must differ; 5e-6 m is a grinding error"
            )

    def heights(self) -> np.ndarray:
        """Heights (members / 2, m) [m] of the bumps of the first member of every pair."""
        return self.sigma_m * np.random.default_rng(self.seed).normal(size=(self.members // 2, len(self.directions)))

    def lifts(self) -> list[Lift]:
        """The members, pair by pair."""
        return [moved(self.lift, self.directions, sign * one) for one in self.heights() for sign in (1.0, -1.0)]


@dataclass(frozen=True)
class EnsembleGradient:
    """Means of l metrics over an ensemble of cams and their gradients by m heights of bumps [unit per m]."""

    metrics: tuple[str, ...]
    values: Float[np.ndarray, " l"]  # means
    gradient: Float[np.ndarray, "l m"]
    standard_error: Float[np.ndarray, "l m"]  # of the gradient, from the scatter of the pairs
    split_half_cosine: Float[
        np.ndarray, " l"
    ]  # between the gradients of the ensemble's two halves; far from 1 means noise
    members: int  # members of the ensemble that count
    refused: int  # members left out, each with its partner: their motion was refused or a metric had no value


def ensemble_gradient(
    train: Train, ensemble: CamEnsemble, cam_speed: float, metrics: Sequence[str]
) -> EnsembleGradient:
    """Mean values and mean pathwise gradients of metrics in the first revolution from rest, in two threads.

    Raises InputError for an unknown metric, MotionRefused where fewer than two pairs count.
    """
    directions = ensemble.directions

    def numbers_of(member: Lift) -> np.ndarray:
        try:
            gradient = value_and_gradient(train, member, cam_speed, metrics)
        except MotionRefused:
            return np.full((len(metrics), 1 + len(directions)), np.nan)
        return np.column_stack([gradient.values, np.einsum("lpq,mpq->lm", gradient.by_coefficients, directions)])

    with ThreadPoolExecutor(WORKERS) as pool:
        numbers = np.array(list(pool.map(numbers_of, ensemble.lifts())))
    pairs = numbers.reshape(-1, 2, len(metrics), 1 + len(directions))
    return summary(metrics, pairs[:, :, :, 0], pairs[:, :, :, 1:].mean(axis=1))


def summary(
    metrics: Sequence[str], values: Float[np.ndarray, "pairs 2 l"], slopes: Float[np.ndarray, "pairs l m"]
) -> EnsembleGradient:
    """The ensemble's means and errors from its values and the gradients of its pairs."""
    usable = np.all(np.isfinite(values), axis=(1, 2)) & np.all(np.isfinite(slopes), axis=(1, 2))
    count = int(np.sum(usable))
    if count < FEWEST_PAIRS:
        raise MotionRefused(
            f"of {len(usable)} pairs of cams {count} move so that every metric has a value: take more pairs, "
            f"a smaller step, or a lower speed"
        )
    slopes = slopes[usable]
    halves = slopes[: count // 2].mean(axis=0), slopes[count // 2 :].mean(axis=0)
    return EnsembleGradient(
        metrics=tuple(metrics),
        values=values[usable].mean(axis=(0, 1)),
        gradient=slopes.mean(axis=0),
        standard_error=slopes.std(axis=0, ddof=1) / np.sqrt(count),
        split_half_cosine=np.array([cosine(a, b) for a, b in zip(*halves, strict=True)]),
        members=2 * count,
        refused=2 * (len(usable) - count),
    )


RPM = 7000.0
METRICS = ("bounce_mm", "jump_mm", "seating_velocity_m_per_s", "contact_force_max_N")
SIGMA = 2e-6
"""Standard deviation of the bumps' heights [m]: an ordinary grinding error."""
BUMPS = {"small": 3, "full": 10}
MEMBERS = {"small": 8, "full": 1000}
JUDGES = {"small": 8, "full": 1000}
"""Members of the gradients, and of the mean that judges a step; the strategy has four times as many of the former."""
LENGTHS = {"small": (1e-6,), "full": (2e-7, 5e-7, 1e-6, 2e-6, 5e-6)}
"""Lengths of the steps [m]: root of the sum of squared heights."""


def main(size: str = "full", folder: Path = RESULTS) -> dict:
    """The three gradients of each metric, the change each promises for a step downhill, and the change of the mean."""
    scene = load_scene("kodama")
    train, speed = build_train(scene), scene.cam_speed(RPM)
    lift, directions = with_bumps(polydyne(scene), BUMPS[size])
    single = value_and_gradient(train, lift, speed, METRICS)
    pathwise = ensemble_gradient(train, CamEnsemble(lift, directions, SIGMA, MEMBERS[size], seed=1), speed, METRICS)
    strategy = evolution_strategy_gradient(
        train, CamEnsemble(lift, directions, SIGMA, 4 * MEMBERS[size], seed=2), speed, METRICS
    )
    gradients = {
        "single cam": np.einsum("lpq,mpq->lm", single.by_coefficients, directions),
        "mean, pathwise": pathwise.gradient,
        "mean, evolution strategy": strategy.gradient,
    }
    noise = SIGMA * np.random.default_rng(3).normal(size=(JUDGES[size], BUMPS[size]))

    def members(heights: np.ndarray) -> np.ndarray:
        """Values (k, l) of the judging members about the cam with the bumps at heights (m) [m]."""
        lifts = (moved(lift, directions, heights + one) for one in noise)
        return np.array([TracedMotion(train, one, speed, state_at_rest(train)).values(METRICS) for one in lifts])

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
                    "cosine_with_strategy": cosine(gradient[i], strategy.gradient[i]),
                })  # fmt: skip
    content = {
        "speed_rpm": RPM, "sigma_um": 1e6 * SIGMA, "members": MEMBERS[size], "metrics": METRICS,
        "mean": before.mean(axis=0).tolist(), "scatter": before.std(axis=0).tolist(),
        "split_half_cosine": pathwise.split_half_cosine.tolist(),
        "strategy_split_half_cosine": strategy.split_half_cosine.tolist(), "rows": rows,
    }  # fmt: skip
    return write_result("ensemble_gradients", size, content, {} if size == "small" else {"steps": figure(rows)}, folder)


def evolution_strategy_gradient(
    train: Train, ensemble: CamEnsemble, cam_speed: float, metrics: Sequence[str]
) -> EnsembleGradient:
    """Like `ensemble_gradient`, but from values alone: noisier, and right however the motion behaves.

    It is E [J(z + sigma xi) - J(z - sigma xi)] xi / (2 sigma) (Nesterov, Spokoiny 2017). Arguments, result and errors
    are those of `ensemble_gradient`.
    """
    at, pairs = rest_of(train), ensemble.heights()

    def values_of(member: Lift) -> np.ndarray:
        try:
            return TracedMotion(train, member, cam_speed, at).values(metrics)
        except MotionRefused:
            return np.full(len(metrics), np.nan)

    with ThreadPoolExecutor(WORKERS) as pool:
        values = np.array(list(pool.map(values_of, ensemble.lifts()))).reshape(len(pairs), 2, -1)
    rise = (values[:, 0] - values[:, 1]) / (2.0 * ensemble.sigma_m**2)
    return summary(metrics, values, rise[:, :, None] * pairs[:, None, :])


@styled
def figure(rows: list[dict]) -> Figure:
    """Change of the mean over the change that each gradient promised, against the length of the step."""
    drawing = new_figure(3.0 * len(METRICS), 3.2)
    for axis, metric in zip(drawing.subplots(1, len(METRICS), sharey=True), METRICS, strict=True):
        here = [r for r in rows if r["metric"] == metric]
        for number, name in enumerate(dict.fromkeys(r["gradient"] for r in here)):
            own = [r for r in here if r["gradient"] == name]
            kept, error = (np.array([r[key] / r["promised"] for r in own]) for key in ("change", "standard_error"))
            axis.errorbar([r["length_um"] for r in own], kept, np.abs(error), marker="os^"[number], ms=4, capsize=2,
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
