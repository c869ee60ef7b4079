"""Gradients by the cam, by the start state and by a train's numbers, under the names that these have."""

from dataclasses import dataclass, fields

import numpy as np

from camopt.exact.adjoint.sweep import Bars
from camopt.exact.affine.numbers import by_numbers
from camopt.exact.kernel.arrays import TrainArrays
from camopt.scene.shapes import Float
from camopt.scene.train import Train


@dataclass(frozen=True)
class ByTrain:
    """Gradients of l numbers by a train's parameters in SI, under the names that they have in `Train` and `Laws`.

    Where a train has laws, `stiffness` is by their coefficients. What comes after the gap is None where a train has no
    laws, and `forcing` where no force repeats with the cam angle.
    """

    mass: Float[np.ndarray, "l n"]
    mass_damping: Float[np.ndarray, "l n"]
    mass_force: Float[np.ndarray, "l n"]
    stiffness: Float[np.ndarray, "l e"]
    damping: Float[np.ndarray, "l e"]
    preload: Float[np.ndarray, "l e"]
    gap: Float[np.ndarray, "l e"]
    table: Float[np.ndarray, "l e q 2"] | None = None
    leak: Float[np.ndarray, "l e"] | None = None
    travel: Float[np.ndarray, "l e"] | None = None
    slip: Float[np.ndarray, "l e"] | None = None
    forcing: Float[np.ndarray, "l rows"] | None = None  # by the rows' forces, one forcing after the other

    def __add__(self, other: "ByTrain") -> "ByTrain":
        pairs = ((getattr(self, field.name), getattr(other, field.name)) for field in fields(self))
        return ByTrain(*(b if a is None else a if b is None else a + b for a, b in pairs))


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
    the rows of forces by the cam angle."""
    found = by_numbers(train, bars.law)
    forcing = by_rows if train.forcing else None
    return ByTrain(*bars.mass.transpose(1, 0, 2), **found, gap=bars.gap, forcing=forcing)
