"""The search for a cam, without a run folder around it: the no-jump program and, if asked for, the gradient stage."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from threadpoolctl import threadpool_limits

from camopt.optimizer.accuracy import Accuracy, design_speeds
from camopt.optimizer.program.no_jump import NoJumpOptimum, NoJumpProgram, no_jump_program
from camopt.optimizer.program.program_cam import program_cam
from camopt.optimizer.program.relocation import standing
from camopt.optimizer.search.journal import Journal
from camopt.optimizer.search.judge import Judge
from camopt.optimizer.search.no_jump_stage import Search, margins_apart, no_jump_stage
from camopt.optimizer.search.robust import Perturbation, RobustJudge
from camopt.optimizer.stage_clock import StageClock
from camopt.scene.schema import Scene
from camopt.scene.train import build_train

KNOT_SPREAD = 0.1
"""Share of itself by which a seed may change the knot interval."""
BETWEEN_SHARE = 0.9
"""Part of every limit on the motion that a cam may use between the speeds at which it was searched."""


@dataclass(frozen=True)
class Logbook:
    """What a search leaves behind on its way: the cams it judged, every step it shows, and what its stages cost."""

    journal: Journal = field(default_factory=lambda: Journal(None))
    show: Callable[[dict], None] = lambda line: None
    clock: StageClock = field(default_factory=StageClock)


def knot_interval_deg(effort: Accuracy, seed: int) -> float:
    """Knot interval of the free cam [deg]: that of the accuracy for seed 0, and one drawn about it for other seeds."""
    if seed == 0:
        return effort.knot_deg
    return effort.knot_deg * (1 + KNOT_SPREAD * float(np.random.default_rng(seed).uniform(-1, 1)))


@threadpool_limits.wrap(limits=1, user_api="blas")  # the matrices are small, and the judge has threads of its own
def find_cam(
    scene: Scene,
    speeds: str,
    effort: Accuracy,
    gradient: str = "none",
    *,
    log: Logbook | None = None,
    perturbations: Mapping[str, Perturbation] | None = None,
    seed: int = 0,
) -> tuple[Search, NoJumpOptimum]:
    """The search with the largest cam that the event-exact judge confirms, and the linear program's own best cam.

    `speeds` is "band" or "nominal"; `gradient` is "none", or "exact" or "auto" for a gradient stage along the slopes of
    event-exact. With `perturbations` (by name) the limits on the motion must
    hold under each of them too. `seed` draws the margins and, where it is not zero, the knot interval, which besides
    the limits is all that a search starts from. Raises NoCamFound where no cam holds.
    """
    design, operation = scene.design, scene.operation
    assert design is not None and operation is not None, "load_scene(..., need=...) guarantees both"
    log = log or Logbook()
    cam = program_cam(design, knot_interval_deg(effort, seed))
    program_speeds, judged_speeds = design_speeds(operation, speeds, effort)
    cam_speeds = [scene.cam_speed(s) for s in program_speeds]
    with log.clock.stage("no_jump"):
        program = standing(no_jump_program(build_train(scene), design, cam, cam_speeds))
        judge = Judge(scene, judged_speeds, effort.judge_stride if speeds == "band" else 1)
        if perturbations:
            judge = RobustJudge(judge, perturbations)
            program = _with_perturbed(program, cam_speeds, scene, perturbations)
        search = Search(judge, log.journal, log.show)
        program = no_jump_stage(search, program)
        margins_apart(search, program, effort.margin_draws, seed)
        between = Judge(scene, 0.5 * (judged_speeds[1:] + judged_speeds[:-1])) if speeds == "band" else None
        hold_between(search, between)
    no_jump = search.best
    assert no_jump is not None, "the stage raises where nothing is confirmed"
    if gradient != "none":
        from camopt.optimizer.search.gradient_stage import gradient_stage  # loads the adjoint's programs

        with log.clock.stage("gradient"):
            search.gradient_ended = gradient_stage(search, program, effort.gradient_steps)
            hold_between(search, between)
    return search, no_jump


def _with_perturbed(
    program: NoJumpProgram, cam_speeds: Sequence[float], scene: Scene, perturbations: Mapping[str, Perturbation]
) -> NoJumpProgram:
    """The program with the contact forces of every perturbed train, too, at the cam speeds [rad/s]."""
    for perturbed in perturbations.values():
        if perturbed.scene is not scene:
            program = program.extended(cam_speeds, build_train(perturbed.scene))
    return program


def hold_between(search: Search, between: Judge | None) -> None:
    """Drops confirmed cams, the largest first, that do not hold between the judged speeds of a band.

    Among many drawn cams some hold at just the judged speeds. The last cam stays in any case, and so do all where none
    keeps the reserve at the judged speeds, since the verdict then decides.
    """
    if search.best_judged and not search.best_judged.holds:
        return
    dropped = False
    while between and len(search.confirmed) > 1 and _used(between, search) > BETWEEN_SHARE:
        search.confirmed.pop()
        dropped = True
    if dropped:
        search.best_judged = search.judge(search.confirmed[-1].lift)


def _used(judge: Judge, search: Search) -> float:
    """The largest share of a limit that the largest confirmed cam uses at the judge's speeds."""
    return float(judge(search.confirmed[-1].lift).share.max(initial=0.0))
