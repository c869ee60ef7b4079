"""The cams that a search tried: what the judge found of them, those that hold, and those that go to the verdict."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from camopt.optimizer.program.no_jump import NoJumpOptimum
from camopt.optimizer.search.journal import Journal
from camopt.optimizer.search.judge import Judge, Judged, with_speeds_between
from camopt.optimizer.search.region import RowSource
from camopt.optimizer.stage_clock import StageClock
from camopt.scene.units import DEG, MM

CANDIDATES, USES_LESS = 4, 0.02
"""Cams that are offered to the verdict, and by how much less of its limits each of them uses than the larger one."""
BETWEEN_SHARE = 0.9
"""Part of every limit on the motion that a cam may use between the speeds at which it was searched."""
RESOLUTION = 5e-5
"""Area ratio below which a search tells no two cams apart: half a unit of the fourth digit, to which areas are
stated."""


@dataclass(frozen=True)
class Logbook:
    """What a search leaves behind on its way: the cams it judged, every step it shows, and what its stages cost."""

    journal: Journal = field(default_factory=lambda: Journal(None))
    show: Callable[[dict], None] = lambda line: None
    clock: StageClock = field(default_factory=StageClock)


@dataclass
class Search:
    """The state of a search: the cams that hold, each larger than the one before, and the journal."""

    judge: Judge  # at the program's speeds
    band: Judge | None  # at these and between them, where the search is for a band
    source: RowSource
    log: Logbook
    start: str  # the family of the cam that it began from, or "calmest"
    seen: list[tuple[NoJumpOptimum, Judged]] = field(default_factory=list)  # all that were judged
    held: list[tuple[NoJumpOptimum, Judged]] = field(default_factory=list)  # each larger than the one before
    confirmed: list[NoJumpOptimum] = field(default_factory=list)  # those that are offered to the verdict
    steps: int = 0
    first: NoJumpOptimum | None = None  # the last program's cam before margins are fed back

    @property
    def best(self) -> NoJumpOptimum | None:
        """The largest cam that holds."""
        return self.held[-1][0] if self.held else None

    @property
    def best_judged(self) -> Judged:
        """What was judged of the largest cam that is offered to the verdict."""
        return next(judged for found, judged in [*self.held, *self.seen] if found is self.confirmed[-1])

    @property
    def course(self) -> dict:
        """How it searched, for design.json."""
        source = self.source
        return {
            "source": source.name,
            "start": self.start,
            "rounds": self.steps,
            "jacobians": source.jacobians,
            "seconds": self.log.clock.spent_s("search"),
        }

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
        larger = self.best is None or found.area_ratio > self.best.area_ratio + RESOLUTION
        if larger and judged.used <= BETWEEN_SHARE and self.band:
            judged = with_speeds_between(judged, self.band(found.lift))
        self.seen.append((found, judged))
        if larger and judged.used <= BETWEEN_SHARE:
            self.held.append((found, judged))
        line = {
            "iteration": self.steps,
            "stage": stage,
            "area_ratio": found.area_ratio,
            "area_mm_deg": found.lift.area / MM / DEG,
            "worst_bounce_mm": judged.worst("bounce_mm"),
            **{f"worst_{name}": judged.worst(name) for name in judged.limited if name != "bounce_mm"},
            "worst_share": judged.used,
            "worst_speed_rpm": judged.worst_speed_rpm,
            "confirmed": self.best is found,
            "best_area_ratio": self.best.area_ratio if self.best else None,
        }
        journal.note(line)
        self.log.show(line)
        return judged

    def confirm(self) -> None:
        """Offers the cams that hold to the verdict, the largest first, and of smaller ones those that use less of their
        limits: where the verdict refuses a cam, one that is hardly another would be refused too."""
        least = np.inf
        for found, judged in self.held[::-1]:
            if judged.used < least - USES_LESS and len(self.confirmed) < CANDIDATES:
                least = judged.used
                self.confirmed.insert(0, found)
        if not self.confirmed:  # no cam that holds is refused for a reserve
            holding = [found for found, judged in self.seen if judged.share.max(initial=0.0) <= 1.0]
            self.confirmed = sorted(holding, key=lambda found: found.area_ratio)[-CANDIDATES:]
