"""The steps of the search for a yield: from foretold openings along slopes of motions to the largest cam that holds.

The price of what trains use of their limits (`slopes_program`) follows how many trains fail. At the end these are
trains that have not shaped the cam, whose motions event-exact judges until they have settled: as many may fail as
leaves it unlikely that fewer than wanted hold. Of the cams between one that holds and a larger one that does not the
middle is judged, until they are next to each other. The draws are the same for every cam (common random numbers).
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.special import bdtr

from camopt.cam.lift import Lift
from camopt.highs import Infeasible
from camopt.optimizer.as_built.drawn import FOLDER, MET, TrainEnsemble
from camopt.optimizer.as_built.slopes_program import CamOfSlopes, SlopesProgram
from camopt.optimizer.program.no_jump import NoJumpOptimum
from camopt.scene.errors import NoCamFound
from camopt.scene.units import DEG, MM
from camopt.storage.journal import StepFiles

FIRST_LEVEL, LEVEL_FACTOR, LEAST_LEVEL = 0.4, 2.0, 0.02
"""The first limit on foretold openings, as a part of that on the jump, the factor from one to the next, and the one at
which it is halved no more. Real openings are a half larger at the median where several masses give way, and many times
as large where one mass does."""
NEGATIVE_LEVEL, LOWEST_LEVEL, NEWTONS = -0.1, -0.8, 100.0
"""Levels below zero stand for the force that contacts are to keep [N], as parts of the last number: the first and the
last of them."""
FEWEST_FAILING, MOST_FAILING = 0.5, 3.0
"""With the cam from which the slopes lead on between these numbers times as many trains fail as may. Motions of cams
that are far too large have slopes that lead nowhere."""
FORETOLD, SLOPES = "foretold openings", "slopes of motions"
"""What the history calls the steps."""
STEPS, JUDGED = 8, 16
"""Steps along slopes whose price the trains that shape the cam decide, and at most so many whose mean cam unseen ones
judge; those between a cam that holds and one that does not are further ones."""
FIRST_PRICE, BY_FAILING, MOST_AT_ONCE, LEAST_JUDGED = 0.012, 0.25, 2.0, 1.25
"""The first price times the share of trains that may fail, the power of the number of failing trains by which it
changes from one step to the next, the most by which it does, and the least once unseen trains judge: then a cam on the
other side of the one that just holds is all that is looked for."""
IDLE = 6
"""Judged cams in a row of which none is the largest that holds, after which no price leads farther, as where limits on
the shape bind alone. The mean of the last cams follows the price a few steps later."""
SHAPED = 0.7
"""How many times as many of the trains that shape a cam may fail as of others: the cam suits them better."""
NEAR_ENOUGH = 1e-3
"""Difference of area ratio between a cam that holds and one that does not which ends the search: more than twice the
RESOLUTION, so that each cam between the two takes the place of one of them."""
NEAR = 0.8
"""Part of a limit from which on everyone is judged at a speed where a scout uses it."""
SCOUTS, FAR_SCOUTS, MATTERING = 12, 48, 0.25
"""Of the other trains one in so many is judged with every cam, and with the next cam the next ones, at the speeds that
matter: the top of the band, and where more than a quarter as many trains are watched as may fail. At the remaining
speeds it is one in the second number. A train that uses little of a limit with one cam may break it with the next."""
CHANCE = 0.13
"""With this chance, at most, as few trains fail as a cam may spend of those that say how large it may be, where it
holds in no more than the wanted share of all. The rest of the wanted loss is for what a count leaves open, and for the
choice of the largest cam, which favours those that are lucky with these trains: of a thousand, 6 in place of 10 may
fail at 0.99, and 88 in place of 100 at 0.9. Where so many trains are too few for it none may fail, and the chance is
larger: of 1500 at 0.999 it is 0.22."""
RESOLUTION = 2e-4
"""Area ratio by which a cam must exceed the best one to take its place."""

LargestCam = Callable[[float, np.ndarray], NoJumpOptimum]
"""The program's cam by the level of the limits on foretold openings, and by the cam before, of coefficients z (m)."""


