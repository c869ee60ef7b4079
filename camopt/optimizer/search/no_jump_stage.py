"""From the no-jump linear program to a cam that the non-smooth judge confirms: angles, speeds and one common margin."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from camopt.optimizer.program.force_rows import Margins
from camopt.optimizer.program.no_jump import NoCamHoldsContact, NoJumpOptimum, NoJumpProgram
from camopt.optimizer.program.relocation import relocate
from camopt.optimizer.search.journal import Journal
from camopt.optimizer.search.judge import Judge, Judged
from camopt.optimizer.search.none_holds import REMEDY, why_none_holds
from camopt.optimizer.search.robust import RobustJudge
from camopt.scene.design import Design
from camopt.scene.errors import NoCamFound
from camopt.scene.units import DEG, MM

FIRST_MARGINS_N = (0.0, 20.0, 60.0, 150.0)
"""Common margins that are tried in turn until one is confirmed; on the reference train 0 N usually is."""
ASKED_TIMES = (1.25, 1.6)
"""Multiples of the design's own least force that are tried after them: a search asks for 1.2 times that force."""
FIRST_STEP_N = 20.0
"""First step down from a confirmed common margin of zero; the step is kept until a cam fails, then halved."""
RELOCATIONS = 2
BISECTIONS = 5
FIRST_SPREAD_N, GROWTH, SHRINKAGE = 15.0, 1.3, 0.95
"""The margins drawn apart have this standard deviation at first. It is multiplied by the second number after a better
cam and by the third after a refused one; one better cam in six keeps it, much as in Rechenberg's (1973) one-fifth
rule."""
LEARNING = 0.2
"""Weight that a step which led to a better cam gets in the shape of the further steps."""
RESOLUTION = 5e-5
"""Area ratio below which the search tells no two cams apart: half a unit of the fourth digit, to which areas are
stated. Knots drawn by another seed move the best confirmed cam by sixteen times that (`experiments.gradient_value`)."""
DRAWS_PER_CAM = 4
"""Largest number of draws per judged cam: half of the draws have no more area than the best cam and end there."""


@dataclass
class Search:
    """The state of a search: the best confirmed cam and the journal. Every step is reported to `show`."""

    judge: Judge | RobustJudge
    journal: Journal
    show: Callable[[dict], None] = lambda line: None
    confirmed: list[NoJumpOptimum] = field(default_factory=list)  # each larger than the one before
    best_judged: Judged | None = None
    steps: int = 0
    course: dict = field(default_factory=dict)  # how it searched, of a search on paths
    gradient_ended: str = ""  # on what path the gradient stage went, and where it ended

    @property
    def best(self) -> NoJumpOptimum | None:
        """The largest confirmed cam."""
        return self.confirmed[-1] if self.confirmed else None

    def take_without_reserve(self, seen: Sequence[tuple[NoJumpOptimum, Judged]]) -> None:
        """Confirms those of the judged cams that hold their limits, each larger than the one before: no cam that holds
        is refused for a reserve where none keeps it."""
        for found, judged in sorted(seen, key=lambda one: one[0].area_ratio):
            if judged.share.max() <= 1.0 and (self.best is None or found.area_ratio > self.best.area_ratio):
                self.confirmed.append(found)
                self.best_judged = judged

    def consider(self, stage: str, found: NoJumpOptimum, briefly: bool = False) -> Judged:
        """Judges a cam, keeps it if it is confirmed and larger than the best, and reports the step.

        With `briefly` only the answer counts, so that a cam that is refused need not be judged at every speed.
        """
        self.steps += 1
        judged = self.journal.recall(self.steps, found.z)
        if judged is None:
            judged = self.judge(found.lift, briefly)
            self.journal.keep(self.steps, found.z, judged)
        else:
            self.judge.remember(judged)
        if judged.holds and (self.best is None or found.area_ratio > self.best.area_ratio):
            self.confirmed.append(found)
            self.best_judged = judged
        line = {
            "iteration": self.steps,
            "stage": stage,
            "area_ratio": found.area_ratio,
            "area_mm_deg": found.lift.area / MM / DEG,
            "worst_bounce_mm": judged.worst("bounce_mm"),
            **{f"worst_{name}": judged.worst(name) for name in judged.limited if name != "bounce_mm"},
            "worst_share": float(judged.share.max()) if judged.share.size else 0.0,
            "worst_speed_rpm": judged.worst_speed_rpm,
            "confirmed": judged.holds,
            "best_area_ratio": self.best.area_ratio if self.best else None,
        }
        self.journal.note(line)
        self.show(line)
        return judged


