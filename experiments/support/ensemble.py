"""Gradients of a mean over many slightly different cams, for motions whose single gradients are rough or disagree.

The mean of a metric over cams with bumps of random height is J_sigma(z) = E J(z + sigma xi), with xi normal. Its
gradient is estimated by exact gradients, averaged: E dJ/dz(z + sigma xi). It misses what steps of the metric contribute
(a contact that closes once more or once less), and agreement of its halves does not show that; once the motion is
chaotic its variance has no bound, which their disagreement shows (`split_half_cosine`). An evolution strategy, from
values alone, judges it in `experiments/ensemble_gradients.py`. Members come in pairs, xi and -xi.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from camopt.cam.lift import Lift
from camopt.exact.adjoint.motion import value_and_gradient
from camopt.scene.errors import InputError, MotionRefused
from camopt.scene.shapes import Float
from camopt.scene.train import Train
from camopt.study.gradient.paths import cosine, moved

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