@dataclass
class YieldSearch:
    """The state of a search: the trains that say how large a cam may be, and the largest one that enough of them
    hold."""

    wanted: float
    slopes: SlopesProgram
    unseen: TrainEnsemble
    unseen_count: int  # drawn for the first cam to be judged
    journal: StepFiles = field(default_factory=lambda: StepFiles(None, FOLDER))
    show: Callable[[dict], None] = lambda line: None
    held: list[CamOfSlopes | NoJumpOptimum] = field(default_factory=list)  # each larger than the one before
    turned_down: list[tuple[int, CamOfSlopes | NoJumpOptimum]] = field(default_factory=list)  # with which too many fail
    steps: int = 0

    @property
    def best(self) -> CamOfSlopes | NoJumpOptimum | None:
        """The largest cam that holds."""
        return self.held[-1] if self.held else None

    @property
    def refused(self) -> CamOfSlopes | NoJumpOptimum | None:
        """Of the larger cams that do not hold the one with which fewest trains fail, of several the smallest; a smaller
        cam says nothing of larger ones."""
        least = self.best.area_ratio if self.best else 0.0
        larger = [one for one in self.turned_down if one[1].area_ratio > least]
        return min(larger, key=lambda one: (one[0], one[1].area_ratio))[1] if larger else None

    def allowed(self, count: int) -> int:
        """Of so many trains those that may fail with a cam."""
        return max(int(np.sum(bdtr(np.arange(count), count, 1.0 - self.wanted) <= CHANCE)) - 1, 0)

    @property
    def trains_drawn(self) -> int:
        """Trains that were drawn so far, those that shaped the cam and the others."""
        return len(self.slopes.drawn.trains) + len(self.unseen.trains)

    def along(self) -> None:
        """Goes on along slopes and moves their price by how many trains fail, of those that shape the cam and then of
        unseen ones with the mean of the last cams, until a cam holds and a larger one does not; then between these.

        Where a program is not solved, the cams that hold so far stand.
        """
        price, slopes, idle = FIRST_PRICE / (1.0 - self.wanted), self.slopes, 0
        for step in range(STEPS + JUDGED):
            try:
                slopes.step(price, farther=step >= STEPS)  # until there are cams on both sides of the largest
            except (Infeasible, ArithmeticError):
                return
            if step < STEPS:
                drawn, fewer, failing = slopes.drawn, SHAPED, slopes.drawn.failing
                self.report(slopes.cam, SLOPES, drawn, failing)
            else:
                best, drawn, fewer, failing = self.best, self.unseen, 1.0, self.evaluate(slopes.mean, SLOPES)
                if self.best and self.refused:
                    return self.narrow()
                idle = idle + 1 if best and self.best is best else 0
                if idle == IDLE:
                    return
            may_fail, least = fewer * self.allowed(len(drawn.trains)), 1.0 if step < STEPS else LEAST_JUDGED
            change = BY_FAILING * abs(np.log((failing + 1) / (may_fail + 1)))
            change = float(np.exp(np.clip(change, np.log(least), np.log(MOST_AT_ONCE))))
            price *= change if failing > may_fail else 1.0 / change

    def narrow(self) -> None:
        """Judges cams between the largest that holds and a larger one that does not, whose means keep all limits on the
        shape, until they are next to each other."""
        refused = self.refused
        while self.best and refused and refused.area_ratio > self.best.area_ratio + NEAR_ENOUGH:
            middle = self.slopes.cam_of(0.5 * (self.best.z + refused.z))
            self.evaluate(middle, SLOPES)
            refused = refused if self.best is middle else middle

    def evaluate(self, cam: CamOfSlopes | NoJumpOptimum, stage: str) -> int:
        """Judges a cam, keeps it if it is the largest that enough trains hold, reports the step, and returns how many
        trains fail, at the top of the band alone where too many do there."""
        drawn, step = self.unseen, self.steps + 1
        stored = self.journal.stored(step, cam.z, MET)
        if not drawn.trains or (stored is None and drawn.has_memory):
            drawn.settle(cam.lift)
        if not drawn.trains:
            drawn.draw(self.unseen_count, self.slopes.drawn.matters(1.0 - self.wanted))
        if stored is not None:
            drawn.take(stored)
            speeds = stored["at"][1]
        else:
            judged = self._judge(cam.lift)
            speeds = np.nonzero(judged)[1]
            if self.journal.kept:  # the states of thousands of trains are not copied for nothing
                self.journal.store(step, cam.z, drawn.met(judged))
        failing = self._failing(int(speeds.min(initial=drawn.used.shape[2] - 1)))
        if failing > self.allowed(len(drawn.trains)):
            self.turned_down.append((failing, cam))
        elif self.best is None or cam.area_ratio > self.best.area_ratio + RESOLUTION:
            self.held.append(cam)
        self.report(cam, stage, drawn, failing)
        return failing

    def report(self, cam: CamOfSlopes | NoJumpOptimum, stage: str, drawn: TrainEnsemble, failing: int) -> None:
        """Reports a step: its cam, and how many of the trains that were drawn for it fail."""
        self.steps += 1
        line = {
            "iteration": self.steps,
            "stage": stage,
            "area_ratio": cam.area_ratio,
            "area_mm_deg": cam.lift.area / MM / DEG,
            "trains": len(drawn.trains),
            "failing": failing,
            "confirmed": self.best is cam,
            "best_area_ratio": self.best.area_ratio if self.best else None,
        }
        self.journal.note(line)
        self.show(line)

    def _judge(self, lift: Lift) -> np.ndarray:
        """Judges a cam with the trains that are watched and with scouts, and where a scout falls short with everyone.

        It begins at the top of the band, and ends as soon as too many trains fail. There every train with an adjuster
        is judged: the adjuster of one that uses half of a limit may pump up with the next cam. Returns which trains
        were judged at which speeds (t, s: bool).
        """
        drawn, watched, matters = self.unseen, self.unseen.watched, self.unseen.matters(MATTERING * (1.0 - self.wanted))
        turn = (np.arange(len(drawn.trains)) + self.steps)[:, None]
        scouts = ~watched & (turn % np.where(matters, SCOUTS, FAR_SCOUTS) == 0)
        if drawn.has_memory:
            scouts[:, -1] = ~watched[:, -1]
        judged, may_fail = np.zeros_like(watched), self.allowed(len(watched))
        for begin in (watched.shape[1] - 1, 0):
            asked = (watched | scouts) & ~judged
            asked[:, :begin] = False
            drawn.judge(lift, asked)
            judged |= asked
            if self._failing(begin) > may_fail:
                break
            short = (scouts & asked & (drawn.used.max(axis=1) > NEAR)).any(axis=0)
            others = short & ~(watched | scouts)
            drawn.judge(lift, others)
            judged |= others
            if self._failing(begin) > may_fail:
                break
        return judged

    def _failing(self, begin: int) -> int:
        """How many trains break a limit from the speed of a number on."""
        return int(np.sum(self.unseen.used[:, :, begin:].max(axis=(1, 2)) > 1.0))

    def none_holds(self, failing: int) -> NoCamFound:
        """The error where not even the smallest cam holds, with which so many trains are `failing`."""
        return NoCamFound(
            f"{100 * self.wanted:g} % of the drawn trains hold no cam that was tried: of {len(self.unseen.trains)} "
            f"trains {failing} fail with the smallest one. Ask for a smaller yield, relax the limits on the motion or "
            f"make the tolerances narrower; `camopt yield` says which is to blame"
        )


