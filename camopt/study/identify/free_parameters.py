"""Parameters of a train that a fit may move, under the scene's own names.

Each is expressed by the logarithm of a factor on its start value. The logarithm keeps masses, stiffnesses and dampings
positive, and gives a change by one unit the same meaning for every parameter.
"""

from collections.abc import Sequence

import numpy as np

from camopt.exact.adjoint.motion import ByTrain
from camopt.scene.errors import InputError
from camopt.scene.parameters import Tied, matching, no_such_number
from camopt.scene.schema import Scene
from camopt.scene.train import Train, build_train

DIFFERENCE = 1e-6
"""Step in a logarithm with which the numbers of a train are differentiated: most are products of the factors, and the
rows of an adjuster's plunger are quotients, so that truncation and rounding stay below 1e-9 of them."""


class FreeParameters:
    """The free parameters (p) of a scene; a point of the fit is `logs` (p), the logarithms of their factors."""

    def __init__(self, scene: Scene, free: Sequence[str]):
        """Finds the parameters named in `free` (p), each as `<name>.<key>`, such as `valve.mass_kg`.

        A `*` in a name ties all that match and are not zero to one factor (`coil_*.damping_N_s_per_m`). Raises
        InputError for a name that matches nothing, matches zeros only, matches both masses and elements, or matches
        what another name has matched.
        """
        self.scene, self.train = scene, build_train(scene)
        self.tied: list[Tied] = []
        for name in free:
            if not (matched := matching(scene, name)):
                raise no_such_number(scene, name, "identify")
            numbers = tuple(number for number in matched if number.of(scene))  # a factor leaves zero as it is
            if not numbers:
                raise InputError(
                    f"identify: {name}: the fit starts at the scene's value, and that is 0 or none: set it"
                )
            if len({number.table for number in numbers}) > 1:
                raise InputError(f"identify: {name}: masses and elements both match: name them apart")
            self.tied.append(Tied(name, numbers))
        taken = [number for tied in self.tied for number in tied.numbers]
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
        scene = self.scene
        for tied, log in zip(self.tied, logs, strict=True):
            scene = tied.scaled(scene, float(np.exp(log)))
        return scene
