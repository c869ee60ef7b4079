"""The steps of the search for a yield: predicted openings, then gradients of motions, then bisection between two cams.

The price of the limit usage (`slopes_program`) is adapted to the number of failing trains. In the end these are unseen
trains, which have not shaped the cam and whose settled motions are computed by event-exact. The number of them that may
fail is so small that a true share below the wanted one is unlikely. Between an accepted cam and a larger rejected one,
cams are bisected until the two are close to each other. The draws are the same for every cam (common random numbers).
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.special import bdtr

from camopt.cam.lift import Lift
from camopt.highs import Infeasible
from camopt.optimizer.as_built.drawn import STORED, TrainEnsemble
from camopt.optimizer.as_built.slopes_program import SlopesProgram, YieldCandidate
from camopt.optimizer.search.cams import CamSearch
from camopt.scene.errors import NoCamFound

FIRST_LEVEL, LEVEL_FACTOR, LEAST_LEVEL = 0.4, 2.0, 0.02
"""First level of the limit on predicted openings, as a fraction of the limit on the jump; factor between two levels;
and level from which on it is not halved any more. At the median real openings are half as large again as predicted ones
where several masses recoil, and many times as large where a single mass does."""
NEGATIVE_LEVEL, LOWEST_LEVEL, NEWTONS = -0.1, -0.8, 100.0
"""First and last level below zero, which stand for a least contact force, and that force [N] for a level of -1."""
FEWEST_FAILING, MOST_FAILING = 0.5, 3.0
"""Range of the ratio of failing trains to permitted failures for the cam from which the gradient steps start. The
gradients of motions with cams that are far too large are useless."""
OPENINGS, GRADIENTS = "foretold openings", "slopes of motions"
"""Names of the stages in the history: the program on predicted openings, and the programs on gradients of motions."""
STEPS, JUDGED = 8, 16
"""Number of gradient steps whose price is adapted to the trains that shape the cam, and largest number of further steps
whose mean cam is judged by unseen trains. The steps of the bisection are not included."""
FIRST_PRICE, BY_FAILING, MOST_AT_ONCE, LEAST_JUDGED = 0.012, 0.25, 2.0, 1.25
"""Product of the first price and the share of trains that may fail; exponent of the ratio of failing trains to
permitted failures in the factor by which the price changes from step to step; largest such factor; and smallest one
once unseen trains judge, when all that is missing is a cam on the other side of the limit."""
IDLE = 6
"""Number of judged cams in a row, none of them the new largest accepted one, after which the search ends. No price
leads farther then, for instance because the limits on the shape alone bind. The number allows for the mean of the last
cams, which follows the price with a delay of a few steps."""
SHAPED = 0.7
"""Factor on the number of permitted failures among the trains that shape the cam, since the cam suits them better."""
NEAR_ENOUGH = 1e-3
"""Difference of area ratio between an accepted cam and a larger rejected one at which the bisection ends. It is more
than twice the RESOLUTION, so that every cam in the middle takes the place of one of the two."""
NEAR = 0.8
"""Limit usage of a scout at a speed above which all trains are judged at that speed."""
SCOUTS, FAR_SCOUTS, MATTERING = 12, 48, 0.25
"""Trains that are not watched are checked in rotation, as scouts: with each cam one in SCOUTS of them at the speeds
that matter, and one in FAR_SCOUTS at the other speeds. The speeds that matter are the top of the band and those where
the watched trains number more than MATTERING times the permitted failures. These checks are needed because a train with
a small usage with one cam may break a limit with the next."""
CHANCE = 0.13
"""Largest probability that a cam passes the test on the unseen trains although no more than the wanted share of all
trains passes. The difference between permitted and wanted failures allows for the uncertainty of the count, and for the
choice of the largest cam, which favours cams that are lucky with these trains. Of a thousand trains 6 in place of 10
may fail at 0.99, and 88 in place of 100 at 0.9. Where there are too few trains for this probability none may fail, and
the probability is larger: 0.22 for 1500 trains at 0.999."""
RESOLUTION = 2e-4
"""Difference of area ratio by which a cam must exceed the best one to take its place."""

LargestCam = Callable[[float, np.ndarray], np.ndarray]
"""Function that returns the coefficients (m) of the program's cam for a level of the limits on predicted openings and
for the coefficients z (m) of the previous cam."""


@dataclass
class YieldSearch(CamSearch[YieldCandidate]):
    """The state of a search, which accepts a cam if enough of the `unseen` trains pass with it."""

    wanted: float
    slopes: SlopesProgram
    unseen: TrainEnsemble
    unseen_count: int  # drawn for the first cam to be judged
    rejected: list[tuple[int, YieldCandidate]] = field(default_factory=list)  # number failing, cam

    @property
    def nearest_rejected(self) -> YieldCandidate | None:
        """The rejected cam, larger than the best one, with which fewest trains fail; of several, the smallest."""
        least = self.best.area_ratio if self.best else 0.0
        larger = [(failing, cam) for failing, cam in self.rejected if cam.area_ratio > least]
        return min(larger, key=lambda entry: (entry[0], entry[1].area_ratio))[1] if larger else None

    def permitted_failures(self, count: int) -> int:
        """The number of `count` trains that may fail with a cam."""
        return max(int(np.sum(bdtr(np.arange(count), count, 1.0 - self.wanted) <= CHANCE)) - 1, 0)

    @property
    def trains_drawn(self) -> int:
        """Number of trains drawn so far, those that shape the cam and the unseen ones."""
        return len(self.slopes.drawn.trains) + len(self.unseen.trains)

    def follow_gradients(self) -> None:
        """Takes gradient steps and adapts their price to the number of failing trains: at first of those that shape the
        cam, then of unseen ones with the mean of the last cams.

        As soon as one cam is accepted and a larger one rejected, it bisects between these. If a program cannot be
        solved, the search ends with the cams accepted so far.
        """
        price, slopes, idle = FIRST_PRICE / (1.0 - self.wanted), self.slopes, 0
        for step in range(STEPS + JUDGED):
            try:
                slopes.step(price, farther=step >= STEPS)  # until the largest acceptable cam is bracketed
            except (Infeasible, ArithmeticError):
                return
            if step < STEPS:
                drawn, fewer, failing = slopes.drawn, SHAPED, slopes.drawn.failing
                self.report(slopes.cam, GRADIENTS, drawn, failing)
            else:
                best, drawn, fewer, failing = self.best, self.unseen, 1.0, self.evaluate(slopes.mean, GRADIENTS)
                if self.best and self.nearest_rejected:
                    return self.bisect()
                idle = idle + 1 if best and self.best is best else 0
                if idle == IDLE:
                    return
            may_fail, least = fewer * self.permitted_failures(len(drawn.trains)), 1.0 if step < STEPS else LEAST_JUDGED
            change = BY_FAILING * abs(np.log((failing + 1) / (may_fail + 1)))
            change = float(np.exp(np.clip(change, np.log(least), np.log(MOST_AT_ONCE))))
            price *= change if failing > may_fail else 1.0 / change

    def bisect(self) -> None:
        """Bisects between the largest accepted cam and a larger rejected one, until the two are close to each other.
        The mean of two cams keeps all limits on the shape."""
        larger = self.nearest_rejected
        while self.best and larger and larger.area_ratio > self.best.area_ratio + NEAR_ENOUGH:
            middle = self.slopes.cam_of(0.5 * (self.best.z + larger.z))
            self.evaluate(middle, GRADIENTS)
            larger = larger if self.best is middle else middle

    def evaluate(self, cam: YieldCandidate, stage: str) -> int:
        """Judges a cam with the unseen trains, accepts it if enough of them pass and it is the largest, reports the
        step, and returns how many trains fail: at the top of the band alone if too many fail there."""
        drawn, step = self.unseen, self.steps + 1
        stored = self.journal.stored(step, cam.z, STORED)
        if not drawn.trains or (stored is None and drawn.has_memory):
            drawn.settle(cam.lift)
        if not drawn.trains:
            drawn.draw(self.unseen_count, self.slopes.drawn.critical_speeds(1.0 - self.wanted))
        if stored is not None:
            drawn.restore(stored)
            speeds = stored["at"][1]
        else:
            judged = self._judge(cam.lift)
            speeds = np.nonzero(judged)[1]
            if self.journal.kept:  # otherwise the states of thousands of trains would be copied in vain
                self.journal.store(step, cam.z, drawn.stored_arrays(judged))
        failing = self._failing(int(speeds.min(initial=drawn.used.shape[2] - 1)))
        if failing > self.permitted_failures(len(drawn.trains)):
            self.rejected.append((failing, cam))
        elif self.best is None or cam.area_ratio > self.best.area_ratio + RESOLUTION:
            self.held.append(cam)
        self.report(cam, stage, drawn, failing)
        return failing

    def report(self, cam: YieldCandidate, stage: str, drawn: TrainEnsemble, failing: int) -> None:
        """Reports a step: its cam, and how many of the trains `drawn` fail."""
        self.steps += 1
        self.note_step(cam, stage, {"trains": len(drawn.trains), "failing": failing})

    def _judge(self, lift: Lift) -> np.ndarray:
        """Judges a cam with the watched trains and with scouts, and with all trains at a speed where a scout comes near
        a limit. Returns which trains were judged at which speeds (t, s: bool).

        It starts at the top of the band, and ends as soon as too many trains fail. All trains with memory are judged at
        the top, since the adjuster of a train that uses half of a limit may pump up with the next cam.
        """
        drawn, watched = self.unseen, self.unseen.watched
        critical = drawn.critical_speeds(MATTERING * (1.0 - self.wanted))
        turn = (np.arange(len(drawn.trains)) + self.steps)[:, None]
        scouts = ~watched & (turn % np.where(critical, SCOUTS, FAR_SCOUTS) == 0)
        if drawn.has_memory:
            scouts[:, -1] = ~watched[:, -1]
        judged, may_fail = np.zeros_like(watched), self.permitted_failures(len(watched))
        for begin in (watched.shape[1] - 1, 0):
            selected = (watched | scouts) & ~judged
            selected[:, :begin] = False
            drawn.judge(lift, selected)
            judged |= selected
            if self._failing(begin) > may_fail:
                break
            near = (scouts & selected & (drawn.used.max(axis=1) > NEAR)).any(axis=0)
            remaining = near & ~(watched | scouts)
            drawn.judge(lift, remaining)
            judged |= remaining
            if self._failing(begin) > may_fail:
                break
        return judged

    def _failing(self, begin: int) -> int:
        """Number of trains that break a limit at the speeds from index `begin` on."""
        return int(np.sum(self.unseen.used[:, :, begin:].max(axis=(1, 2)) > 1.0))


def first_level(search: YieldSearch, largest: LargestCam, z: np.ndarray) -> float:
    """The level of predicted openings from whose cam the gradient steps start.

    The failing trains among the first ones number FEWEST_FAILING to MOST_FAILING times the permitted failures with this
    cam. They may be fewer if the level had to be lowered, or if the limits on the openings no longer bind.
    """
    level, calm, lowered, slopes = FIRST_LEVEL, None, False, search.slopes
    while True:
        z = largest(level, z)
        times = slopes.move_to(z)
        search.report(slopes.cam, OPENINGS, slopes.drawn, slopes.drawn.failing)
        if times > MOST_FAILING and level > LEAST_LEVEL:
            if calm is not None:
                slopes.move_to(calm.z)
                return level / LEVEL_FACTOR
            level, lowered = level / LEVEL_FACTOR, True
        elif lowered or times >= FEWEST_FAILING or (calm and slopes.cam.area_ratio < calm.area_ratio + RESOLUTION):
            return level
        else:
            level, calm = level * LEVEL_FACTOR, slopes.cam


def smaller_cams(search: YieldSearch, largest: LargestCam, level: float, z: np.ndarray) -> None:
    """Judges the cam of a level of predicted openings and then of ever lower levels, until one is accepted.

    It is used where the gradient steps lead to no such cam, since the gradients of a few trains may not point back to
    one. Raises NoCamFound where the cam of the lowest level is rejected too.
    """
    while True:
        z = largest(level, z)
        failing = search.evaluate(search.slopes.cam_of(z), OPENINGS)
        if search.held:
            return
        if level <= LOWEST_LEVEL:
            raise NoCamFound(
                f"{100 * search.wanted:g} % of the drawn trains hold no cam that was tried: of "
                f"{len(search.unseen.trains)} trains {failing} fail with the smallest one. Ask for a smaller yield, "
                f"relax the limits on the motion or make the tolerances narrower; `camopt yield` says which is to blame"
            )
        if level > 0.0:
            level = level / LEVEL_FACTOR if level > LEAST_LEVEL else 0.0
        else:
            level = min(LEVEL_FACTOR * level, NEGATIVE_LEVEL)
