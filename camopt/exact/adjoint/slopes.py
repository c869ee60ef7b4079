"""Gradients with respect to the cam, the start state and a train's parameters, under the names of the parameters.

The forms of the elements' pieces are analytic functions of the parameters, so that a complex step gives their
derivatives to rounding (Squire and Trapp 1998, SIAM Rev. 40:110). Elements share no parameters: one step serves all.
"""

from dataclasses import dataclass, fields, replace
from functools import lru_cache
from typing import Self

import numpy as np

from camopt.exact.adjoint.sweep import Bars
from camopt.exact.affine.pieces import Numbers, forms_of, numbers_of, parts_of
from camopt.exact.kernel.arrays import TrainArrays
from camopt.scene.shapes import Float
from camopt.scene.train import Train

STEP = 1e-30


@dataclass(frozen=True)
class ByTrain:
    """Gradients of l numbers with respect to a train's parameters in SI units, under their names in `Train`."""

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
    """Gradients for a train with laws or with forces over the cam angle, including those with respect to their numbers.

    `stiffness` is the gradient with respect to the coefficients of the laws. The names are those of `Laws`.
    """

    dissipation: Float[np.ndarray, "l e"]
    table: Float[np.ndarray, "l e q 2"]
    leak: Float[np.ndarray, "l e"]
    travel: Float[np.ndarray, "l e"]
    slip: Float[np.ndarray, "l e"]
    forcing: Float[np.ndarray, "l rows"]  # forces in the rows of all forcings, one forcing after the other


@dataclass(frozen=True)
class Slopes:
    """Gradients of g numbers; `by_train` is None unless it was requested."""

    by_coefficients: Float[np.ndarray, "g p q"]  # with respect to lift.coefficients [m/rad^k]
    by_start: Float[np.ndarray, "g state"]  # with respect to the state at -pi
    by_train: ByTrain | None


def room_for_bars(train: TrainArrays, pieces: tuple[int, ...], sweeps: int, mechanical: bool) -> Bars:
    """Zero cotangents for a number of sweeps, each array with a first axis of that length."""
    n, e = len(train.mass), len(train.a)
    shapes = (2 * n + len(train.reach),), pieces, (3 * mechanical, n), train.law.shape, (e,)
    return Bars(*(np.zeros((sweeps, *shape)) for shape in shapes))


def by_train(train: Train, bars: Bars, by_rows: np.ndarray | None = None) -> ByTrain:
    """The gradients of l numbers from their sweeps, under the names of the parameters. `by_rows` (l, rows) are those
    with respect to the rows of forces over the cam angle; they are zero without it, as at rest."""
    by_mass, gradients = bars.mass.transpose(1, 0, 2), by_numbers(train, bars.law)
    if train.laws is None and not train.forcing:
        return ByTrain(*by_mass, **gradients, gap=bars.gap)
    rows = np.zeros((len(bars.gap), sum(len(forcing.angle) for forcing in train.forcing)))
    return ByTrainAndLaws(*by_mass, **gradients, gap=bars.gap, forcing=rows if by_rows is None else by_rows)


def by_numbers(train: Train, by_law: np.ndarray) -> dict[str, np.ndarray]:
    """Gradients of l numbers by `Numbers`, (l, e) or for tables (l, e, q, 2), from those by the forms (l, f, 4).

    A train of linear elements only has the first three of them.
    """
    owner, slopes = _slopes(train)
    count, gradients = len(by_law), {}
    for name, slope in slopes.items():
        shape = slope.shape[2:]
        moved = np.einsum("lfc,fck->lfk", by_law, slope.reshape(*slope.shape[:2], -1))
        gradients[name] = np.einsum("lfk,fe->lek", moved, owner).reshape(count, owner.shape[1], *shape)
    return gradients


@lru_cache(maxsize=64)
def _slopes(train: Train) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """(one-hot element of every form (f, e), derivatives of the forms (f, 4, ...) by each parameter of the element)."""
    numbers = numbers_of(train)
    elements = parts_of(train, numbers)
    pieces = [e for e, element in enumerate(elements) for _ in element.pieces]
    watches = [e for e, element in enumerate(elements) for piece in element.pieces for _ in piece.watches]
    owner = np.eye(len(elements))[[*pieces, *pieces, *watches]]
    derivatives = {}
    for field in fields(Numbers)[: None if train.laws is not None or train.forcing else 3]:
        value = getattr(numbers, field.name)
        shape = value.shape[1:]
        steps = np.eye(int(np.prod(shape))).reshape(-1, *shape)
        moved = (replace(numbers, **{field.name: value + 1j * STEP * step}) for step in steps)
        rows = [np.imag(forms_of(parts_of(train, stepped))) / STEP for stepped in moved]
        derivatives[field.name] = np.stack(rows, axis=-1).reshape(len(owner), 4, *shape)
    return owner, derivatives
