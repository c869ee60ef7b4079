"""The cam of largest area of an edited scene, by the linear programs with which the optimiser's search begins.

Where only the values of limits change, a program's rows are kept and the solver starts from its last basis. Where the
train, the duration or the ramps change, the rows are built again: coarsely spaced while the user drags a slider,
completely once it rests. Limits on the cam's radii under a roller or pad need a sequence of programs and are therefore
applied only once the slider rests.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from camopt.cam.families.free import FreeCam, free_cam
from camopt.cam.lift import Lift
from camopt.cam.linear_limits import radii_held_near
from camopt.designer.controls import KINEMATIC, NO_JUMP
from camopt.highs import Infeasible
from camopt.optimizer.program.force_rows import PEAK
from camopt.optimizer.program.kinematic import kinematic_optimum, sensitivities
from camopt.optimizer.program.no_jump import NoJumpOptimum, NoJumpProgram, no_jump_program
from camopt.optimizer.program.program_cam import program_cam
from camopt.optimizer.program.relocation import converge_tangents
from camopt.scene import InputError, Scene, Train
from camopt.scene.design import Design
from camopt.scene.rest import is_linear
from camopt.scene.units import DEG

KNOT_DEG = 3.0
"""Knot interval of the page's cams [deg]: coarser than in any job, for an answer while the user drags."""
BAND_SPEEDS = 5
"""Number of speeds of the program over the band: few, because the answer must come while the user drags."""
COARSE_STEP = 1.5 * DEG
"""Angle between the rows while the user drags [rad]."""
CONTRADICTION = "no cam keeps all of these limits: loosen one"
"""Sentence on infeasible limits. The diagnosis takes seconds: `camopt.designer.slow_parts.why_none`."""
RAMPS = ("ramp_height_mm", "ramp_velocity_mm_per_deg", "ramp_foot_deg")
GEOMETRY = ("duration_deg", *RAMPS, *(f"closing_{key}" for key in RAMPS[:2]))
"""Keys of the design on which the left-hand sides of all rows depend."""


class Cancelled(Exception):
    """There is no answer: a newer request has come in, or the computing process was stopped."""


@dataclass(frozen=True)
class ProgramCam:
    """A cam and the program of which it is the solution; `says` is the reason where another program was requested."""

    lift: Lift
    program: str
    area_ratio: float
    worth: dict[str, float]
    margin_price: float | None  # d area ratio / d margin [1/N], of all margins together
    coarse: bool
    says: str = ""


@dataclass
class CamFinder:
    """The cams of one designer's edited scenes; the last programs are kept for the next request."""

    programs: dict[bool, tuple[tuple, NoJumpProgram]] = field(default_factory=dict)  # by whether they are coarse

    def largest(self, scene: Scene, train: Train, margin_N: float | None, coarse: bool) -> ProgramCam:
        """The cam of largest area under the scene's limits, by the no-jump program with a margin. It is that of the
        kinematic program where the margin is None, or where no cam keeps contact, which `says` then states. With
        `coarse` the force rows may be coarsely spaced. Raises InputError for limits that contradict each other."""
        if margin_N is None:
            return self._kinematic(scene, coarse)
        try:
            return self._no_jump(scene, train, margin_N, coarse)
        except InputError as error:
            return self._kinematic(scene, coarse, f"No cam keeps contact, so this is the kinematic one: {error}.")

    def _kinematic(self, scene: Scene, coarse: bool, says: str = "") -> ProgramCam:
        design = scene.required_design
        try:
            optimum = kinematic_optimum(design, free_cam(design, KNOT_DEG) if coarse else _cam(design), explain=False)
        except Infeasible:
            raise InputError(CONTRADICTION) from None
        coarse = coarse and bool(radii_held_near(design))
        return ProgramCam(optimum.lift, KINEMATIC, optimum.area_ratio, optimum.sensitivities, None, coarse, says)

    def _no_jump(self, scene: Scene, train: Train, margin_N: float, coarse: bool) -> ProgramCam:
        shape = _shape(scene, train)
        takes_a_sequence = bool(radii_held_near(scene.required_design)) or not is_linear(train)
        if coarse and self.programs.get(False, (None,))[0] == shape:  # the complete rows exist already
            coarse = takes_a_sequence
        program = self._program(scene, train, shape, coarse)
        if not coarse and takes_a_sequence:
            program = converge_tangents(program, margin_N, quick=True)
        try:
            optimum = program.solve(margin_N, explain=False)
        except Infeasible:
            raise InputError(
                f"no free cam keeps {margin_N:g} N at all of the program's speeds: lower the margin or the speeds"
            ) from None
        self.programs[coarse] = shape, program
        price = float(optimum.margin_prices.sum())
        return ProgramCam(optimum.lift, NO_JUMP, optimum.area_ratio, _worth(optimum), price, coarse)

    def _program(self, scene: Scene, train: Train, shape: tuple, coarse: bool) -> NoJumpProgram:
        """The program of a scene; it keeps the rows of the last one where only values of limits have changed."""
        design, (last_shape, program) = scene.required_design, self.programs.get(coarse, ((), None))
        if program is not None and last_shape == shape and is_linear(train):
            held = program.cam.about.near is not None
            return replace(program, design=design, cam=_cam(design)) if held else program.under(design)
        speeds, step = program_speeds_rpm(scene), {"step": COARSE_STEP} if coarse else {}
        cam = free_cam(design, KNOT_DEG) if coarse else _cam(design)
        return no_jump_program(train, design, cam, [scene.cam_speed(s) for s in speeds], **step)


def _cam(design: Design) -> FreeCam:
    """The free cam of the programs at rest; limits on radii are linearised about the cam of largest area under them."""
    return (program_cam if radii_held_near(design) else free_cam)(design, KNOT_DEG)


def program_speeds_rpm(scene: Scene) -> np.ndarray:
    """Crankshaft speeds [r/min] at which the program keeps contact."""
    return np.linspace(*scene.required_operation.band_rpm, BAND_SPEEDS)


def _shape(scene: Scene, train: Train) -> tuple:
    """Key of everything on which the left-hand sides of a program's force rows depend; trains differ by identity."""
    design, operation = scene.required_design, scene.required_operation
    limited = design.contact_force_max_N is not None
    return (id(train), *(getattr(design, key) for key in GEOMETRY), limited, operation)


def _worth(optimum: NoJumpOptimum) -> dict[str, float]:
    """Percentage gain of area for one per cent more of each limit on the shape and of the largest contact force."""
    program, duals = optimum.program, optimum.optimum.duals
    first, forces = len(program.limits.bound), len(program.kind)
    worth = sensitivities(program.limits, duals, duals[first + forces :], optimum.area_ratio)
    most = program.design.contact_force_max_N
    if most is not None:
        peak = program.kind == PEAK
        worth["contact_force_max_N"] = float(duals[first : first + forces][peak].sum() * most / optimum.area_ratio)
    return worth
