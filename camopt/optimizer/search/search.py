"""The search for a cam: successive linear programs on tied contacts, with margins from the event-exact motion.

The contact forces and the gap at the seat are linearised about the present cam. A linear program then finds the cam of
largest area within a box about the present one, and this cam becomes the next one, until the predicted gain is small.
From then on the margins of each flank at each speed are adapted to the limit usage of every program's cam, which is
judged by event-exact. The rows come from one of two sources with the same interface: the Jacobian of the smoothed
motion by JAX for any law (`smooth_rows`), or the periodic response in closed form (`ExactRows`).
"""

from collections.abc import Callable, Sequence

import numpy as np
from threadpoolctl import threadpool_limits

from camopt.cam.families.free import FreeCam
from camopt.cam.lift import Lift
from camopt.measure.limits import MOTION_LIMITS, MotionLimit
from camopt.optimizer.accuracy import Accuracy, design_speeds
from camopt.optimizer.ascent.projection import ShapeLimits
from camopt.optimizer.program.force_rows import SpeedRows
from camopt.optimizer.program.kinematic import area_ratio_row
from camopt.optimizer.program.no_jump import NoCamHoldsContact, NoJumpProgram
from camopt.optimizer.program.phases import Angles, force_unit
from camopt.optimizer.program.program_cam import program_cam
from camopt.optimizer.search.cams import BETWEEN_SHARE, FOLDER, RESOLUTION, Search, Tried
from camopt.optimizer.search.judge import Judge, Judged
from camopt.optimizer.search.margins import Feedback, first_margins, used_by_kind
from camopt.optimizer.search.region import ExactRows, first_region, solve_step
from camopt.optimizer.stage_clock import StageClock
from camopt.scene.design import Design
from camopt.scene.errors import NoCamFound
from camopt.scene.rest import is_linear
from camopt.scene.schema import Scene
from camopt.scene.smoothing import Smoothing
from camopt.scene.train import Train, build_train
from camopt.storage.journal import StepFiles

KNOT_SPREAD = 0.1
"""Largest relative change of the knot interval by a seed."""
SETTLED_GAIN = 1e-3
"""Predicted gain of area ratio below which the feedback of the margins begins."""
MOST_FIRST = 20
"""Number of programs after which the feedback of the margins begins in any case."""
RENEWED = (0, 2, 6)
"""Rounds of the feedback after which the rows are linearised about the present cam again."""
RENEWED_EVERY = 4
"""Number of rounds after which this also happens each time for trains that are not linear."""
FLOWN = 2.0
"""Limit usage above which a motion has flown off; the size of the usage has no meaning there."""
PARTS = (0.5, 0.25, 0.125)
"""Fractions of the way to a cam whose valve does not seat, tried in turn for the centre of the next program."""
REMEDY = "allow more bounce and jump, raise the spring's preload, or lower the top speed"
BISECTIONS = 5
"""Number of bisections between the largest feasible cam and a larger infeasible one."""


