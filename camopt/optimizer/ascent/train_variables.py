"""Variables of the train: factors on numbers of the scene, within bounds."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import jax.numpy as jnp
import numpy as np

from camopt.scene.errors import InputError
from camopt.scene.parameters import SceneNumber, Tied, matching, no_such_number
from camopt.scene.schema import Scene
from camopt.scene.text_file import excerpt
from camopt.scene.train import build_train

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
        own = build_train(self.scene).parameters
        for tied in self._tied:  # the arrays have to follow every factor in a straight line
            more, most = (build_train(tied.scaled(self.scene, factor)).parameters for factor in (1.5, 2.0))
            if not all(np.allclose(2.0 * more[n], own[n] + most[n], rtol=1e-9, atol=0.0) for n in own):
                raise InputError(f"train: {excerpt(tied.name)} is no number of the train that may vary")

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
        """The numbers that a name means; raises InputError where it means none."""
        numbers = [number for number in matching(self.scene, name) if number.of(self.scene) is not None]
        if not numbers:
            raise no_such_number(self.scene, name, "train")
        return numbers

    def arrays(self, scene: Scene) -> dict[str, np.ndarray]:
        """The arrays of a train by name, each with a first axis (1 + k): its own numbers, and how they change with each
        factor."""
        own = build_train(scene).parameters
        moved = [build_train(tied.scaled(scene, 2.0)).parameters for tied in self._tied]
        return {name: np.stack([array, *(one[name] - array for one in moved)]) for name, array in own.items()}

    def applied(self, arrays: Mapping[str, Any], factors: Any) -> dict[str, Any]:
        """A train's arrays by name, in JAX, with the factors (k) on them; `arrays` as above."""
        shares = jnp.concatenate([jnp.ones(1), jnp.asarray(factors) - 1.0])
        return {name: jnp.tensordot(shares, array, 1) for name, array in arrays.items()}

    def scene_with(self, factors: np.ndarray) -> Scene:
        """The scene with the factors (k) on its numbers."""
        scene = self.scene
        for tied, factor in zip(self._tied, factors, strict=True):
            scene = tied.scaled(scene, float(factor))
        return scene
