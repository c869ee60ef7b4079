"""Gradients by the cam, by the start state and by a train's numbers, under the names that these have."""

from dataclasses import dataclass, fields
from typing import Self

import numpy as np

from camopt.exact.adjoint.sweep import Bars
from camopt.exact.affine.numbers import by_numbers
from camopt.exact.kernel.arrays import TrainArrays
from camopt.scene.shapes import Float
from camopt.scene.train import Train


@dataclass(frozen=True)
class ByTrain:
    """Gradients of l numbers by a train's parameters in SI, under the names that the parameters have in `Train`."""

    mass: Float[np.ndarray, "l n"]
    mass_damping: Float[np.ndarray, "l n"]
    mass_force: Float[np.ndarray, "l n"]
    stiffness: Float[np.ndarray, "l e"]
    damping: Float[np.ndarray, "l e"]
    preload: Float[np.ndarray, "l e"]
    gap: Float[np.ndarray, "l e"]

    def __add__(self, other: Self) -> Self:
        return type(self)(*(getattr(self, field.name) + getattr(other, field.name) for field in fields(self)))


@dataclass(frozen=True)
class ByTrainAndLaws(ByTrain):
    """The same for a train with laws or with forces by the cam angle, and the gradients by their numbers.

    `stiffness` is by the coefficients of the laws. Names are those of `Laws`.
    """

    table: Float[np.ndarray, "l e q 2"]
    leak: Float[np.ndarray, "l e"]
    travel: Float[np.ndarray, "l e"]
    slip: Float[np.ndarray, "l e"]
    forcing: Float[np.ndarray, "l rows"]  # by the forces in the rows of one forcing after the other


@dataclass(frozen=True)
class Slopes:
    """Gradients of g numbers; `by_train` is None where it was not asked for."""

    by_coefficients: Float[np.ndarray, "g p q"]  # by lift.coefficients [m/rad^k]
    by_start: Float[np.ndarray, "g state"]  # by the state at -pi
    by_train: ByTrain | None


def room_for_bars(train: TrainArrays, pieces: tuple[int, ...], sweeps: int, mechanical: bool) -> Bars:
    """Zero cotangents for a number of sweeps, each array with a first axis of that length."""
    n, e = len(train.mass), len(train.a)
    shapes = (2 * n + len(train.reach),), pieces, (3 * mechanical, n), train.law.shape, (e,)
    return Bars(*(np.zeros((sweeps, *shape)) for shape in shapes))


def by_train(train: Train, bars: Bars, by_rows: np.ndarray | None = None) -> ByTrain:
    """The gradients that sweeps found of l numbers, under the names of the parameters; `by_rows` (l, rows) are those by
    the rows of forces by the cam angle, which do not act at rest."""
    by_mass, found = bars.mass.transpose(1, 0, 2), by_numbers(train, bars.law)
    if train.laws is None and not train.forcing:
        return ByTrain(*by_mass, **found, gap=bars.gap)
    rows = np.zeros((len(bars.gap), sum(len(forcing.angle) for forcing in train.forcing)))
    return ByTrainAndLaws(*by_mass, **found, gap=bars.gap, forcing=rows if by_rows is None else by_rows)
