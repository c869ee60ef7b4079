"""The search for the cam of largest area that a wanted share of drawn trains holds, without a run folder around it.

Openings that are foretold from tied forces of some trains lead to the neighbourhood of the cam (`openings_program`).
From there slopes of the real motions of more trains lead on (`slopes_program`), at a price of what they use of their
limits. The price follows how many trains fail, at first of these and then of other trains, which shape no cam. The cam
that the latter judge is the mean of the program's last ones, each of which suits the trains of its own rows. The trains
of the final statement are others again. The draws are the same for every cam (common random numbers).
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Protocol

import numpy as np
from threadpoolctl import threadpool_limits

from camopt.exact.kernel.propagators import forget_propagators
from camopt.measure.as_built import TrainAsBuilt, trains_as_built
from camopt.optimizer.accuracy import Accuracy
from camopt.optimizer.as_built.drawn import FOLDER, TrainEnsemble
from camopt.optimizer.as_built.exact_forces import ExactForces
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
from camopt.optimizer.program.no_jump import NoJumpOptimum, NoJumpProgram, no_jump_program
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
"""Knot interval of the free cam. With 3 degrees the first openings program of `kodama` ends at an area ratio of 0.464
in place of 0.469."""
LOW_SPEEDS, HIGH_SPEEDS, NEAR_TOP, CLASSES = 2, 4, 0.93, 4
"""Each train has so many speeds of the band below and above this share of its top, at which most of the trains fail: a
spring's surge meets a harmonic of the cam within a hundredth of a speed. After so many trains the same speeds come
again, and all have the top."""
AT_TOP = 2.0
"""How many times as large the limit on foretold openings is at the top of the band as at the speeds below. At the top
every train is seen, and real openings are smaller than foretold ones; below it each speed has a quarter of the trains.
One limit for all speeds costs `kodama` 0.006 of area ratio at 99 of 100 trains."""
USUAL_JUMP = 0.05 * MM
"""The limit on the jump that stands for one that the design leaves out [m]."""
ROUNDS = 3
"""Programs about one cam after the other where the forces are not the same for all cams."""
FILLING_TRAINS, FILLING_ROUNDS, KEPT_N = 120, 5, 20.0
"""Of trains with an adjuster: for how many openings are foretold, how many programs lead from the calmest cam to that
about which the forces are, and the force [N] that it keeps on their contacts, so that no adjuster fills: the forces of
one that has filled foretell nothing."""
FIRST_MARGIN_N = 40.0
"""Margin of the cam of the train as designed from which the search begins."""
DRAWS_SEED, UNSEEN_SEED = 1_000_003, 2_000_003
"""Added to the seed for the draws that shape the cam and for those that say how large it may be; the draws of the final
statement meet neither."""


class ForceSource(Protocol):
    """Where the forces of drawn trains come from."""

    theta: np.ndarray  # (k) rad, the angles at which they are read
    for_every_cam: bool

    def about(self, z: np.ndarray) -> np.ndarray:
        """Forces (t, s, c, k, 1 + m) [N] in single precision, affine in z (m): right for the cam of z."""
        ...


@threadpool_limits.wrap(limits=1, user_api="blas")  # the matrices are small, and the judge has threads of its own
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
    """The search for the cam of largest area that `wanted` of the trains as built hold over the scene's band.

    `held` of the answer has the cams, each larger than the one before; `seed` draws the trains. Foretold openings are
    those of the closed periodic response or, where laws are curved or `gradient` is "smooth", of the smoothed motion by
    JAX. Raises NoCamFound where no cam holds.
    """
    plain, z = free_program(scene)
    journal = journal or StepFiles(None, FOLDER)
    shaping, unseen = (TrainEnsemble(scene, seed + of) for of in (DRAWS_SEED, UNSEEN_SEED))
    slopes = SlopesProgram(plain, shaping, effort.shaping_trains, journal.beside(SHAPING))
    search = YieldSearch(wanted, slopes, unseen, effort.unseen_trains, journal, show)

    foretold = partial(_by_openings, scene, plain, z, wanted, effort.foretold_trains, gradient, seed)
    level = first_level(search, *foretold())  # whose forces are forgotten here: they take 0.3 GB
    slopes.begin(1.0 - wanted)
    search.along()
    if not search.held:
        largest, z = foretold()
        smaller_cams(search, largest, level, z)
        # where a lift is to be reached, each of two programs reaches it at an angle of its own, and the mean nowhere
        if not plain.design.reach_max_lift:
            search.narrow()
    forget_propagators()  # those of drawn trains take more memory than all that a verdict needs
    return search


def _by_openings(
    scene: Scene, plain: NoJumpProgram, z: np.ndarray, wanted: float, trains: int, gradient: str, seed: int
) -> tuple[LargestCam, np.ndarray]:
    """The largest cam by the level of the limits on the foretold openings of so many drawn `trains`, and the
    coefficients (m) from which its search begins; `plain` has the limits on the shape, z (m) is a first cam."""
    count = min(trains, FILLING_TRAINS) if plain.train.memory else trains
    cam_speeds, drawn = band_speeds(scene), trains_as_built(scene, count, seed=seed + DRAWS_SEED)
    source = _source(gradient, drawn, plain, cam_speeds)
    program = OpeningsProgram(plain, source.theta, cam_speeds, source.about(z))
    limits, lost = opening_limits(scene, cam_speeds), int((1.0 - wanted) * count + 1e-9)
    z, box = _about_its_own_cam(program, source, z, FIRST_LEVEL * limits, lost)
    unit = force_unit(plain.train)

    def largest(level: float, z: np.ndarray) -> NoJumpOptimum:
        program.keep(max(-level, 0.0) * NEWTONS * unit)
        return program.largest(z, max(level, 0.0) * limits, lost, box)

    return largest, z


def free_program(scene: Scene) -> tuple[NoJumpProgram, np.ndarray]:
    """The program of the limits on the shape, and the coefficients (m) of a cam that the train as designed follows; the
    calmest one where an adjuster may fill."""
    design, operation = scene.required_design, scene.required_operation
    speeds = [scene.cam_speed(rpm) for rpm in operation.band_rpm]
    program = converge_tangents(no_jump_program(build_train(scene), design, program_cam(design, KNOT_DEG), speeds))
    margin = FIRST_MARGIN_N * force_unit(program.train)
    z = program.solve_below(np.full((3, len(speeds)), margin)).z
    return program, np.zeros_like(z) if program.train.memory else z


def band_speeds(scene: Scene, low_speeds: int = LOW_SPEEDS, high_speeds: int = HIGH_SPEEDS) -> np.ndarray:
    """Cam speeds of trains (classes, s) [rad/s], so many of the band below and above NEAR_TOP of its top."""
    low, top = scene.required_operation.band_rpm
    near = max(NEAR_TOP * top, low)
    below = np.linspace(low, near, low_speeds * CLASSES, endpoint=False).reshape(low_speeds, CLASSES).T
    above = np.linspace(near, top, high_speeds * CLASSES).reshape(high_speeds, CLASSES).T
    rpm = np.hstack([below, above])
    rpm[:, -1] = top
    return np.array([[scene.cam_speed(speed) for speed in row] for row in rpm])


def opening_limits(scene: Scene, cam_speeds: np.ndarray) -> np.ndarray:
    """The limits on foretold openings at the cam speeds (classes, s) [rad/s] at level one [m]."""
    jump = scene.required_design.jump_max_mm
    limits = np.full(cam_speeds.shape, jump * MM if jump else USUAL_JUMP)
    limits[:, -1] *= AT_TOP
    return limits


def _source(gradient: str, trains: Sequence[TrainAsBuilt], plain: NoJumpProgram, cam_speeds: np.ndarray) -> ForceSource:
    """The source of the forces; only the smoothed motion loads JAX."""
    if gradient != "smooth" and is_linear(plain.train):
        return ExactForces(trains, plain.train, plain.cam, cam_speeds)
    from camopt.optimizer.as_built.smooth_forces import SmoothForces

    return SmoothForces(trains, plain.train, plain.cam, cam_speeds)


def _about_its_own_cam(
    program: OpeningsProgram, source: ForceSource, z: np.ndarray, limits: np.ndarray, lost: int
) -> tuple[np.ndarray, Box | None]:
    """The coefficients (m) of the program's cam under limits (classes, s) [m], about which its forces are, and the box
    in which they are believed; z itself and no box where they are right for every cam.

    Where an adjuster may fill, the cam is one on which contacts keep a force, and the forces are believed everywhere:
    larger cams, some of whose trains fill, are too far from it for a box.
    """
    if source.for_every_cam:
        return z, None
    region, fills = first_region(program.plain.design), bool(program.plain.train.memory)
    program.keep(KEPT_N * force_unit(program.plain.train) if fills else 0.0)
    for _ in range(FILLING_ROUNDS if fills else ROUNDS):
        found = program.largest(z, 0.0 * limits if fills else limits, lost, Box(z, region.width))
        before, foretold = program.tied(z), program.tied(found.z)
        program.about(source.about(found.z))
        missed, moved = (np.abs(program.tied(found.z) - one).max(axis=(2, 3)) for one in (foretold, before))
        region.follow(float(np.median(missed / np.maximum(moved, 1.0))))
        z = found.z
    return z, None if fills else Box(z, region.width)
