"""The cams that a search tried: what the judge found of them, those that hold, and those that go to the verdict."""

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from camopt.cam.families.free import FreeCam
from camopt.cam.lift import Lift
from camopt.optimizer.search.judge import JUDGED, Judge, Judged, with_speeds_between
from camopt.optimizer.search.region import ExactRows
from camopt.optimizer.stage_clock import StageClock
from camopt.scene.units import DEG, MM
from camopt.storage.journal import StepFiles

FOLDER = "judged"
CANDIDATES = 5
"""Cams of a search, the largest of those that hold, that the full verdict may be asked about."""
USES_LESS, APART = 0.02, 5e-4
"""By how much less of its limits each of the cams that are offered to the verdict uses than the larger one, and by how
much those that use no less differ in area ratio."""
FAR_APART = 1e-2
"""Difference of area ratio between two cams that are offered, where places are left, from which one between them is."""
BETWEEN_SHARE = 0.9
"""Part of every limit on the motion that a cam may use between the speeds at which it was searched."""
RESOLUTION = 5e-5
"""Resolution of the area ratio in a search, half a unit of the fourth digit, to which areas are stated: smaller gains
are ignored."""


@dataclass(frozen=True, eq=False)  # as its arrays have no one answer
class Tried:
    """A cam that a search judged: its free coefficients z (m), its area ratio, what the judge found."""

    free: FreeCam
    z: np.ndarray
    area_ratio: float
    judged: Judged

    @property
    def lift(self) -> Lift:
        """The cam's lift law."""
        return self.free.lift(self.z)

    @property
    def seats(self) -> bool:
        """Whether its valve seats at every speed."""
        return bool(np.all(np.isfinite(self.judged.share)))


@dataclass
class Search:
    """The state of a search: the cams that hold, each larger than the one before, and the journal."""

    judge: Judge  # at the program's speeds
    band: Judge | None  # at these and between them, where the search is for a band
    source: ExactRows
    start: str  # the family of the cam that it began from, or "calmest"
    journal: StepFiles = field(default_factory=lambda: StepFiles(None, FOLDER))
    show: Callable[[dict], None] = lambda line: None  # is told the line of every step
    clock: StageClock = field(default_factory=StageClock)
    seen: list[Tried] = field(default_factory=list)  # all that were judged
    held: list[Tried] = field(default_factory=list)  # each larger than the one before
    confirmed: list[Tried] = field(default_factory=list)  # those that are offered to the verdict
    steps: int = 0
    first: Tried | None = None  # the last program's cam before margins are fed back

    @property
    def best(self) -> Tried | None:
        """The largest cam that holds."""
        return self.held[-1] if self.held else None

    @property
    def course(self) -> dict:
        """How it searched, for design.json."""
        source = self.source
        return {
            "source": source.name,
            "start": self.start,
            "rounds": self.steps,
            "jacobians": source.jacobians,
            "seconds": self.clock.spent_s("search"),
        }

    def evaluate(self, stage: str, free: FreeCam, z: np.ndarray, area_ratio: float) -> Tried:
        """Judges the cam of z (m), keeps it if it holds and is larger than the best, and reports the step."""
        self.steps += 1
        lift, stored = free.lift(z), self.journal.stored(self.steps, z, JUDGED)
        if stored is None:
            judged = self.judge(lift)
            self.journal.store(self.steps, z, judged.arrays)
        else:
            judged = Judged.of_arrays(stored)
            self.judge.remember(judged)
        larger = self.best is None or area_ratio > self.best.area_ratio + RESOLUTION
        if larger and judged.used <= BETWEEN_SHARE and self.band:
            judged = with_speeds_between(judged, self.band(lift))
        tried = Tried(free, z, area_ratio, judged)
        self.seen.append(tried)
        if larger and judged.used <= BETWEEN_SHARE:
            self.held.append(tried)
        line = {
            "iteration": self.steps,
            "stage": stage,
            "area_ratio": area_ratio,
            "area_mm_deg": lift.area / MM / DEG,
            "worst_bounce_mm": judged.worst("bounce_mm"),
            **{f"worst_{name}": judged.worst(name) for name in judged.limited if name != "bounce_mm"},
            "worst_share": judged.used,
            "worst_speed_rpm": judged.worst_speed_rpm,
            "confirmed": self.best is tried,
            "best_area_ratio": self.best.area_ratio if self.best else None,
        }
        self.journal.note(line)
        self.show(line)
        return tried

    def between(self, smaller: Tried, larger: Tried, share: float) -> Tried:
        """The cam at this share of the way between two, which the limits on the shape let through as they do both."""
        z = (1 - share) * smaller.z + share * larger.z
        area_ratio = (1 - share) * smaller.area_ratio + share * larger.area_ratio
        return self.evaluate("between two cams", larger.free, z, area_ratio)

    def confirm(self, none_holds: bool = False) -> None:
        """Offers cams that hold to the verdict, the largest first, and of smaller ones those that use less of their
        limits: where the verdict refuses a cam, one that is hardly another would be refused too. In the last place, and
        in those that are left, stand the largest of the others that differ in area, and then cams between those that
        differ much. Where of the programs' cams `none_holds` the largest that does without a reserve is offered first.
        """
        by_area = sorted(self.seen, key=lambda tried: -tried.area_ratio)
        holding = [tried for tried in by_area if tried.judged.used <= BETWEEN_SHARE]
        offered: list[Tried] = []
        for tried in holding:
            if not offered or tried.judged.used < offered[-1].judged.used - USES_LESS:
                offered.append(tried)
        del offered[CANDIDATES - 1 :]
        for tried in holding:
            apart = min(abs(tried.area_ratio - other.area_ratio) for other in offered)
            if apart >= APART and len(offered) < CANDIDATES:
                offered.append(tried)
        unreserved = [tried for tried in by_area if tried.judged.share.max(initial=0.0) <= 1.0]
        if not holding:  # no cam that holds is refused for a reserve
            offered = unreserved[:CANDIDATES]
        elif none_holds and unreserved[0] not in offered:
            offered = [unreserved[0], *offered][:CANDIDATES]
        self.confirmed = sorted(offered, key=lambda tried: tried.area_ratio)
        while len(self.confirmed) < CANDIDATES:
            pairs = list(pairwise(self.confirmed))
            wide = [pair for pair in pairs if pair[1].area_ratio - pair[0].area_ratio > FAR_APART]
            if not wide:
                return
            tried = self.between(*wide[-1], 0.5)
            if tried.judged.used > BETWEEN_SHARE:
                return
            self.confirmed = sorted([*self.confirmed, tried], key=lambda tried: tried.area_ratio)