@threadpool_limits.wrap(limits=1, user_api="blas")  # the matrices are small, and the judge has threads of its own
def find_cam(
    scene: Scene,
    speeds: str,
    effort: Accuracy,
    gradient: str = "auto",
    *,
    journal: StepFiles | None = None,
    show: Callable[[dict], None] = lambda line: None,
    clock: StageClock | None = None,
    start: Lift | None = None,
    seed: int = 0,
    smoothing: Smoothing = Smoothing(),  # noqa: B008  it cannot change
) -> Search:
    """Searches the cam of largest area that keeps the scene's limits on the motion; the result has the cams that are
    offered to the verdict in `confirmed`, each larger than the one before.

    `speeds` is "band" or "nominal". With `gradient` "smooth" or "auto" the derivatives are those of the smoothed motion
    by JAX, with "exact" those of the periodic response in closed form, and with "none" the search ends before margins
    are fed back. It starts from the cam within the limits on the shape that is nearest to `start`, by default from the
    calmest one. `smoothing` are the settings of the smoothed motion. A `seed` other than zero changes the knot
    interval. The steps are stored in `journal`, reported by `show` and timed by `clock`. Raises NoCamFound where no cam
    keeps the limits.
    """
    design, operation = scene.required_design, scene.required_operation
    journal, clock = journal or StepFiles(None, FOLDER), clock or StageClock()
    spread = KNOT_SPREAD * float(np.random.default_rng(seed).uniform(-1, 1)) if seed else 0.0
    cam = program_cam(design, effort.knot_deg * (1 + spread))
    searched, band = design_speeds(operation, speeds, effort)
    between = Judge(scene, band, effort.judge_stride, BETWEEN_SHARE) if speeds == "band" else None
    smooth = gradient in ("auto", "smooth")
    if smooth:
        import jax.monitoring  # noqa: F401  the clock records JAX's compilations
    with clock.stage("search"):
        program = without_rows(build_train(scene), design, cam, [scene.cam_speed(speed) for speed in searched])
        if smooth:
            from camopt.optimizer.search.smooth_rows import SmoothRows  # loads JAX

            source: ExactRows = SmoothRows(program, smoothing)
        else:
            source = ExactRows()
        family = start.family if start else "calmest"
        search = Search(Judge(scene, searched), between, source, family, clock, journal=journal, show=show)
        limits = ShapeLimits(cam, design)
        nearest = limits.nearest_to(start) if start else limits.nearest(np.zeros(cam.Z.shape[1]))
        program, z = source.first(program, nearest)
        _solve_programs(search, source, program, z, 0 if gradient == "none" else effort.feedback_rounds)
        if none_holds := search.best is None:  # a cam between the start and those of the programs may be feasible
            row, constant = area_ratio_row(design, cam)
            search.evaluate("start", cam, z, float(row @ z + constant))
        _bisect(search)
        search.confirm(none_holds)
    if not search.confirmed:
        raise NoCamFound(why_none_holds([tried.judged for tried in search.seen], program))
    return search


def without_rows(train: Train, design: Design, cam: FreeCam, speeds: Sequence[float] | np.ndarray) -> NoJumpProgram:
    """The program at cam speeds [rad/s] without force rows yet, with contacts that switch at the ramp tops."""
    top = float(cam.breaks[-1])
    angles = Angles(-top, -top, top, top)
    nothing = np.zeros((0, cam.Z.shape[1])), np.zeros(0), np.zeros(0, int), np.zeros(0, int), np.zeros(0)
    blocks = tuple(SpeedRows(float(speed), angles, *nothing) for speed in speeds)
    return NoJumpProgram(train, design, cam, blocks)


def _solve_programs(search: Search, source: ExactRows, program: NoJumpProgram, z: np.ndarray, rounds: int) -> None:
    """Solves programs from the cam of z (m) on: with the first margins until the predicted gain of area is small, then
    for a number of `rounds` in which the margins are adapted to the limit usage of the judged motion.

    The width of the box is controlled by the errors of the predicted forces: with the first margins by the median over
    the speeds, in the feedback by the largest one, since the motion breaks its limits first at that speed. A cam whose
    valve does not seat does not become the centre of a program if the valve seated with another cam; with the first
    margins a cam on the way to it is the next centre. If a motion flies off although the valve seats, the cause may be
    low margins at other speeds, and all margins move half way back to those of the largest feasible cam. The rows are
    also renewed when the margins' unit grows.
    """
    row, constant = area_ratio_row(program.design, program.cam)
    region, unit, linear = first_region(program.design), force_unit(program.train), is_linear(program.train)
    feedback = Feedback(first_margins(program.design, len(program.blocks), unit), unit)
    settled, number, feasible_margins = False, 0, feedback.margins
    while not settled or number < rounds:
        optimum = solve_step(source, program, z, region, feedback.margins, np.max if settled else np.median)
        stage = "margins fed back" if settled else "path constraints"
        tried = search.evaluate(stage, optimum.program.cam, optimum.z, optimum.area_ratio)
        seats = tried.seats or not any(earlier.seats for earlier in search.seen)
        renew = not settled or number in RENEWED or (not linear and number % RENEWED_EVERY == 0)
        if settled:
            number += 1
        else:
            gain = abs(optimum.area_ratio - float(row @ z + constant))
            search.first = tried
            settled = search.steps >= MOST_FIRST or (gain < SETTLED_GAIN and optimum.margins.min() >= 0.0)
        if search.best is tried:
            feasible_margins = optimum.margins
        if settled and search.best and FLOWN < tried.judged.used < np.inf:
            feedback.go_back(feasible_margins)
        elif settled:
            used = used_by_kind(program.train, tried.lift, tried.judged, program.speeds)
            renew |= feedback.update(used)
        if seats:
            z = optimum.z
            program = source.about(optimum.program, z) if renew else optimum.program
        elif not settled:
            program, z = _between(source, optimum.program, z, optimum.z)


