"""The cam of largest area that a wanted share of drawn trains holds.

Openings that are foretold from tied forces of one set of trains shape the cam (`openings_program`): the program of
largest area under limits on them, in which as many trains are given up as the yield may lose. How large these limits
may be, as a multiple of the limit on the jump, is sought on another set, whose motions are judged by event-exact: the
train that uses most of its limits of those that may not fail uses all of them. Slopes of real motions may lead on from
there (`slopes_program`), at a price that the same set decides. The final statement asks still others.
The draws are the same for every cam (common random numbers).
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from scipy.special import bdtr

from camopt.cam.lift import Lift
from camopt.highs import Infeasible
from camopt.optimizer.as_built.drawn import FOLDER, MET, TrainEnsemble
from camopt.optimizer.as_built.openings_program import OpeningsProgram
from camopt.optimizer.as_built.slopes_program import CamOfSlopes, SlopesProgram
from camopt.optimizer.program.force_rows import Box
from camopt.optimizer.program.no_jump import NoJumpOptimum
from camopt.scene.errors import NoCamFound
from camopt.scene.units import DEG, MM
from camopt.storage.journal import StepFiles

LEVELS, FIRST_LEVEL, LEVEL_FACTOR, LATER_FACTOR, LEAST_LEVEL = "foretold openings", 0.5, 1.7, 1.2, 0.02
"""What the history calls the steps; the first limit on foretold openings, as a part of that on the jump, the factors
from one to the next until it is between two, where fewer trains have found one the smaller, and the least before zero.
Real openings are a half larger at the median where several masses give way, and many times as large where one mass
does."""
NEWTONS, LOWEST_LEVEL = 100.0, -0.8
"""Levels below zero stand for the force that contacts are to keep [N], as parts of the first; the lowest of them."""
MIDDLE, WORST = 0.2, 10.0
"""Part of the way between two levels that the next one leaves on either side, and the most that a cam counts as using:
a motion that is refused uses infinitely much."""
SLOPES, STEPS, PRICES, FIRST_PRICE = "slopes of motions", 12, 8, 0.012
"""What the history calls steps along slopes, how many of them are at the first price and how many at others, and the
first price times the share of trains that may fail."""
BY_USE, MOST_AT_ONCE = 4.0, 2.0
"""The power of the use of a limit by which the price follows it, and the most by which it changes at once."""
NEAR_ENOUGH = 1e-3
"""Difference of area ratio between a cam that holds and one that does not which ends the bisection."""
FEWER, FEWEST_ALLOWED = 3, 2
"""Part of the trains that say how large the cam may be which say so first, and of how many of them that may fail a
count says something."""
NEAR = 0.8
"""Part of a limit from which on a scout calls everyone."""
SCOUTS, FAR_SCOUTS, MATTERING = 12, 48, 0.25
"""Of the other trains one in so many is judged with every cam, and with the next cam the next ones, at the speeds that
matter: the top of the band, and where more than a quarter as many trains are watched as may fail. At the remaining
speeds it is one in the second number. A train that uses little of a limit with one cam may break it with the next."""
CHANCE = 0.13
"""With this chance, at most, as few trains fail as a cam may spend of those that say how large it may be, where it
holds in no more than the wanted share of all. The rest of the wanted loss is for what a count leaves open, and for the
choice of the largest cam, which favours those that are lucky with these trains: of a thousand, 6 in place of 10 may
fail at 0.99, and 88 in place of 100 at 0.9."""
RESOLUTION = 2e-4
"""Area ratio by which a cam must exceed the best one to take its place."""


@dataclass
class YieldSearch:
    """The state of a search: the trains that say how large a cam may be, and the largest one that enough of them
    hold."""

    drawn: TrainEnsemble
    program: OpeningsProgram
    wanted: float
    journal: StepFiles = field(default_factory=lambda: StepFiles(None, FOLDER))
    show: Callable[[dict], None] = lambda line: None
    held: list[NoJumpOptimum | CamOfSlopes] = field(default_factory=list)  # each larger than the one before
    steps: int = 0
    sloped: int = 0  # trains that shaped a cam by their slopes; those that did so by their forces are the first of them

    @property
    def best(self) -> NoJumpOptimum | CamOfSlopes | None:
        """The largest cam that holds."""
        return self.held[-1] if self.held else None

    @property
    def allowed(self) -> int:
        """Trains of those drawn that may fail with a cam."""
        return self._allowed(len(self.drawn.trains))

    def _allowed(self, count: int) -> int:
        return max(int(np.sum(bdtr(np.arange(count), count, 1.0 - self.wanted) <= CHANCE)) - 1, 0)

    def counts(self, unseen: int) -> list[int]:
        """Numbers of trains that say one after the other how large the cam may be, `unseen` being the last."""
        return [unseen // FEWER, unseen] if self._allowed(unseen // FEWER) >= FEWEST_ALLOWED else [unseen]

    @property
    def trains_drawn(self) -> int:
        """Trains that were drawn so far, those that shaped the cam and the others."""
        return max(len(self.program.forces), self.sloped) + len(self.drawn.trains)

    @property
    def used(self) -> float:
        """What the train that uses most of its limits uses of them with the last cam, apart from those that may fail:
        at most one where enough trains hold. Only trains that come near their limits are judged with every cam."""
        return float(np.sort(self.drawn.worst)[::-1][self.allowed])

    def evaluate(self, found: NoJumpOptimum | CamOfSlopes, stage: str = LEVELS) -> float:
        """Judges a cam, keeps it if it is the largest that enough trains hold, and reports the step; returns `used`."""
        drawn, self.steps = self.drawn, self.steps + 1
        stored = self.journal.stored(self.steps, found.z, MET)
        if stored is not None:
            drawn.take(stored)
        else:
            judged = self._judge(found.lift)
            if self.journal.kept:  # the states of thousands of trains are not copied for nothing
                self.journal.store(self.steps, found.z, drawn.met(judged))
        used = self.used
        if used <= 1.0 and (self.best is None or found.area_ratio > self.best.area_ratio + RESOLUTION):
            self.held.append(found)
        self._report(found, stage, drawn)
        return used

    def _report(self, found: NoJumpOptimum | CamOfSlopes, stage: str, drawn: TrainEnsemble) -> None:
        """Reports a step: its cam, and how many of the trains that were drawn for it fail."""
        line = {
            "iteration": self.steps,
            "stage": stage,
            "area_ratio": found.area_ratio,
            "area_mm_deg": found.lift.area / MM / DEG,
            "trains": len(drawn.trains),
            "failing": drawn.failing,
            "confirmed": self.best is found,
            "best_area_ratio": self.best.area_ratio if self.best else None,
        }
        self.journal.note(line)
        self.show(line)

    def _judge(self, lift: Lift) -> np.ndarray:
        """Judges a cam with the trains that are watched and with scouts, and where a scout falls short with everyone.

        It begins at the top of the band, and ends as soon as too many trains fail. Returns which trains were judged at
        which speeds (t, s: bool).
        """
        drawn, watched, matters = self.drawn, self.drawn.watched, self.drawn.matters(self._mattering)
        turn = (np.arange(len(drawn.trains)) + self.steps)[:, None]
        scouts = ~watched & (turn % np.where(matters, SCOUTS, FAR_SCOUTS) == 0)
        judged = np.zeros_like(watched)
        for begin in (watched.shape[1] - 1, 0):
            asked = (watched | scouts) & ~judged
            asked[:, :begin] = False
            drawn.judge(lift, asked)
            judged |= asked
            if self._too_many_fail(begin):
                break
            short = (scouts & asked & (drawn.used.max(axis=1) > NEAR)).any(axis=0)
            others = short & ~(watched | scouts)
            drawn.judge(lift, others)
            judged |= others
            if self._too_many_fail(begin):
                break
        return judged

    def _too_many_fail(self, begin: int) -> bool:
        """Whether more trains break a limit from the speed of a number on than may fail."""
        return int(np.sum(self.drawn.used[:, :, begin:].max(axis=(1, 2)) > 1.0)) > self.allowed

    @property
    def _mattering(self) -> float:
        """The part of watched trains from which on a speed matters."""
        return MATTERING * (1.0 - self.wanted)

    def ask(self, lift: Lift, count: int) -> None:
        """Draws trains until there are so many. No cam counts as one that holds until it is judged with them."""
        self.drawn.enlarge(lift, count, self._mattering)
        self.held.clear()

    def by_level(
        self,
        z: np.ndarray,
        limits: np.ndarray,
        lost: int,
        level: float,
        box: Box | None = None,
        factor: float = LEVEL_FACTOR,
    ) -> float:
        """Seeks how many times the `limits` (classes, s) [m] foretold openings may be large, to the largest level whose
        cam holds, and returns it.

        It begins at `level`, and goes on by a `factor`; the cam of z (m) is the first from which the program takes its
        rows, and `lost` of its trains are given up. Below zero tied contacts are to keep a force. Raises NoCamFound
        where not even the lowest has a cam that holds.
        """
        low: Level | None = None
        high: Level | None = None
        while True:
            self.program.keep(max(-level, 0.0) * NEWTONS)
            found = self.program.largest(z, max(level, 0.0) * limits, lost, box)
            z, tried = found.z, Level(level, found.area_ratio, self.evaluate(found))
            if tried.used <= 1.0:
                if low is not None and high is None and tried.area_ratio < low.area_ratio + RESOLUTION:
                    return level  # the limits bind no more
                low = tried
            elif level <= LOWEST_LEVEL:
                raise self._none_holds()
            else:
                high = tried
            if low is None:
                level = _below(level, factor)
            elif high is None:
                level *= factor
            elif high.area_ratio - low.area_ratio < NEAR_ENOUGH:
                return low.level
            else:
                level = _between(low, high)

    def along_slopes(self, slopes: SlopesProgram) -> None:
        """Goes on from the largest cam that holds along the slopes of the motions of other trains, and seeks the price
        at which a cam just holds in those that say how large it may be.

        What the train that uses most of its limits of those that may not fail uses of them moves the price. Where a
        program is not solved, the cams that hold so far stand.
        """
        price, self.sloped = FIRST_PRICE / (1.0 - self.wanted), len(slopes.drawn.trains)
        for step in range(STEPS + PRICES):
            try:
                slopes.step(price)
            except (Infeasible, ArithmeticError):
                return
            if step < STEPS:
                self.steps += 1
                self._report(slopes.cam, SLOPES, slopes.drawn)
            else:
                used = self.evaluate(slopes.cam, SLOPES)
                price *= float(np.clip(used**BY_USE, 1 / MOST_AT_ONCE, MOST_AT_ONCE))

    def _none_holds(self) -> NoCamFound:
        drawn = self.drawn
        return NoCamFound(
            f"{100 * self.wanted:g} % of the drawn trains hold no cam that was tried: of {len(drawn.trains)} trains "
            f"{drawn.failing} fail with the smallest one. Ask for a smaller yield, relax the limits on the motion or "
            f"make the tolerances narrower; `camopt yield` says which is to blame"
        )


class Level(NamedTuple):
    """A level of foretold openings, the area ratio of its cam, and what the trains that may not fail use with it."""

    level: float
    area_ratio: float
    used: float


def _between(low: Level, high: Level) -> float:
    """The level between one whose cam holds and one whose cam does not at which, on the line through both, the limits
    are just used up, but no nearer to either than MIDDLE of the way."""
    part = -np.log(low.used) / np.log(min(high.used, WORST) / low.used)
    return low.level + float(np.clip(part, MIDDLE, 1.0 - MIDDLE)) * (high.level - low.level)


def _below(level: float, factor: float) -> float:
    """The next level to try after one whose cam too few trains hold."""
    if level > LEAST_LEVEL:
        return level / factor
    return 0.0 if level > 0.0 else min(2 * level, -LEAST_LEVEL * 2)
