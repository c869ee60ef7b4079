"""The search for a cam: linear programs on the paths of tied contacts, whose margins the non-smooth judge feeds back.

From a start the rows of the contact forces and of the gap at the seat are taken about the present cam, a linear program
finds the largest area within a box about it, and its cam is the next one, until little is promised. Then every
program's cam is judged by event-exact, and the margins of each flank at each speed follow what it uses of the limits.
The rows come from one of two sources, which nothing here tells apart: for any law the Jacobian of the smoothed motion
by JAX (`smooth_rows`), or for laws that are straight in pieces the closed periodic response (`exact_rows`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from threadpoolctl import threadpool_limits

from camopt.cam.families.free import FreeCam
from camopt.cam.lift import Lift
from camopt.optimizer.accuracy import Accuracy, design_speeds
from camopt.optimizer.ascent.projection import ShapeLimits
from camopt.optimizer.paths.margins import FedBack, used_by_kind
from camopt.optimizer.paths.region import RowSource, first_region, stepped
from camopt.optimizer.program.force_rows import SpeedRows, Window
from camopt.optimizer.program.kinematic import area_ratio_row
from camopt.optimizer.program.no_jump import NoJumpOptimum, NoJumpProgram
from camopt.optimizer.program.phases import Angles
from camopt.optimizer.program.program_cam import program_cam
from camopt.optimizer.search import search as no_jump
from camopt.optimizer.search.judge import Judge, Judged
from camopt.optimizer.search.none_holds import why_none_holds
from camopt.optimizer.search.search import BETWEEN_SHARE, Logbook, knot_interval_deg
from camopt.scene.design import Design
from camopt.scene.errors import InputError, NoCamFound
from camopt.scene.schema import Scene
from camopt.scene.standing_in import is_linear
from camopt.scene.train import Train, build_train
from camopt.scene.units import DEG, MM

CANDIDATES, USES_LESS = 4, 0.02
"""Cams that are offered to the verdict, and by how much less of its limits each of them uses than the larger one."""
SETTLED_GAIN = 1e-3
"""Promised gain of area ratio below which margins are fed back."""
MOST_FIRST = 20
"""Programs after which margins are fed back in any case."""
RENEWED = (0, 2, 6)
"""Rounds of the feedback after which the rows are taken about the present cam again."""
RENEWED_EVERY = 4
"""The same for trains whose laws are not straight, after so many rounds each."""
BLENDS = 5
"""Cams between the largest one that holds and a larger one that does not, each halving what is left."""


@dataclass
class PathSearch:
    """The state of a search: the confirmed cams, each larger than the one before, and the journal."""

    judge: Judge  # at the program's speeds
    band: Judge  # over the band
    source: RowSource
    log: Logbook
    start: str  # the family of the cam that it began from, or "calmest"
    seen: list[tuple[NoJumpOptimum, Judged]] = field(default_factory=list)  # all that were judged
    held: list[tuple[NoJumpOptimum, float]] = field(default_factory=list)  # each larger than the one before
    confirmed: list[NoJumpOptimum] = field(default_factory=list)  # those of them that hold between the speeds too
    steps: int = 0
    first: NoJumpOptimum | None = None  # the last program's cam before margins are fed back

    @property
    def best_judged(self) -> Judged:
        """What was judged of the largest confirmed cam."""
        return next(judged for found, judged in self.seen if found is self.confirmed[-1])

    @property
    def course(self) -> dict:
        """How it searched, for design.json."""
        source = self.source
        return {
            "source": source.name,
            "start": self.start,
            "rounds": self.steps,
            "jacobians": source.jacobians,
            "seconds": self.log.clock.spent_s("no_jump"),
        }

    @property
    def gradient_ended(self) -> str:
        """What the search took, a sentence for the provenance."""
        return f"The search on {self.source.name} paths: {self.steps} programs, {self.source.jacobians} Jacobians."

    @property
    def best(self) -> NoJumpOptimum | None:
        """The largest cam that holds at the searched speeds."""
        return self.held[-1][0] if self.held else None

    def consider(self, stage: str, found: NoJumpOptimum) -> Judged:
        """Judges a cam, keeps it if it holds and is larger than the best, and reports the step."""
        self.steps += 1
        journal = self.log.journal
        judged = journal.recall(self.steps, found.z)
        if judged is None:
            judged = self.judge(found.lift)
            journal.keep(self.steps, found.z, judged)
        else:
            self.judge.remember(judged)
        self.seen.append((found, judged))
        if judged.share.max(initial=0.0) <= 1.0 and (self.best is None or found.area_ratio > self.best.area_ratio):
            share = float(self.band(found.lift, briefly=True).share.max(initial=0.0))
            if share <= BETWEEN_SHARE:
                self.held.append((found, share))
        line = {
            "iteration": self.steps,
            "stage": stage,
            "area_ratio": found.area_ratio,
            "area_mm_deg": found.lift.area / MM / DEG,
            "worst_bounce_mm": judged.worst("bounce_mm"),
            **{f"worst_{name}": judged.worst(name) for name in judged.limited if name != "bounce_mm"},
            "worst_share": float(judged.share.max()) if judged.share.size else 0.0,
            "worst_speed_rpm": judged.worst_speed_rpm,
            "confirmed": self.best is found,
            "best_area_ratio": self.best.area_ratio if self.best else None,
        }
        journal.note(line)
        self.log.show(line)
        return judged

    def confirm(self, between: Judge | None) -> None:
        """Keeps the cams that hold between the searched speeds too, the largest first, and of smaller ones those that
        use less of their limits: where the verdict refuses a cam, one that is hardly another would be refused too."""
        least = np.inf
        for found, share in self.held[::-1]:
            if share < least - USES_LESS and len(self.confirmed) < CANDIDATES:
                beside = between(found.lift, briefly=True).share.max(initial=0.0) if between else share
                if beside <= BETWEEN_SHARE:
                    least = share
                    self.confirmed.insert(0, found)
        if not self.confirmed:  # no cam that holds is refused for a reserve
            holding = [found for found, judged in self.seen if judged.share.max(initial=0.0) <= 1.0]
            self.confirmed = sorted(holding, key=lambda found: found.area_ratio)[-CANDIDATES:]


def find_cam(
    scene: Scene,
    speeds: str,
    effort: Accuracy,
    gradient: str = "none",
    log: Logbook | None = None,
    start: Lift | None = None,
    seed: int = 0,
) -> tuple[PathSearch | no_jump.Search, NoJumpOptimum]:
    """The search with its confirmed cams, each larger than the one before, and the cam of its first stage.

    With `gradient` "smooth" the search goes along the paths of the smoothed motion; `start` is the cam from which it
    begins, by default the calmest one within the limits on the shape. Otherwise it is `no_jump.find_cam`, which has no
    start. Raises InputError for a start that is not used, and NoCamFound where no cam holds.
    """
    if gradient == "smooth":
        return search_paths(scene, speeds, effort, log=log, start=start, seed=seed)
    if start is not None:
        raise InputError(
            f"a cam to start from with gradient {gradient!r}: only the search on the smoothed motion begins from a "
            f"cam: give gradient 'smooth', or leave the start out"
        )
    return no_jump.find_cam(scene, speeds, effort, gradient, log=log, seed=seed)


@threadpool_limits.wrap(limits=1, user_api="blas")  # the matrices are small, and the judge has threads of its own
def search_paths(
    scene: Scene,
    speeds: str,
    effort: Accuracy,
    source: str = "smooth",
    *,
    log: Logbook | None = None,
    start: Lift | None = None,
    seed: int = 0,
) -> tuple[PathSearch, NoJumpOptimum]:
    """The search on paths, with its rows from the `source` "smooth" or "exact"; arguments are those of `find_cam`."""
    design, operation = scene.design, scene.operation
    assert design is not None and operation is not None, "load_scene(..., need=...) guarantees both"
    log = log or Logbook()
    cam = program_cam(design, knot_interval_deg(effort, seed))
    _, judged_speeds = design_speeds(operation, speeds, effort)
    searched, between = judged_speeds, None
    if speeds == "band":
        searched = np.linspace(judged_speeds[0], judged_speeds[-1], effort.path_speeds)
        between = Judge(scene, 0.5 * (judged_speeds[1:] + judged_speeds[:-1]))
    if source == "smooth":
        import jax.monitoring  # noqa: F401  the clock listens to its compilations
    with log.clock.stage("no_jump"):
        program = without_rows(build_train(scene), design, cam, [scene.cam_speed(speed) for speed in searched])
        rows = _source(source, program)
        begun = "calmest" if start is None else start.family
        search = PathSearch(Judge(scene, searched), Judge(scene, judged_speeds, effort.judge_stride), rows, log, begun)
        program, z = rows.first(program, np.zeros(cam.Z.shape[1]) if start is None else _nearest(cam, design, start))
        _programs(search, rows, program, z, effort.feedback_rounds)
        _blend(search)
        search.confirm(between)
    if not search.confirmed:
        raise NoCamFound(why_none_holds([judged for _, judged in search.seen], program))
    assert search.first is not None
    return search, search.first


def without_rows(train: Train, design: Design, cam: FreeCam, speeds: Sequence[float] | np.ndarray) -> NoJumpProgram:
    """The program at cam speeds [rad/s] before its rows are known, with contacts that switch at the ramp tops."""
    top = float(cam.breaks[-1])
    angles = Angles(-top, -top, top, top)
    nothing = np.zeros((0, cam.Z.shape[1])), np.zeros(0), np.zeros(0, int), np.zeros(0, int), np.zeros(0)
    blocks = tuple(SpeedRows(train, float(speed), angles, *nothing) for speed in speeds)
    return NoJumpProgram(train, design, cam, Window(), blocks)


def _source(name: str, program: NoJumpProgram) -> RowSource:
    """The source of the rows; only the smoothed motion loads JAX."""
    if name == "exact":
        from camopt.optimizer.paths.exact_rows import ExactRows

        return ExactRows()
    from camopt.optimizer.paths.smooth_rows import SmoothRows

    return SmoothRows(program)


def _nearest(cam: FreeCam, design: Design, start: Lift) -> np.ndarray:
    """The coefficients z (m) of the free cam within the limits on the shape whose lift differs least from `start`."""
    limits = ShapeLimits(cam, design)
    return limits.nearest(limits.nearest_to(start))


def _programs(search: PathSearch, source: RowSource, program: NoJumpProgram, z: np.ndarray, rounds: int) -> None:
    """Programs from the cam of z (m) on: with margins of zero until one promises little more area or its cam does not
    settle, then so many rounds whose margins follow what the judged motion uses of the limits.

    A cam whose valve does not seat is the centre of no program where others held.
    """
    row, constant = area_ratio_row(program.design, program.cam)
    region, fed = first_region(program.design), FedBack(np.zeros((3, len(program.blocks))))
    renewed = _due(is_linear(program.train), rounds)
    settled, left = False, rounds
    while left:
        found = stepped(source, program, z, region, fed.margins)
        judged = search.consider("margins fed back" if settled else "path constraints", found)
        seats = bool(np.all(np.isfinite(judged.share))) or not search.held
        gain = abs(found.area_ratio - float(row @ z + constant))
        if not settled:
            search.first = found
            settled = not seats or search.steps >= MOST_FIRST or (gain < SETTLED_GAIN and found.margins.min() >= 0.0)
            due = True
        else:
            due = renewed[rounds - left]
            left -= 1
        if settled:
            fed.follow(used_by_kind(program.train, found.lift, judged, program.speeds))
        if seats:
            z = found.z
            program = source.about(program, z) if due else program


def _due(straight: bool, rounds: int) -> np.ndarray:
    """Whether the rows are taken anew after each round (rounds) of the feedback."""
    numbers = np.arange(rounds)
    return np.isin(numbers, RENEWED) | ((not straight) & (numbers % RENEWED_EVERY == 0))


def _blend(search: PathSearch) -> None:
    """Judges cams between the largest one that holds and a larger one that does not: that with which the limits let
    most area through, if what is used of them grows in proportion."""
    best, held = search.best, {id(found): judged.share.max(initial=0.0) for found, judged in search.seen}
    if best is None:
        return

    def promised(one: tuple[NoJumpOptimum, Judged]) -> float:
        used = one[1].share.max(initial=0.0)
        within = (1.0 - held[id(best)]) / max(used - held[id(best)], 1.0 - held[id(best)])
        return within * (one[0].area_ratio - best.area_ratio)

    beyond = max(search.seen, key=promised)[0]
    if beyond.area_ratio <= best.area_ratio:
        return
    low, high = 0.0, 1.0
    for _ in range(BLENDS):
        share = 0.5 * (low + high)
        z = (1 - share) * best.z + share * beyond.z
        area = (1 - share) * best.area_ratio + share * beyond.area_ratio
        blended = replace(beyond, z=z, area_ratio=area)
        search.consider("between two cams", blended)
        low, high = (share, high) if search.best is blended else (low, share)