def first_level(search: YieldSearch, largest: LargestCam, z: np.ndarray) -> float:
    """The level of foretold openings with whose cam, about which the slopes then are, half as many to three times as
    many of the first trains fail as may; fewer where it was lowered, and where the limits bind no more."""
    level, calm, lowered, lost, slopes = FIRST_LEVEL, None, False, 1.0 - search.wanted, search.slopes
    while True:
        found = largest(level, z)
        z, times = found.z, slopes.about(found, lost)
        search.report(slopes.cam, FORETOLD, slopes.drawn, slopes.drawn.failing)
        if times > MOST_FAILING and level > LEAST_LEVEL:
            if calm is not None:
                slopes.about(calm, lost)
                return level / LEVEL_FACTOR
            level, lowered = level / LEVEL_FACTOR, True
        elif lowered or times >= FEWEST_FAILING or (calm and found.area_ratio < calm.area_ratio + RESOLUTION):
            return level
        else:
            level, calm = level * LEVEL_FACTOR, found


def smaller_cams(search: YieldSearch, largest: LargestCam, level: float, z: np.ndarray) -> None:
    """Judges the cam of a level of foretold openings and ever smaller ones, until one holds, where slopes lead to none:
    motions of few trains may have none that leads back. Raises NoCamFound where not even the lowest level has one."""
    while True:
        found = largest(level, z)
        z = found.z
        failing = search.evaluate(found, FORETOLD)
        if search.held:
            return
        if level <= LOWEST_LEVEL:
            raise search.none_holds(failing)
        if level > 0.0:
            level = level / LEVEL_FACTOR if level > LEAST_LEVEL else 0.0
        else:
            level = min(LEVEL_FACTOR * level, NEGATIVE_LEVEL)
