"""The cam of largest area that a wanted share of drawn trains holds.

It begins with the largest cams of the no-jump program under one margin for all speeds, the lowest that enough of the
drawn trains hold. Then each speed gets margins of its own, which move along exact slopes to the largest area whose
expected shortfall stays within a budget. The shortfall is the mean, over the drawn trains, of what the worst part of a
limit exceeds `AIM` by, up to `GIVEN_UP`; yield itself is a count without slope. The slopes are those of the exact
adjoint, through every train's contacts. The draws are the same for every cam (common random numbers); once a cam holds,
more are drawn, and it goes on from there with these.

A train whose spring is a little soft meets at the top speed what the train as designed meets beyond it. So the
program's speeds reach beyond the band, where the margins fall: as far as the softest springs that a yield must hold.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from camopt.cam.lift import Lift
from camopt.optimizer.as_built.drawn import DrawnTrains
from camopt.optimizer.as_built.journal import TrainsLog
from camopt.optimizer.as_built.linear_step import UsedSlopes, stepped
from camopt.optimizer.program.no_jump import Margins, NoCamHoldsContact, NoJumpOptimum, NoJumpProgram
from camopt.scene.errors import InputError
from camopt.scene.units import DEG, MM

ALONG_SLOPES = "margins along slopes"
"""What the steps are called in the history."""
OVERSPEED, OVERSPEED_FALL_N = (1.007, 1.014, 1.023), (15.0, 30.0, 50.0)
"""Speeds beyond the band's top, as shares of it, and by how much less the common margin is there."""
AIM = 0.75
"""Part of a limit beyond which a train falls short."""
GIVEN_UP = 1.25
"""Part of a limit beyond which a train falls no further short: it is one of those that a yield may lose, and by how
much it fails is nobody's loss. A few soft springs in a thousand would otherwise make the whole cam."""
WATCHED = 0.4
"""A train is judged with every cam at the speeds where it last used more of a limit than this."""
SCOUTS, FAR_SCOUTS = 8, 32
"""Of the other trains one in so many is judged with every cam, and with the next cam the next ones, at the speeds that
matter: the top of the band, and where more than a quarter as many trains are watched as may fail. At the remaining
speeds it is one in the second number. A train that uses little of a limit with one cam may break it with the next."""
FIRST_MARGIN_N, FIRST_STEP_N, MORE_STEP_N, LAST_STEP_N = 40.0, 10.0, 4.0, 1.5
"""Where the search for the common margin begins, its step until it is bisected, that after more trains are drawn, and
where both end."""
NEAR, GONE, ROWS = 0.6, 1.6, 2
"""Trains whose worst part of a limit lies between the two have slopes, each those of so many of its largest parts. One
beyond counts as given up, whatever the step."""
REACH_N, WIDER, NARROWER = 6.0, 1.3, 0.4
"""How far the first step moves a margin; factors on that after a step that is taken and one that is not."""
LEAST_GAIN = 0.001
"""Area ratio that three steps in a row must add for another one: each costs as much as hundreds of trains."""
BISECTIONS = 4
"""Cams that are looked at on the way back from one that a few trains too many do not hold."""
PENALTY = 4.0
"""Area ratio that a unit of shortfall beyond the budget costs a step. The linear program takes more for it; here it is
so low that the way may lead through cams that a few trains too many do not hold."""
SPENT = 0.6
"""Part of the wanted loss that a search may spend: its cam suits the trains that it knows better than others."""
PER_FAILING = 0.6
"""Expected shortfall per share of failing trains where too few of them fail to say it."""
RESOLUTION = 2e-4
"""Area ratio by which a cam must exceed the best one to take its place."""


