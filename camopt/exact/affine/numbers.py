"""From gradients by the pieces' forms to gradients by the numbers of the train.

The forms are analytic functions of the numbers, so that a complex step gives their derivatives without error (Squire
and Trapp 1998, SIAM Rev. 40:110). Elements do not share numbers: one step for all of them at once is enough.
"""

from dataclasses import fields, replace
from functools import lru_cache

import numpy as np

from camopt.exact.affine.pieces import Numbers, forms_of, numbers_of, parts_of
from camopt.scene.train import Train

STEP = 1e-30
LINEAR_NUMBERS = fields(Numbers)[:3]
"""Those that a train of linear elements alone has."""


def by_numbers(train: Train, by_law: np.ndarray) -> dict[str, np.ndarray]:
    """Gradients of l numbers by `Numbers`, (l, e) or for tables (l, e, q, 2), from those by the forms (l, f, 4).

    A train of linear elements alone has only the first three of them.
    """
    owner, slopes = _slopes(train)
    count, found = len(by_law), {}
    for name, slope in slopes.items():
        shape = slope.shape[2:]
        moved = np.einsum("lfc,fck->lfk", by_law, slope.reshape(*slope.shape[:2], -1))
        found[name] = np.einsum("lfk,fe->lek", moved, owner).reshape(count, owner.shape[1], *shape)
    return found


@lru_cache(maxsize=64)
def _slopes(train: Train) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """(which form belongs to which element (f, e), derivatives of the forms (f, 4) by each number of their elements)"""
    numbers = numbers_of(train)
    parts = parts_of(train, numbers)
    pieces = [e for e, element in enumerate(parts) for _ in element.pieces]
    watches = [e for e, element in enumerate(parts) for piece in element.pieces for _ in piece.watches]
    owner = np.eye(len(parts))[[*pieces, *pieces, *watches]]
    found = {}
    for field in fields(Numbers) if train.laws is not None or train.forcing else LINEAR_NUMBERS:
        value = getattr(numbers, field.name)
        shape = value.shape[1:]
        steps = np.eye(int(np.prod(shape))).reshape(-1, *shape)
        moved = (replace(numbers, **{field.name: value + 1j * STEP * step}) for step in steps)
        rows = [np.imag(forms_of(parts_of(train, one))) / STEP for one in moved]
        found[field.name] = np.stack(rows, axis=-1).reshape(len(owner), 4, *shape)
    return owner, found