def _between(
    source: ExactRows, program: NoJumpProgram, z: np.ndarray, beyond: np.ndarray
) -> tuple[NoJumpProgram, np.ndarray]:
    """The program about a cam on the way from that of z (m) to a cam `beyond`, whose valve does not seat, and the cam's
    coefficients; the present ones where the motions of all cams that are tried have infinite errors."""
    for fraction in PARTS:
        between = z + fraction * (beyond - z)  # it keeps the limits on the shape, as both cams do
        if np.all(np.isfinite(source.errors_at(program, between))):
            return source.about(program, between), between
    return program, z


def _bisect(search: Search) -> None:
    """Judges cams between the largest feasible one and a larger infeasible one. The larger one is that which gives the
    largest area within the limits if their usage grows in proportion to the area."""
    if search.best is None:
        return
    best, used = search.best, search.best.judged.used

    def promised(tried: Tried) -> float:
        within = (1.0 - used) / max(min(tried.judged.used, FLOWN) - used, 1.0 - used)
        return within * (tried.area_ratio - best.area_ratio)

    beyond, low, high = max(search.seen, key=promised), 0.0, 1.0
    for _ in range(BISECTIONS if beyond.area_ratio > best.area_ratio + RESOLUTION else 0):
        share = 0.5 * (low + high)
        tried = search.between(best, beyond, share)
        low, high = (share, high) if search.best is tried else (low, share)


def why_none_holds(judged: Sequence[Judged], program: NoJumpProgram) -> str:
    """A sentence on the `judged` cams of a program, none of which keeps the limits."""
    nearest = min(judged, key=lambda tried: float(tried.share.max()))
    row, column = np.unravel_index(np.argmax(nearest.share), nearest.share.shape)
    metric = nearest.limited[row]
    key = next(key for key, limited in MOTION_LIMITS.items() if limited == metric)
    value, speed = nearest.figures[metric][column], nearest.speeds_rpm[column]
    limit = MotionLimit(metric, nearest.limit[row])
    if np.isfinite(value):  # the usage may be that of a neighbouring speed
        value += (nearest.share[row, column] - limit.share(value)) / limit.share_slope
    reached = f"{metric} of {value:.3g}" if np.isfinite(value) else f"no {metric}"
    sentence = (
        f"no cam of the no-jump program holds the scene's limits on the motion at the judged speeds: the nearest one "
        f"has {reached} at {speed:.4g} r/min against {key} = {nearest.limit[row]:g}"
    )
    broken = nearest.speeds_rpm[nearest.share.max(axis=0) > 1.0]
    below = nearest.speeds_rpm[nearest.speeds_rpm < broken.min()]
    if below.size:
        sentence += f", and it holds every limit up to {below.max():.4g} r/min"
    return f"{sentence}{_most_force(program)}; {REMEDY}"


def _most_force(program: NoJumpProgram) -> str:
    """A clause with the largest least contact force that a cam of the program can keep, if it is below the design's."""
    required = program.design.contact_force_min_N
    if required is None:
        return ""
    try:
        program.solve((required, required, -required))  # the design's limit does not concern the seat
    except NoCamHoldsContact as short:
        most = required - short.shortfall_N
        if not np.isfinite(most):
            return ""
        return f"; while closed, no cam of the program keeps more than {most:.3g} N on its contacts at all these speeds"
    return ""
