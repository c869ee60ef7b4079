"""Rows of the path program from the closed periodic response of a train whose laws are straight in pieces."""

import numpy as np

from camopt.optimizer.program.no_jump import NoJumpProgram, no_jump_program
from camopt.optimizer.program.relocation import relocate, standing


class ExactRows:
    """The rows of a program at its speeds, with contacts that switch where event-exact finds it on a cam."""

    name = "exact"

    def __init__(self) -> None:
        self.jacobians = 0

    def first(self, program: NoJumpProgram, z: np.ndarray) -> tuple[NoJumpProgram, np.ndarray]:
        """The program at the angles of static load transfer; they do not depend on the cam of z (m)."""
        self.jacobians += 1
        return standing(no_jump_program(program.train, program.design, program.cam, program.speeds)), z

    def error_at(self, program: NoJumpProgram, z: np.ndarray) -> float:
        """Zero: the forces are straight in z (m) while contacts switch at the same angles."""
        return 0.0

    def about(self, program: NoJumpProgram, z: np.ndarray) -> NoJumpProgram:
        """The program at the angles of the settled motion of the cam of z (m)."""
        self.jacobians += 1
        return relocate(program, program.cam.lift(z))
