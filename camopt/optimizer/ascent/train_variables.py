"""Variables of the train: factors on numbers of the scene, within bounds."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from camopt.scene.errors import InputError
from camopt.scene.parameters import PRELOAD, RATE, SceneNumber, Tied, matching, no_such_number
from camopt.scene.parts import OIL_OF
from camopt.scene.schema import Scene
from camopt.scene.text_file import excerpt
from camopt.scene.train import build_train

ARRAYS = {
    "mass": {"mass_kg": "mass", "damping_N_s_per_m": "mass_damping", "force_N": "mass_force"},
    "element": {
        RATE: "stiffness",
        "damping_N_s_per_m": "damping",
        PRELOAD: "preload",
        "gap_mm": "gap",
        "dissipation_s_per_m": "dissipation",
        "leak_N_s_per_m": "leak",
        "slip_N": "slip",
    },
}
"""Keys of a scene whose numbers may vary, by their table, and the arrays of a train in which they stand."""
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
        numbers = [number for tied in self._tied for number in tied.numbers]  # unknown names are answered now
        if twice := [number.named(self.scene) for number in set(numbers) if numbers.count(number) > 1]:
            raise InputError(f"train: {min(twice)} has two factors: name it once")

    @property
    def names(self) -> list[str]:
        """What each factor is called."""
        return [tied.name for tied in self._tied]

    @property
    def limits(self) -> np.ndarray:
        """Least and largest factors (2, k)."""
        return np.array(list(self.bounds.values()), dtype=float).reshape(-1, 2).T

    @cached_property
    def _tied(self) -> list[Tied]:
        """The numbers of each factor."""
        several = [[names] if isinstance(names, str) else list(names) for names in self.bounds]
        return [
            Tied(" = ".join(names), tuple(number for name in names for number in self._numbers(name)))
            for names in several
        ]

    def _numbers(self, name: str) -> list[SceneNumber]:
        """The numbers that a name means; raises InputError where one of them is no factor on arrays of a train."""
        numbers = matching(self.scene, name)
        if not numbers:
            raise no_such_number(self.scene, name, "train")
        for number in numbers:
            of_adjuster = number.table == "element" and self.scene.element[number.row].kind == "adjuster"
            out_of_proportion = of_adjuster and number.key != "leak_N_s_per_m"  # it moves the rows of the plunger
            if number.key not in ARRAYS[number.table] or out_of_proportion or number.of(self.scene) is None:
                raise InputError(f"train: {excerpt(number.named(self.scene))} is no number of the train that may vary")
        return numbers

    def applied(self, numbers: Mapping[str, Any], factors: Any) -> dict[str, Any]:
        """A train's arrays by name, in JAX, with the factors (k) on them."""
        arrays = dict(numbers)
        for k, tied in enumerate(self._tied):
            for number in tied.numbers:
                self._multiply(arrays, number, factors[k])
        return arrays

    def _multiply(self, arrays: dict[str, Any], number: SceneNumber, factor: Any) -> None:
        """Multiplies one number of a train; that of a table moves its rows as `camopt.scene.parameters` says."""
        array, at = ARRAYS[number.table][number.key], number.row
        element = self.scene.element[at] if number.table == "element" else None
        if element is not None and element.kind == "adjuster":
            at = build_train(self.scene).element_names.index(OIL_OF.format(element.name))
        if element is not None and number.key == PRELOAD and element.force_table:
            arrays["table"] = arrays["table"].at[at, :, 1].add((factor - 1.0) * arrays["preload"][at])
        elif element is not None and number.key == RATE and element.form in ("progressive", "table"):
            installed = arrays["preload"][at] if element.force_table else 0.0
            rows = arrays["table"][at, :, 1]
            arrays["table"] = arrays["table"].at[at, :, 1].set(installed + factor * (rows - installed))
        arrays[array] = arrays[array].at[at].multiply(factor)

    def scene_with(self, factors: np.ndarray) -> Scene:
        """The scene with the factors (k) on its numbers."""
        scene = self.scene
        for tied, factor in zip(self._tied, factors, strict=True):
            scene = tied.scaled(scene, float(factor))
        return scene
