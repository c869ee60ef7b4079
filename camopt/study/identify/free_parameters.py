"""Parameters of a train that a fit may move, under the scene's own names.

Each is expressed by the logarithm of a factor on its start value. The logarithm keeps masses, stiffnesses and dampings
positive, and gives a change by one unit the same meaning for every parameter.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

import numpy as np

from camopt.exact.adjoint.motion import ByTrain
from camopt.scene.errors import InputError
from camopt.scene.schema import Scene
from camopt.scene.train import Train, build_train

KEYS = {
    "mass": ("mass_kg", "damping_N_s_per_m", "force_N"),
    "element": (
        *("stiffness_N_per_m", "damping_N_s_per_m", "preload_N", "gap_mm"),
        *("spring_N_per_m", "leak_N_s_per_m", "check_travel_mm", "slip_N"),
    ),
}
"""Keys of a scene's tables that may be free."""
DIFFERENCE = 1e-6
"""Step in a logarithm with which the numbers of a train are differentiated: most are products of the factors, and the
rows of an adjuster's plunger are quotients, so that truncation and rounding stay below 1e-9 of them."""


@dataclass(frozen=True)
class Tied:
    """One free parameter: everything that its name matches, moved by one factor."""

    name: str
    table: str  # of the scene: mass or element
    key: str  # in that table
    at: tuple[int, ...]  # places there
    start: float  # of the first that matches, in the unit of `key`


class FreeParameters:
    """The free parameters (p) of a scene; a point of the fit is `logs` (p), the logarithms of their factors."""

    def __init__(self, scene: Scene, free: Sequence[str]):
        """Finds the parameters named in `free` (p), each as `<name>.<key>`, such as `valve.mass_kg`.

        A `*` in a name ties all that match and are not zero to one factor (`coil_*.damping_N_s_per_m`). Raises
        InputError for a name that matches nothing, matches zeros only, matches both masses and elements, or matches
        what another name has matched.
        """
        self.scene, self.train = scene, build_train(scene)
        self.tied = tuple(_tied(scene, name) for name in free)
        taken = [(t.table, t.key, i) for t in self.tied for i in t.at]
        if not self.tied or len(set(taken)) < len(taken):
            raise InputError(f"identify: free = {list(free)}: name at least one parameter, and none of them twice")

    def moved(self, logs: np.ndarray) -> Train:
        """The train with every free parameter times exp of its entry in logs (p)."""
        return build_train(self.moved_scene(logs))

    def by_logs(self, logs: np.ndarray, by_train: ByTrain) -> np.ndarray:
        """Gradients (l, p) by logs, from gradients of l numbers by the parameters of the train there.

        What the train's numbers make of the logarithms is known by central differences of the scene's own arithmetic.
        """
        columns = []
        for step in DIFFERENCE * np.eye(len(logs)):
            up, down = self.moved(logs + step), self.moved(logs - step)
            total = np.zeros(len(by_train.mass))
            for name, number in up.parameters.items():
                slope = (number - down.parameters[name]) / (2 * DIFFERENCE)
                total += getattr(by_train, name).reshape(len(total), -1) @ slope.ravel()
            columns.append(total)
        return np.stack(columns, axis=1)

    def moved_scene(self, logs: np.ndarray) -> Scene:
        """The scene with the free parameters moved."""
        rows = {"mass": list(self.scene.mass), "element": list(self.scene.element)}
        for tied, log in zip(self.tied, logs, strict=True):
            table = rows[tied.table]
            for i in tied.at:
                table[i] = table[i].model_copy(update={tied.key: getattr(table[i], tied.key) * float(np.exp(log))})
        return self.scene.model_copy(update={name: tuple(table) for name, table in rows.items()})


def _tied(scene: Scene, name: str) -> Tied:
    pattern, _, key = name.rpartition(".")
    found, zero = [], False
    for table, keys in KEYS.items():
        rows = getattr(scene, table)
        matched = [i for i, row in enumerate(rows) if fnmatchcase(row.name, pattern)] if key in keys else []
        at = tuple(i for i in matched if getattr(rows[i], key))  # a factor leaves zero as it is
        zero = zero or len(at) < len(matched)
        if at:
            found.append(Tied(name, table, key, at, getattr(rows[at[0]], key)))
    if len(found) == 1:
        return found[0]
    if found:
        raise InputError(f"identify: {name}: masses and elements both match: name them apart")
    if zero:
        raise InputError(f"identify: {name}: the fit starts at the scene's value, and that is 0 or none: set it")
    raise InputError(
        f"identify: {name!r}: no such parameter; expected <mass>.{'|'.join(KEYS['mass'])} or "
        f"<element>.{'|'.join(KEYS['element'])}, with the names of scene {scene.name}"
    )
