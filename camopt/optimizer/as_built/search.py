"""The search for the cam of largest area with which a wanted share of drawn trains passes.

A train passes if it keeps every limit on the motion at all its speeds, else it fails. The search has two stages. First,
a linear program on openings predicted from tied contact forces finds the neighbourhood of the cam (`openings_program`).
From there, linear programs on gradients of the real motions of more trains improve the cam (`slopes_program`), with a
penalty on the limit usage. The penalty is adapted to the number of failing trains: at first of the trains that shape
the cam, then of unseen trains, which shape no cam. The cam that is judged by the unseen trains is the mean of the
program's last cams, since each of these suits only the trains of its own rows. The final statement uses a third set of
trains. The draws are the same for every cam (common random numbers).
"""

from collections.abc import Callable
from functools import partial

import numpy as np
from threadpoolctl import threadpool_limits

from camopt.exact.kernel.propagators import forget_propagators
from camopt.measure.as_built import trains_as_built
from camopt.optimizer.accuracy import Accuracy
from camopt.optimizer.as_built.drawn import FOLDER, TrainEnsemble
from camopt.optimizer.as_built.exact_forces import exact_forces
from camopt.optimizer.as_built.openings_program import OpeningsProgram
from camopt.optimizer.as_built.slopes_program import SHAPING, SlopesProgram
from camopt.optimizer.as_built.steps import (
    FIRST_LEVEL,
    NEWTONS,
    LargestCam,
    YieldSearch,
    first_level,
    smaller_cams,
)
from camopt.optimizer.program.force_rows import Box
from camopt.optimizer.program.no_jump import NoJumpProgram, no_jump_program
from camopt.optimizer.program.phases import force_unit
from camopt.optimizer.program.program_cam import program_cam
from camopt.optimizer.program.relocation import converge_tangents
from camopt.optimizer.search.region import first_region
from camopt.scene.rest import is_linear
from camopt.scene.schema import Scene
from camopt.scene.train import build_train
from camopt.scene.units import MM
from camopt.storage.journal import StepFiles

KNOT_DEG = 2.5
"""Knot interval of the free cam [deg]. With 3 the first openings program of `kodama` reaches 0.464, not 0.469."""
LOW_SPEEDS, HIGH_SPEEDS, NEAR_TOP, CLASSES = 2, 4, 0.93, 4
"""Number of speeds of a train below and above the fraction NEAR_TOP of the band's top, and number of trains after which
the same speeds recur. Most trains fail near the top; all trains have the top speed. The speeds differ between trains
because resonance of spring surge with a harmonic of the cam is only about one hundredth of a speed wide."""
AT_TOP = 2.0
"""Factor by which the limit on predicted openings is larger at the top of the band than at lower speeds. At the top all
trains are evaluated and real openings are smaller than predicted ones; each lower speed is evaluated for a quarter of
the trains. One limit for all speeds costs `kodama` 0.006 of area ratio at 99 of 100 trains."""
USUAL_JUMP = 0.05 * MM
"""Limit on the jump [m] that is used where the design sets none."""
ROUNDS = 3
"""Number of successive linearisations where the forces are not the same affine function for all cams."""
FILLING_TRAINS, FILLING_ROUNDS, KEPT_N = 120, 5, 20.0
"""Settings for trains with memory, such as an adjuster: the number of trains whose openings are predicted, the number
of programs from the calmest cam to the one about which the forces are linearised, and the contact force [N] which that
cam keeps, so that no adjuster fills with oil: forces with a filled adjuster predict nothing."""
FIRST_MARGIN_N = 40.0
"""Contact force margin [N] of the first cam, which is that of the train as designed."""
DRAWS_SEED, UNSEEN_SEED = 1_000_003, 2_000_003
"""Offsets of the seed for the trains that shape the cam and for the unseen trains that limit its size. The trains of
the final statement are drawn with the seed itself and belong to neither set."""


@threadpool_limits.wrap(limits=1, user_api="blas")  # the matrices are small, and trains are judged in threads
def yield_search(
    scene: Scene,
    wanted: float,
    effort: Accuracy,
    *,
    gradient: str = "auto",
    seed: int = 0,
    journal: StepFiles | None = None,
    show: Callable[[dict], None] = lambda line: None,
) -> YieldSearch:
    """Searches the cam of largest area with which a share `wanted` of the trains as built pass over the scene's band.

    The accepted cams, with which enough trains pass, are in `held` of the result, each larger than the one before;
    `seed` draws the trains. Predicted openings are based on the periodic response in closed form or, where the train is
    not linear or `gradient` is "smooth", on the smoothed motion by JAX. Raises NoCamFound where no cam is accepted.
    """
    plain, z = free_program(scene)
    journal = journal or StepFiles(None, FOLDER)
    shaping, unseen = (TrainEnsemble(scene, seed + of) for of in (DRAWS_SEED, UNSEEN_SEED))
    slopes = SlopesProgram(plain, shaping, effort.shaping_trains, 1.0 - wanted, journal.beside(SHAPING))
    search = YieldSearch(wanted, slopes, unseen, effort.unseen_trains, journal=journal, show=show)

    start_openings = partial(_openings_search, scene, plain, z, wanted, effort.foretold_trains, gradient, seed)
    level = first_level(search, *start_openings())  # the forces, 0.3 GB, are released afterwards
    slopes.set_targets()
    search.follow_gradients()
    if not search.held:
        largest, z = start_openings()
        smaller_cams(search, largest, level, z)
        # where the maximum lift must be reached, two cams may reach it at different angles, and their mean nowhere
        if not plain.design.reach_max_lift:
            search.bisect()
    forget_propagators()  # the propagators of drawn trains take more memory than the whole verdict
    return search


