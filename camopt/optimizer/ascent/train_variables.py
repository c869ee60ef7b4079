"""Variables of the train: factors on numbers of the scene, within bounds."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from camopt.scene.element import Element
from camopt.scene.errors import InputError
from camopt.scene.parts import OIL_OF
from camopt.scene.schema import Mass, Scene
from camopt.scene.spelling import did_you_mean
from camopt.scene.text_file import excerpt
from camopt.scene.train import build_train

ARRAYS = {
    "mass_kg": "mass",
    "damping_N_s_per_m": "damping",
    "force_N": "mass_force",
    "stiffness_N_per_m": "stiffness",
    "preload_N": "preload",
    "gap_mm": "gap",
    "leak_N_s_per_m": "leak",
    "slip_N": "slip",
}
"""Keys of a scene whose numbers may vary, and the arrays of a train in which they stand."""

Names = str | tuple[str, ...]


@dataclass(frozen=True)
class TrainVariables:
    """Factors on numbers of a scene: `bounds` by NAME.KEY, or by several of these that share one factor."""

    scene: Scene
    bounds: Mapping[Names, tuple[float, float]]

    def __post_init__(self) -> None:
        for names, (low, high) in self.bounds.items():
            if not 0.0 < low <= 1.0 <= high:
                raise InputError(f"train {names}: factors from {low:g} to {high:g}: bounds about 1 are needed")
        self._places  # noqa: B018 - unknown names are answered now

    @property
    def names(self) -> list[str]:
        """What each factor is called."""
        return [names if isinstance(names, str) else " = ".join(names) for names in self.bounds]

    @property
    def limits(self) -> np.ndarray:
        """Least and largest factors (2, k)."""
        return np.array(list(self.bounds.values()), dtype=float).reshape(-1, 2).T

    @cached_property
    def _places(self) -> list[list[tuple[str, int]]]:
        """By factor the arrays of the train, with the indices in them, on which it acts."""
        several = [[names] if isinstance(names, str) else list(names) for names in self.bounds]
        return [[self._place(text) for text in names] for names in several]

    def _place(self, text: str) -> tuple[str, int]:
        name, _, key = text.rpartition(".")
        for rows, schema in ((self.scene.mass, Mass), (self.scene.element, Element)):
            for i, row in enumerate(rows):
                if row.name == name and key in ARRAYS and getattr(row, key, None) is not None:
                    if isinstance(row, Element) and row.form == "table" and key == "preload_N":
                        break  # its force is all in its table
                    if isinstance(row, Element) and row.kind == "adjuster":
                        if key != "leak_N_s_per_m":
                            break  # it moves the rows of the plunger's table, which are no multiples of it
                        i = build_train(self.scene).element_names.index(OIL_OF.format(name))
                    array = "mass_damping" if schema is Mass and key == "damping_N_s_per_m" else ARRAYS[key]
                    return array, i
        known = [f"{row.name}.{key}" for row in self.scene.mass for key in ("mass_kg", "damping_N_s_per_m", "force_N")]
        keys = "stiffness_N_per_m", "damping_N_s_per_m", "preload_N", "gap_mm", "leak_N_s_per_m", "slip_N"
        known += [f"{row.name}.{key}" for row in self.scene.element for key in keys]
        raise InputError(f"train: {excerpt(text)} is no number of the train that may vary{did_you_mean(text, known)}")

    def applied(self, numbers: Mapping[str, Any], factors: Any) -> dict[str, Any]:
        """A train's arrays by name, in JAX, with the factors (k) on them."""
        found = dict(numbers)
        for k, places in enumerate(self._places):
            for array, i in places:
                found[array] = found[array].at[i].multiply(factors[k])
        return found

    def scene_with(self, factors: np.ndarray) -> Scene:
        """The scene with the factors (k) on its numbers."""
        numbers = {}
        for names, factor in zip(self.bounds, factors, strict=True):
            for text in [names] if isinstance(names, str) else names:
                numbers[text] = float(factor)
        return scaled_scene(self.scene, numbers)


def scaled_scene(scene: Scene, factors: Mapping[str, float]) -> Scene:
    """The scene with each number NAME.KEY multiplied by its factor."""
    tables = {}
    for table in ("mass", "element"):
        rows = []
        for row in getattr(scene, table):
            mine = {t.rpartition(".")[2]: f for t, f in factors.items() if t.rpartition(".")[0] == row.name}
            keys = {key: getattr(row, key) * factor for key, factor in mine.items() if key in type(row).model_fields}
            rows.append(row.model_copy(update=keys))
        tables[table] = tuple(rows)
    return scene.model_copy(update=tables)
