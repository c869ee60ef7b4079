"""Parameters of a train that a fit may move, under the scene's own names.

Each is expressed by the logarithm of a factor on its start value. The logarithm keeps masses, stiffnesses and dampings
positive, and gives a change by one unit the same meaning for every parameter.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase

import numpy as np

from camopt.exact.adjoint.motion import ByTrain
from camopt.scene.errors import InputError
from camopt.scene.schema import Scene
from camopt.scene.train import Train, build_train

MASS_KEYS = {"mass_kg": "mass", "damping_N_s_per_m": "mass_damping", "force_N": "mass_force"}
ELEMENT_KEYS = {
    "stiffness_N_per_m": "stiffness",
    "damping_N_s_per_m": "damping",
    "preload_N": "preload",
    "gap_mm": "gap",
}
"""Keys of a scene's tables that may be free, with the names in `Train` of the numbers that they give."""


@dataclass(frozen=True)
class Tied:
    """One free parameter: everything that its name matches, moved by one factor."""

    name: str
    key: str  # in the scene's tables
    field: str  # in Train
    at: np.ndarray  # (g) indices there
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
        taken = [(t.field, int(i)) for t in self.tied for i in t.at]
        if not self.tied or len(set(taken)) < len(taken):
            raise InputError(f"identify: free = {list(free)}: name at least one parameter, and none of them twice")

    def moved(self, logs: np.ndarray) -> Train:
        """The train with every free parameter times exp of its entry in logs (p)."""
        values = {t.field: getattr(self.train, t.field).copy() for t in self.tied}
        for tied, log in zip(self.tied, logs, strict=True):
            values[tied.field][tied.at] *= np.exp(log)
        return replace(self.train, **values)

    def by_logs(self, train: Train, by_train: ByTrain) -> np.ndarray:
        """Gradients (l, p) by logs, from gradients of l numbers by a moved train's parameters."""
        rows = [getattr(by_train, t.field)[:, t.at] @ getattr(train, t.field)[t.at] for t in self.tied]
        return np.stack(rows, axis=1)

    def moved_scene(self, logs: np.ndarray) -> Scene:
        """The scene with the free parameters moved."""
        rows = {"mass": list(self.scene.mass), "element": list(self.scene.element)}
        for tied, log in zip(self.tied, logs, strict=True):
            table = rows["mass" if tied.field in MASS_KEYS.values() else "element"]
            for i in tied.at:
                table[i] = table[i].model_copy(update={tied.key: getattr(table[i], tied.key) * float(np.exp(log))})
        return self.scene.model_copy(update={name: tuple(table) for name, table in rows.items()})


def _tied(scene: Scene, name: str) -> Tied:
    pattern, _, key = name.rpartition(".")
    found, zero = [], False
    for table, keys in ((scene.mass, MASS_KEYS), (scene.element, ELEMENT_KEYS)):
        matched = [i for i, row in enumerate(table) if fnmatchcase(row.name, pattern)] if key in keys else []
        at = [i for i in matched if getattr(table[i], key)]  # a factor leaves zero as it is
        zero = zero or len(at) < len(matched)
        if at:
            found.append(Tied(name, key, keys[key], np.array(at), getattr(table[at[0]], key)))
    if len(found) == 1:
        return found[0]
    if found:
        raise InputError(f"identify: {name}: masses and elements both match: name them apart")
    if zero:
        raise InputError(f"identify: {name}: the fit starts at the scene's value, and that is 0 or none: set it")
    raise InputError(
        f"identify: {name!r}: no such parameter; expected <mass>.{'|'.join(MASS_KEYS)} or "
        f"<element>.{'|'.join(ELEMENT_KEYS)}, with the names of scene {scene.name}"
    )