def _openings_search(
    scene: Scene, plain: NoJumpProgram, z: np.ndarray, wanted: float, trains: int, gradient: str, seed: int
) -> tuple[LargestCam, np.ndarray]:
    """The function that finds the largest cam for a level of the limits on predicted openings of drawn trains, and the
    coefficients (m) from which it starts. `plain` has the limits on the shape, z (m) is a first cam."""
    count, unit = min(trains, FILLING_TRAINS) if plain.train.memory else trains, force_unit(plain.train)
    cam_speeds, drawn = band_speeds(scene), trains_as_built(scene, count, seed=seed + DRAWS_SEED)
    limits, lost = opening_limits(scene, cam_speeds), int((1.0 - wanted) * count + 1e-9)
    if gradient != "smooth" and is_linear(plain.train):
        theta, forces = exact_forces(drawn, plain.train, plain.cam, cam_speeds)
        program, box = OpeningsProgram(plain, theta, cam_speeds, forces), None
    else:
        from camopt.optimizer.as_built.smooth_forces import SmoothForces  # loads JAX

        source = SmoothForces(drawn, plain.train, plain.cam, cam_speeds)
        program = OpeningsProgram(plain, source.theta, cam_speeds, source.about(z))
        z, box = _about_its_own_cam(program, source.about, z, FIRST_LEVEL * limits, lost)

    def largest(level: float, z: np.ndarray) -> np.ndarray:
        program.require_force(max(-level, 0.0) * NEWTONS * unit)
        return program.largest(z, max(level, 0.0) * limits, lost, box).z

    return largest, z


def free_program(scene: Scene) -> tuple[NoJumpProgram, np.ndarray]:
    """The program with the limits on the shape, and the coefficients (m) of a cam with which the train as designed
    keeps contact; for a train with memory, whose adjuster may fill, those of the calmest cam, zero."""
    design, operation = scene.required_design, scene.required_operation
    speeds = [scene.cam_speed(rpm) for rpm in operation.band_rpm]
    program = converge_tangents(no_jump_program(build_train(scene), design, program_cam(design, KNOT_DEG), speeds))
    margin = FIRST_MARGIN_N * force_unit(program.train)
    z = program.solve_below(np.full((3, len(speeds)), margin)).z
    return program, np.zeros_like(z) if program.train.memory else z


def band_speeds(scene: Scene, low_speeds: int = LOW_SPEEDS, high_speeds: int = HIGH_SPEEDS) -> np.ndarray:
    """Cam speeds (classes, s) [rad/s]: for each class `low_speeds` below NEAR_TOP of the top, `high_speeds` above."""
    low, top = scene.required_operation.band_rpm
    near = max(NEAR_TOP * top, low)
    below = np.linspace(low, near, low_speeds * CLASSES, endpoint=False).reshape(low_speeds, CLASSES).T
    above = np.linspace(near, top, high_speeds * CLASSES).reshape(high_speeds, CLASSES).T
    rpm = np.hstack([below, above])
    rpm[:, -1] = top
    return np.array([[scene.cam_speed(speed) for speed in row] for row in rpm])


def opening_limits(scene: Scene, cam_speeds: np.ndarray) -> np.ndarray:
    """Limits on predicted openings [m] at level one, at the cam speeds (classes, s) [rad/s]."""
    jump = scene.required_design.jump_max_mm
    limits = np.full(cam_speeds.shape, jump * MM if jump else USUAL_JUMP)
    limits[:, -1] *= AT_TOP
    return limits


def _about_its_own_cam(
    program: OpeningsProgram,
    forces_about: Callable[[np.ndarray], np.ndarray],
    z: np.ndarray,
    limits: np.ndarray,
    lost: int,
) -> tuple[np.ndarray, Box | None]:
    """The coefficients (m) of the program's cam under limits (classes, s) [m], with its forces linearised about this
    cam, and the trust region (a box) of the linearisation.

    Where an adjuster may fill, this is a cam with which all contacts keep a force. There is no box then: larger cams,
    with which some adjusters fill, would lie outside it.
    """
    region, fills = first_region(program.plain.design), bool(program.plain.train.memory)
    program.require_force(KEPT_N * force_unit(program.plain.train) if fills else 0.0)
    for _ in range(FILLING_ROUNDS if fills else ROUNDS):
        optimum = program.largest(z, 0.0 * limits if fills else limits, lost, Box(z, region.width))
        before, predicted = program.tied_forces(z), program.tied_forces(optimum.z)
        program.replace_forces(forces_about(optimum.z))
        missed, moved = (
            np.abs(program.tied_forces(optimum.z) - forces).max(axis=(2, 3)) for forces in (predicted, before)
        )
        region.update(float(np.median(missed / np.maximum(moved, 1.0))))
        z = optimum.z
    return z, None if fills else Box(z, region.width)
