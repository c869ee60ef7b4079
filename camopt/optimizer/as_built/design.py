"""The search for yield of a scene, without a run folder around it."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from camopt.optimizer.as_built.drawn import DrawnTrains
from camopt.optimizer.as_built.journal import TrainsLog
from camopt.optimizer.as_built.search import FIRST_MARGIN_N, FIRST_STEP_N, MORE_STEP_N, OVERSPEED, YieldSearch
from camopt.optimizer.program.no_jump import NoJumpProgram, no_jump_program
from camopt.optimizer.program.program_cam import program_cam
from camopt.optimizer.program.relocation import relocate, standing
from camopt.scene.errors import NoCamFound
from camopt.scene.schema import Scene
from camopt.scene.train import build_train

KNOT_DEG = 2.5
"""Knot interval of the free cam. Finer ones let the program answer the train as designed with ripples of its own
frequency, which no other train shares, and coarser ones lack what a closing flank needs."""
BAND_SPEEDS, NEAR_TOP = 7, (0.943, 0.964, 0.986, 1.0)
"""Speeds of the program within the band, equally spaced, and in place of its two highest ones these shares of the top,
at which most of the drawn trains fail: a spring's surge meets a harmonic of the cam within a hundredth of a speed."""
DRAWS_SEED, UNSEEN_SEED = 1_000_003, 2_000_003
"""Added to the seed for the draws that shape the cam and for those that say how large it may be; the draws of the final
statement meet neither."""


@dataclass(frozen=True)
class YieldEffort:
    """How many trains find the common margin, how many of those that shape the cam may fail, how many cams move groups
    of margins, the steps along slopes, the trains that say how large the cam may be, the final statement.

    Few trains are enough to come near the common margin. Then as many are drawn as it takes for `failing` of them to
    fail under the yield that is wanted: there are dozens of margins, and their cam suits the failing trains that the
    search knows, if they are few, better than all the others.
    """

    trains: int
    failing: int
    moves: int
    steps: int
    unseen: int
    stated_trains: int
    stated_speeds: int

    def trains_for(self, wanted: float) -> int:
        """How many trains the steps know for a yield."""
        return max(self.trains, round(self.failing / (1.0 - wanted)))


EFFORTS = {
    "draft": YieldEffort(100, 0, 0, 8, 400, 1000, 11),
    "standard": YieldEffort(300, 20, 24, 14, 4000, 1000, 21),
    "fine": YieldEffort(500, 40, 60, 20, 8000, 2000, 41),
}


@threadpool_limits.wrap(limits=1, user_api="blas")  # the matrices are small, and the judge has threads of its own
def yield_search(
    scene: Scene,
    wanted: float,
    effort: YieldEffort,
    *,
    gradient: bool = True,
    seed: int = 0,
    log: TrainsLog | None = None,
    show: Callable[[dict], None] = lambda line: None,
) -> YieldSearch:
    """The search for the cam of largest area that `wanted` of the trains as built hold over the scene's band.

    `held` of the answer has the cams, each larger than the one before, `without_gradients` the largest one for which
    nothing was differentiated; `seed` draws the trains. Raises NoCamFound where no cam holds.
    """
    drawn = DrawnTrains(scene, seed + DRAWS_SEED)
    search = YieldSearch(drawn, _program(scene), wanted, log or TrainsLog(None), show)
    first = search.first_cam()
    drawn.settle(first.lift)
    drawn.draw(effort.trains)
    cam = search.lowest(first.margins, FIRST_STEP_N)
    if effort.trains_for(wanted) > effort.trains:
        search.more_trains(effort.trains_for(wanted))
        cam = search.lowest(cam.margins, MORE_STEP_N)
    plain = search.by_groups(cam, effort.moves)
    cam = search.by_slopes(plain, effort.steps) if gradient else plain
    search.ask_unseen(DrawnTrains(scene, seed + UNSEEN_SEED), effort.unseen)
    search.without_gradients = search.lowest(plain.margins, MORE_STEP_N)
    if cam is not plain:
        with suppress(NoCamFound):  # where too few of the unseen trains hold it, the cam without gradients stands
            search.lowest(cam.margins, MORE_STEP_N)
    return search


def _program(scene: Scene) -> NoJumpProgram:
    """The no-jump program of the train as designed over the band and a little beyond, at the angles of its own cam."""
    design, operation = scene.design, scene.operation
    assert design is not None and operation is not None, "load_scene(..., need=...) guarantees both"
    low, high = operation.band_rpm
    coarse = np.linspace(low, high, BAND_SPEEDS)[:-2]
    fine = high * np.array([*NEAR_TOP, *OVERSPEED])
    cam_speeds = [scene.cam_speed(speed) for speed in (*coarse, *fine[fine > coarse[-1]])]
    program = standing(no_jump_program(build_train(scene), design, program_cam(design, KNOT_DEG), cam_speeds))
    return relocate(program, program.solve_below(np.full((3, len(cam_speeds)), FIRST_MARGIN_N)).lift)