@dataclass
class YieldSearch:
    """The state of a search: the program, the trains it knows, and the largest cam that enough of them hold."""

    drawn: DrawnTrains
    program: NoJumpProgram
    wanted: float
    log: TrainsLog = field(default_factory=lambda: TrainsLog(None))
    show: Callable[[dict], None] = lambda line: None
    held: list[NoJumpOptimum] = field(default_factory=list)  # each larger than the one before
    common: NoJumpOptimum | None = None  # the largest of a common margin
    steps: int = 0
    per_failing: float = PER_FAILING  # expected shortfall per share of failing trains

    @property
    def best(self) -> NoJumpOptimum | None:
        """The largest cam that holds."""
        return self.held[-1] if self.held else None

    @property
    def allowed(self) -> int:
        """Trains of those drawn that may fail with a cam of the search."""
        return int(SPENT * (1.0 - self.wanted) * len(self.drawn.trains) + 1e-9)

    @property
    def budget(self) -> float:
        """Expected shortfall of a cam of which as many trains fail as may."""
        return SPENT * self.per_failing * (1.0 - self.wanted)

    @property
    def holds(self) -> bool:
        """Whether enough of the trains hold the last cam, as far as they were judged."""
        return self.drawn.failing <= self.allowed

    def consider(self, stage: str, found: NoJumpOptimum) -> bool:
        """Judges a cam, keeps it if it is the largest that enough trains hold, and reports the step."""
        drawn, self.steps = self.drawn, self.steps + 1
        if not self.log.recalled(self.steps, found.z, drawn):
            self.log.keep(self.steps, found.z, drawn, self._judge(found.lift))
        holds = self.holds
        if holds and (self.best is None or found.area_ratio > self.best.area_ratio + RESOLUTION):
            self.held.append(found)
        line = {
            "iteration": self.steps,
            "stage": stage,
            "area_ratio": found.area_ratio,
            "area_mm_deg": found.lift.area / MM / DEG,
            "trains": len(drawn.trains),
            "failing": drawn.failing,
            "shortfall": self.shortfall,
            "confirmed": self.best is found,
            "best_area_ratio": self.best.area_ratio if self.best else None,
        }
        self.log.note(line)
        self.show(line)
        return holds

    def _judge(self, lift: Lift) -> np.ndarray:
        """Judges a cam with the trains that are watched and with scouts, and where a scout falls short with everyone.

        Returns which trains were judged at which speeds (t, s: bool).
        """
        drawn, (watched, matters) = self.drawn, self._watched()
        turn = (np.arange(len(drawn.trains)) + self.steps)[:, None]
        scouts = ~watched & (turn % np.where(matters, SCOUTS, FAR_SCOUTS) == 0)
        drawn.judge(lift, watched | scouts)
        short = (scouts & (drawn.used.max(axis=1) > AIM)).any(axis=0)
        others = short & ~(watched | scouts)
        drawn.judge(lift, others)
        return watched | scouts | others

    def _watched(self) -> tuple[np.ndarray, np.ndarray]:
        """Which trains are watched at which speeds (t, s: bool), and which speeds (s: bool) have many of them."""
        watched = self.drawn.used.max(axis=1) > WATCHED
        matters = watched.mean(axis=0) > 0.25 * (1.0 - self.wanted)
        matters[-1] = True
        return watched, matters

    @property
    def shortfall(self) -> float:
        """The expected shortfall of the last cam."""
        return float(np.mean(np.clip(self.drawn.worst, AIM, GIVEN_UP) - AIM))

    def first_cam(self) -> NoJumpOptimum:
        """The cam of the first common margin, or of the highest one below it that any cam keeps."""
        return self.program.solve_below(self._common(FIRST_MARGIN_N))

    def lowest(self, margins: np.ndarray, step_N: float) -> np.ndarray:
        """Moves all `margins` (3, s) [N] by one amount, bisected to the lowest that holds; returns what they become.

        Raises InputError where none of those tried holds.
        """
        low, high, shift = -np.inf, np.inf, 0.0
        while high - low > LAST_STEP_N:
            try:
                found = self.program.solve(Margins(*(margins + shift)))
            except NoCamHoldsContact as short:
                drawn = self.drawn
                raise InputError(
                    f"{100 * self.wanted:g} % of the drawn trains hold no cam that was tried: of {len(drawn.trains)} "
                    f"trains {drawn.failing} fail with the largest margins; {short}. Ask for a smaller yield, relax "
                    f"the limits on the motion or make the tolerances narrower; `camopt yield` says which is to blame"
                ) from short
            held = self.consider("common margin", found)
            held = held and self.best is found  # margins that bind no more make no cam larger
            low, high = (low, shift) if held else (shift, high)
            if np.isfinite(low) and np.isfinite(high):
                shift = 0.5 * (low + high)
            else:
                shift += -step_N if held else step_N
        return margins + high

    def _common(self, level: float) -> np.ndarray:
        """Margins (3, s) [N] of one level within the band, falling beyond it."""
        within = len(self.program.blocks) - len(OVERSPEED)
        return np.tile(level - np.array([0.0] * within + [*OVERSPEED_FALL_N]), (3, 1))

    def by_slopes(self, cam: NoJumpOptimum, steps: int) -> NoJumpOptimum:
        """At most so many steps of the margins along exact slopes, from `cam` on; fewer where they add next to nothing.

        Returns the last cam that was taken, which a few trains too many may not hold.
        """
        drawn, reach_N, found = self.drawn, REACH_N, None
        self.consider(ALONG_SLOPES, cam)
        self._measure_budget()
        gains = [np.inf]
        for _ in range(steps):
            found = found or drawn.slopes(self.program.cam, cam.z, (NEAR, GONE), ROWS)
            merit, known = self.merit(cam), (drawn.used.copy(), drawn.states.copy())
            moved = self._stepped(cam, found, reach_N)
            gains.append(0.0)
            if moved is not None:
                self.consider(ALONG_SLOPES, moved)
                gains[-1] = max(self.merit(moved) - merit, 0.0)
            if moved is not None and gains[-1] > 0.0:
                cam, reach_N, found = moved, WIDER * reach_N, None
                self._measure_budget()
            else:
                drawn.used, drawn.states = known
                reach_N *= NARROWER
            if sum(gains[-3:]) < LEAST_GAIN:
                break
        return cam

    def _stepped(self, cam: NoJumpOptimum, found: UsedSlopes, reach_N: float) -> NoJumpOptimum | None:
        """The cam of a step; None where no cam keeps its margins."""
        lost = np.sum(self.drawn.worst >= GONE) * (GIVEN_UP - AIM)
        budget = max(len(self.drawn.trains) * self.budget - lost, 0.0)
        try:
            return self.program.solve(Margins(*stepped(cam, found, AIM, budget, reach_N)))
        except NoCamHoldsContact:
            return None

    def between(self, safe: NoJumpOptimum, cam: NoJumpOptimum) -> None:
        """Looks on the way of the margins from a `safe` cam to another one for the largest that enough trains hold."""
        low, high = 0.0, 1.0
        for _ in range(BISECTIONS):
            share = 0.5 * (low + high)
            found = self.program.solve(Margins(*((1.0 - share) * safe.margins + share * cam.margins)))
            low, high = (share, high) if self.consider("between", found) else (low, share)

    def _measure_budget(self) -> None:
        """Takes from the last cam how much shortfall comes with a failing train; that differs from scene to scene."""
        if 2 * self.drawn.failing >= max(self.allowed, 2):
            self.per_failing = self.shortfall * len(self.drawn.trains) / self.drawn.failing

    def merit(self, cam: NoJumpOptimum) -> float:
        """The area ratio of the cam that was just judged, less what its shortfall beyond the budget costs."""
        return cam.area_ratio - PENALTY * max(self.shortfall - self.budget, 0.0)

    def more_trains(self, count: int) -> None:
        """Draws trains until there are so many; no cam counts as one that holds until it is judged with them.

        They begin where the train as designed settles with the best cam so far, and are all judged at the speeds that
        matter.
        """
        self.drawn.settle(self.held[-1].lift)
        self.drawn.draw(count, self._watched()[1])
        self.held.clear()