def no_jump_stage(search: Search, program: NoJumpProgram) -> NoJumpProgram:
    """Finds the largest confirmed cam of one common margin, for `search.best`; returns the program it came from.

    Switching angles are located again on the cam found; they need not settle, because the best confirmed cam counts.
    The worst judged speed is inserted while the cam fails there, and the common margin is bisected to the smallest one
    that is confirmed. Where no cam keeps the judge's reserve, those that hold stand in for it. Raises NoCamFound where
    none holds.
    """
    program, low, high = _first_confirmed(search, program)
    for _ in range(RELOCATIONS):
        assert search.best is not None
        before = search.best
        try:
            moved = relocate(program, before.lift)
            search.consider("re-located angles", moved.solve(Margins(high, high, high)))
        except NoCamHoldsContact:
            break
        if search.best is before:
            break
        program = moved
    for _ in range(BISECTIONS if search.best_judged and search.best_judged.holds else 0):
        middle = 0.5 * (low + high) if np.isfinite(low) else high - FIRST_STEP_N
        judged = search.consider("margin", program.solve(Margins(middle, middle, middle)), briefly=True)
        if judged.holds:
            high = middle
        else:
            low = middle
    return program


def margins_apart(search: Search, program: NoJumpProgram, cams: int, seed: int) -> None:
    """Improves `search.best` by drawing the margins [N] of opening flank, closing flank and seat apart about its own.

    This is an evolution strategy with one parent and one child, whose steps are shaped by those that led on (Igel,
    Suttorp, Hansen 2006, without their path). Whether a cam is confirmed depends on contacts that barely part, which is
    too rough for slopes. At most `cams` are judged; a draw with no more area than the best confirmed cam is not judged.
    """
    assert search.best is not None, "a common margin comes first"
    generator, spread, shape = np.random.default_rng(seed), FIRST_SPREAD_N, np.eye(3)
    centre, last = search.best.margins[:, 0], search.steps + cams  # one common margin so far
    for _ in range(DRAWS_PER_CAM * cams):
        if search.steps == last:
            break
        step = np.linalg.cholesky(shape) @ generator.normal(size=3)
        drawn = centre + spread * step
        try:
            found = program.solve(Margins(*drawn))
        except NoCamHoldsContact:
            spread *= SHRINKAGE
            continue
        if found.area_ratio <= search.best.area_ratio:
            continue
        search.consider("margins apart", found, briefly=True)
        if search.best is found:
            centre, spread = drawn, spread * GROWTH
            shape = (1 - LEARNING) * shape + LEARNING * np.outer(step, step)
        else:
            spread *= SHRINKAGE


def _first_confirmed(search: Search, program: NoJumpProgram) -> tuple[NoJumpProgram, float, float]:
    """The program, with speeds inserted, the common margin [N] tried before, and the first whose cam is confirmed.

    Where none is, they are those of the largest cam that holds without the judge's reserve.
    """
    seen: list[tuple[NoJumpOptimum, Judged]] = []
    for below, level in pairwise((-np.inf, *_first_margins(program.design))):
        try:
            for _ in range(3):
                found = program.solve(Margins(level, level, level))
                judged = search.consider("no-jump program", found)
                if judged.holds:
                    return program, below, level
                seen.append((found, judged))
                worst = search.judge.scene.cam_speed(judged.worst_speed_rpm)
                if np.abs(program.speeds / worst - 1).min() < 1e-3:
                    break
                program = program.extended([worst])
        except NoCamHoldsContact as error:
            if seen:
                break
            raise NoCamFound(f"no confirmed cam was found: {error}; {REMEDY}") from error
    search.take_without_reserve(seen)
    if search.best is None:
        raise NoCamFound(why_none_holds([judged for _, judged in seen], program))
    return search.best.program, -np.inf, float(search.best.margins.max())


def _first_margins(design: Design) -> tuple[float, ...]:
    """FIRST_MARGINS_N, and beyond them what a design asks for itself, with the room that a search leaves."""
    asked = design.contact_force_min_N or 0.0
    return (*FIRST_MARGINS_N, *(f * asked for f in ASKED_TIMES if f * asked > FIRST_MARGINS_N[-1]))
