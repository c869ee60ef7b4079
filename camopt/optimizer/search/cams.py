"""The cams that a search tried: their judged motions, the feasible ones, and those offered to the verdict.

A cam is called feasible if its limit usage is at most BETWEEN_SHARE at all judged speeds.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np

from camopt.cam.families.free import FreeCam
from camopt.cam.lift import Lift
from camopt.optimizer.search.judge import JUDGED, Judge, Judged, with_speeds_between
from camopt.optimizer.search.region import ExactRows
from camopt.optimizer.stage_clock import StageClock
from camopt.scene.units import DEG, MM
from camopt.storage.journal import StepFiles

if TYPE_CHECKING:
    from camopt.optimizer.candidates import CandidateCam

FOLDER = "judged"
"""Folder of a run in which the judged motions of each step are stored."""
CANDIDATES = 5
"""Largest number of cams that a search offers to the full verdict: the largest feasible ones."""
USES_LESS, APART = 0.02, 5e-4
"""Least difference of limit usage between a cam offered to the verdict and the next larger one, and least difference of
area ratio to all others for the offered cams whose usage is not lower."""
FAR_APART = 1e-2
"""Difference of area ratio between two offered cams above which one between them is offered too, if places are left."""
BETWEEN_SHARE = 0.9
"""Largest limit usage that a cam may have between the speeds at which it was searched."""
RESOLUTION = 5e-5
"""Smallest gain of area ratio that counts in a search: half a unit of the fourth digit, to which areas are stated."""

Cam = TypeVar("Cam", bound="CandidateCam")


@dataclass(frozen=True, eq=False)  # arrays have no single truth value
class Tried:
    """A cam that a search judged: its free coefficients z (m), its area ratio and its judged motions."""

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
        """Whether the valve seats at every speed."""
        return bool(np.all(np.isfinite(self.judged.share)))


@dataclass(kw_only=True)
class CamSearch(Generic[Cam]):
    """The cams that a search accepts, each larger than the one before, and the reports of its steps."""

    journal: StepFiles = field(default_factory=lambda: StepFiles(None, FOLDER))
    show: Callable[[dict], None] = lambda line: None  # receives the journal's line of every step
    held: list[Cam] = field(default_factory=list)
    steps: int = 0

    @property
    def best(self) -> Cam | None:
        """The largest accepted cam."""
        return self.held[-1] if self.held else None

    def note_step(self, cam: Cam, stage: str, details: Mapping[str, object]) -> None:
        """Writes a line on the present step and its cam into the journal, and shows it."""
        line = {
            "iteration": self.steps,
            "stage": stage,
            "area_ratio": cam.area_ratio,
            "area_mm_deg": cam.lift.area / MM / DEG,
            **details,
            "confirmed": self.best is cam,
            "best_area_ratio": self.best.area_ratio if self.best else None,
        }
        self.journal.note(line)
        self.show(line)


@dataclass
class Search(CamSearch[Tried]):
    """The state of a search: the judged cams, and the feasible ones, which it accepts."""

    judge: Judge  # at the program's speeds
    band: Judge | None  # at the program's speeds and between them, in a search for a band
    source: ExactRows
    start: str  # family of the cam from which the search started, or "calmest"
    clock: StageClock = field(default_factory=StageClock)
    seen: list[Tried] = field(default_factory=list)  # all cams that were judged
    confirmed: list[Tried] = field(default_factory=list)  # the cams that are offered to the verdict
    first: Tried | None = None  # the cam of the last program before margins are fed back

    @property
    def course(self) -> dict:
        """A summary of the search, for design.json."""
        source = self.source
        return {
            "source": source.name,
            "start": self.start,
            "rounds": self.steps,
            "jacobians": source.jacobians,
            "seconds": self.clock.spent_s("search"),
        }

    def evaluate(self, stage: str, free: FreeCam, z: np.ndarray, area_ratio: float) -> Tried:
        """Judges the cam of z (m), keeps it if it is feasible and larger than the best one, and reports the step."""
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
        worst = {f"worst_{name}": judged.worst(name) for name in dict.fromkeys(("bounce_mm", *judged.limited))}
        self.note_step(tried, stage, worst | {"worst_share": judged.used, "worst_speed_rpm": judged.worst_speed_rpm})
        return tried

    def between(self, smaller: Tried, larger: Tried, share: float) -> Tried:
        """Judges the cam at this share of the way between two cams; it keeps the limits on the shape, as both do."""
        z = (1 - share) * smaller.z + share * larger.z
        area_ratio = (1 - share) * smaller.area_ratio + share * larger.area_ratio
        return self.evaluate("between two cams", larger.free, z, area_ratio)

    def confirm(self, none_holds: bool = False) -> None:
        """Selects the cams that are offered to the verdict, up to CANDIDATES.

        These are the largest feasible cam and smaller ones with less limit usage, since a cam that is nearly the same
        as a rejected one would be rejected too. The last place, and any that are left, go to the largest other cams
        that differ in area, and then to cams between two whose areas differ much. If `none_holds`, no cam of the
        programs is feasible, and the largest cam that keeps the limits without a reserve is offered too.
        """
        by_area = sorted(self.seen, key=lambda tried: -tried.area_ratio)
        holding = [tried for tried in by_area if tried.judged.used <= BETWEEN_SHARE]
        offered: list[Tried] = []
        for tried in holding:
            if not offered or tried.judged.used < offered[-1].judged.used - USES_LESS:
                offered.append(tried)
        del offered[CANDIDATES - 1 :]
        for tried in holding:
            apart = min(abs(tried.area_ratio - larger.area_ratio) for larger in offered)
            if apart >= APART and len(offered) < CANDIDATES:
                offered.append(tried)
        unreserved = [tried for tried in by_area if tried.judged.share.max(initial=0.0) <= 1.0]
        if not holding:  # cams that keep the limits without a reserve are better than none
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
