"""Trains as built: train and cam of each engine that leaves the factory, drawn within the scene's tolerances."""

from dataclasses import dataclass

import numpy as np

from camopt.cam.grinding import drawn_waves, ground
from camopt.cam.lift import Lift
from camopt.scene.as_built import GRINDING, deviates, key_of, scene_as_built
from camopt.scene.errors import InputError
from camopt.scene.schema import Scene
from camopt.scene.train import Train, build_train
from camopt.scene.units import UM


@dataclass(frozen=True, repr=False)
class TrainAsBuilt:
    """One drawn train: its number, its scene with the numbers drawn, and its arrays."""

    number: int
    seed: int
    scene: Scene
    train: Train
    draws: dict[str, np.ndarray]
    """By tolerance the draws (k) that made it, in units of what the tolerance states; those of the grinding error are
    the cosine and sine parts of its harmonics."""

    def cam(self, lift: Lift) -> Lift:
        """The lift as it is ground for this train; the lift itself where the scene has no grinding error."""
        grinding = self.scene.grinding
        if grinding is None:
            return lift
        seed = key_of(self.seed, self.number, GRINDING)
        return ground(lift, seed, grinding.error_um * UM, grinding.harmonics)

    def __repr__(self) -> str:
        return f"TrainAsBuilt({self.scene.name}, train {self.number} of seed {self.seed})"


def trains_as_built(scene: Scene, count: int, *, seed: int = 0, first: int = 0) -> list[TrainAsBuilt]:
    """The trains of the numbers `first` to `first` + `count` - 1, drawn within the scene's tolerances.

    Train i hangs on the seed and on i alone, so that a longer list begins with the shorter one; a tolerance that is
    made narrower or left out moves no other draw (common random numbers). `train.train` has the SI arrays (n masses, e
    elements) and `train.cam(lift)` is the cam as it is ground for it. Raises InputError for a count below 1 or a
    negative seed.
    """
    if count < 1 or seed < 0 or first < 0:
        raise InputError(f"trains as built: {count} trains of seed {seed}: expected at least one, and no negative seed")
    return [_train_as_built(scene, seed, i) for i in range(first, first + count)]


def _train_as_built(scene: Scene, seed: int, i: int) -> TrainAsBuilt:
    draws = deviates(scene, seed, i)
    built = scene_as_built(scene, draws)
    if scene.grinding is not None:
        draws[GRINDING] = drawn_waves(key_of(seed, i, GRINDING), scene.grinding.harmonics).parts
    return TrainAsBuilt(i, seed, built, build_train(built), draws)
