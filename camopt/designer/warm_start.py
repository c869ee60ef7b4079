"""Where the solver begins on a no-jump program: at the rows that held the last one, found again among rows that moved.

A longer duration or another lash has its rows at other angles, and one more here and there. What was tight there is
tight nearby here, so that the solver needs tens of pivots instead of hundreds.
"""

from itertools import pairwise

import numpy as np

from camopt.optimizer.program.force_rows import Margins
from camopt.optimizer.program.no_jump import NoJumpProgram


def begin_like(known: NoJumpProgram, new: NoJumpProgram) -> None:
    """Lets the solver begin a program where it ended on another one, if that has as many columns and speeds."""
    if known.rows.matrix.shape[1] == new.rows.matrix.shape[1] and len(known.blocks) == len(new.blocks):
        level = new.bound(Margins().table(len(new.blocks))) / new.rows.norm
        like = counterparts(known, new)[known.rows.model.held]
        new.rows.model.begin_like(known.rows.model, level, new.first_working(), like)


def counterparts(known: NoJumpProgram, new: NoJumpProgram) -> np.ndarray:
    """For every row of a program the row of another one in its place: of the same limit, or of the same contact at the
    same speed, and as far along. Shape (r), -1 where the other has no such rows."""
    found = np.full(len(known.rows.norm), -1)
    there = runs(new)
    for name, (first, count) in runs(known).items():
        if name in there:
            begin, length = there[name]
            along = np.arange(count) * ((length - 1) / max(1, count - 1))
            found[first : first + count] = begin + np.rint(along).astype(int)
    return found


def runs(program: NoJumpProgram) -> dict[tuple, tuple[int, int]]:
    """The first row and the number of rows of every limit, and of every kind of force by speed and contact."""
    limits, element = program.limits, np.concatenate([block.element for block in program.blocks])
    forces = np.stack([program.speed, program.kind, element], axis=1)
    found: dict[tuple, tuple[int, int]] = {}
    for first, names in ((0, limits.group[:, None]), (len(limits.group), forces)):
        changes = np.flatnonzero(np.any(np.diff(names, axis=0, prepend=-1, append=-1), axis=1))
        for begin, end in pairwise(changes.tolist()):
            one = tuple(names[begin].tolist())
            name = one if first else (limits.names[one[0]],)
            found[name] = first + begin, end - begin  # the rows of a name lie together
    return found
