"""The cam of largest area that a wanted share of drawn trains holds.

It begins with the largest cams of the no-jump program under one margin for all speeds, the lowest that enough of the
drawn trains hold. Then, at the same area, the margins of groups of speeds move one after the other, and all margins
along exact slopes, to where the drawn trains fall least short. The shortfall is the mean, over the trains, of what the
worst part of a limit exceeds `AIM` by, up to `GIVEN_UP`; yield itself is a count without slope. The slopes are those of
the exact adjoint, through every train's contacts. The draws are the same for every cam (common random numbers). At last
other trains, which have shaped no cam, say how far all margins must move together: a cam suits the trains that a search
knows better than others.

A train whose spring is a little soft meets at the top speed what the train as designed meets beyond it. So the
program's speeds reach beyond the band, where the margins fall: as far as the softest springs that a yield must hold.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from camopt.cam.lift import Lift
from camopt.optimizer.as_built.drawn import DrawnTrains
from camopt.optimizer.as_built.journal import TrainsLog
from camopt.optimizer.as_built.linear_step import stepped
from camopt.optimizer.program.force_rows import Margins
from camopt.optimizer.program.no_jump import NoCamHoldsContact, NoJumpOptimum, NoJumpProgram
from camopt.scene.errors import NoCamFound
from camopt.scene.units import DEG, MM

COMMON, BY_GROUPS, ALONG_SLOPES = "common margin", "margins by groups", "margins along slopes"
"""What the stages are called in the history."""
OVERSPEED, OVERSPEED_FALL_N = (1.007, 1.014, 1.023), (15.0, 30.0, 50.0)
"""Speeds beyond the band's top, as shares of it, and by how much less the common margin is there."""
TOP = 7
"""Highest speeds of the program whose margins move each by itself; those below move together."""
AIM = 0.8
"""Part of a limit beyond which a train falls short."""
GIVEN_UP = 1.2
"""Part of a limit beyond which a train falls no further short: it is one of those that a yield may lose, and by how
much it fails is nobody's loss. A few soft springs in a thousand would otherwise make the whole cam."""
WATCHED = 0.45
"""A train is judged with every cam at the speeds where it last used more of a limit than this."""
SCOUTS, FAR_SCOUTS = 12, 48
"""Of the other trains one in so many is judged with every cam, and with the next cam the next ones, at the speeds that
matter: the top of the band, and where more than a quarter as many trains are watched as may fail. At the remaining
speeds it is one in the second number. A train that uses little of a limit with one cam may break it with the next."""
FIRST_MARGIN_N, FIRST_STEP_N, MORE_STEP_N, LAST_STEP_N = 40.0, 10.0, 4.0, 1.0
"""Where the search for the common margin begins, its step until it is bisected, that after more trains are drawn, and
where both end."""
FIRST_MOVE_N, LAST_MOVE_N = 8.0, 3.0
"""How far the margins of a group of speeds move at first and at least."""
NEAR, GONE, ROWS = 0.6, 1.35, 2
"""Trains whose worst part of a limit lies between the two have slopes, each those of so many of its largest parts. One
beyond counts as given up, whatever the step."""
REACH_N, WIDER, NARROWER = 6.0, 1.3, 0.4
"""How far the first step moves a margin; factors on that after a step that is taken and one that is not."""
LEAST_GAIN, LEAST_GAINS = 0.0025, 0.01
"""Share of the shortfall that a cam must take away to be kept, and that three steps along slopes must take away for
another one: each costs as much as hundreds of trains."""
SPENT, SPENT_UNSEEN = 2.0, 0.5
"""Part of the wanted loss that a cam may spend on the trains that shape it, and on those that say how large it may be.
The former is large because a few failing trains say little of the shape that a thousand others would want; the latter
leaves something for what a count leaves open, so that still other trains bear it out more often than not."""
LEVELLINGS = 8
"""Solutions of the program at most until a cam has the area of another one."""
SAME_AREA = 1e-6
"""Area ratios that count as the same one."""
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
    without_gradients: NoJumpOptimum | None = None
    steps: int = 0
    spent: float = SPENT
    shaped_by: int = 0  # trains that shaped the cam, once others say how large it may be

    @property
    def best(self) -> NoJumpOptimum | None:
        """The largest cam that holds."""
        return self.held[-1] if self.held else None

    @property
    def allowed(self) -> int:
        """Trains of those drawn that may fail with a cam of the search."""
        return int(self.spent * (1.0 - self.wanted) * len(self.drawn.trains) + 1e-9)

    @property
    def trains_drawn(self) -> int:
        """Trains that were drawn so far, those that shaped the cam and the others."""
        return self.shaped_by + len(self.drawn.trains)

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

    def lowest(self, margins: np.ndarray, step_N: float) -> NoJumpOptimum:
        """Moves all `margins` (3, s) [N] by one amount, bisected to the lowest that holds; returns their cam.

        Raises NoCamFound where none of those tried holds.
        """
        low, high, shift, best = -np.inf, np.inf, 0.0, None
        while high - low > LAST_STEP_N:
            try:
                found = self.program.solve(Margins(*(margins + shift)))
            except NoCamHoldsContact as short:
                drawn = self.drawn
                raise NoCamFound(
                    f"{100 * self.wanted:g} % of the drawn trains hold no cam that was tried: of {len(drawn.trains)} "
                    f"trains {drawn.failing} fail with the largest margins; {short}. Ask for a smaller yield, relax "
                    f"the limits on the motion or make the tolerances narrower; `camopt yield` says which is to blame"
                ) from short
            larger = best is None or found.area_ratio > best.area_ratio + RESOLUTION
            if self.consider(COMMON, found) and larger:  # margins that bind no more make no cam larger
                high, best = shift, found
            else:
                low = shift
            if np.isfinite(low) and np.isfinite(high):
                shift = 0.5 * (low + high)
            else:
                shift += step_N if best is None else -step_N
        assert best is not None, "the search ends where one is known that holds"
        return best

    def _common(self, level: float) -> np.ndarray:
        """Margins (3, s) [N] of one level within the band, falling beyond it."""
        within = len(self.program.blocks) - len(OVERSPEED)
        return np.tile(level - np.array([0.0] * within + [*OVERSPEED_FALL_N]), (3, 1))

    def by_groups(self, cam: NoJumpOptimum, most: int) -> NoJumpOptimum:
        """Moves the margins of one group of speeds after the other at the same area, with at most so many cams, to
        where the trains fall less short; returns the last cam that was kept."""
        groups = [np.broadcast_to(group, (3, len(self.program.blocks))) for group in self._groups()]
        ways, last = [-FIRST_MOVE_N] * len(groups), self.steps + most
        self.consider(BY_GROUPS, cam)
        while max(map(abs, ways)) >= LAST_MOVE_N and self.shortfall > 0.0:
            for g, group in enumerate(groups):
                if abs(ways[g]) < LAST_MOVE_N:
                    continue
                for way in (ways[g], -ways[g]):
                    if self.steps >= last:
                        return cam
                    moved = self._better(BY_GROUPS, cam, cam.margins + way * group)
                    if moved is not None:
                        cam, ways[g] = moved, way
                        break
                else:
                    ways[g] *= 0.5
        return cam

    def _groups(self) -> list[np.ndarray]:
        """The margins that move together, each group (1 or 3, 1 or s): the speeds, and each kind of margin."""
        speeds = np.eye(len(self.program.blocks))
        low = speeds[:-TOP].sum(axis=0, keepdims=True)
        return [low, *speeds[-TOP:, None], *np.eye(3)[:, :, None]]

    def by_slopes(self, cam: NoJumpOptimum, steps: int) -> NoJumpOptimum:
        """At most so many steps of the margins along exact slopes at the same area, fewer where they add next to
        nothing; returns the last cam that was kept."""
        reach_N, slopes, left = REACH_N, None, []
        self.consider(ALONG_SLOPES, cam)
        for _ in range(steps):
            slopes = slopes or self.drawn.slopes(self.program.cam, cam.z, (NEAR, GONE), ROWS)
            left.append(self.shortfall)
            moved = self._better(ALONG_SLOPES, cam, stepped(cam, slopes, AIM, reach_N))
            if moved is not None:
                cam, reach_N, slopes = moved, WIDER * reach_N, None
            else:
                reach_N *= NARROWER
            if len(left) >= 3 and self.shortfall >= (1.0 - LEAST_GAINS) * left[-3]:
                break
        return cam

    def _better(self, stage: str, cam: NoJumpOptimum, margins: np.ndarray) -> NoJumpOptimum | None:
        """The cam of these margins, moved together to the area of `cam`, if the trains fall less short with it."""
        drawn, before = self.drawn, self.shortfall
        known = drawn.used.copy(), drawn.states.copy()
        moved = self._as_large(margins, cam.area_ratio)
        if moved is not None:
            self.consider(stage, moved)
            if self.shortfall < (1.0 - LEAST_GAIN) * before:
                return moved
        drawn.used, drawn.states = known
        return None

    def _as_large(self, margins: np.ndarray, area_ratio: float) -> NoJumpOptimum | None:
        """The cam of these margins (3, s) [N], moved together until it has this area ratio, by Newton's method; None
        where none is found. The area is concave in such a move, so that few steps find the place."""
        for _ in range(LEVELLINGS):
            found = self.program.solve_below(margins)
            off, price = found.area_ratio - area_ratio, found.margin_prices.sum()
            if abs(off) < SAME_AREA:
                return found
            if price > -1e-9:  # no margin binds
                return None
            margins = found.margins - off / price
        return None

    def more_trains(self, count: int) -> None:
        """Draws trains until there are so many; no cam counts as one that holds until it is judged with them.

        They begin where the train as designed settles with the best cam so far, and are all judged at the speeds that
        matter.
        """
        self._draw(self.drawn, count)

    def ask_unseen(self, unseen: DrawnTrains, count: int) -> None:
        """Judges all further cams with so many other trains, for which `SPENT_UNSEEN` holds."""
        self._draw(unseen, count)
        self.drawn, self.spent, self.shaped_by = unseen, SPENT_UNSEEN, len(self.drawn.trains)

    def _draw(self, drawn: DrawnTrains, count: int) -> None:
        drawn.settle(self.held[-1].lift)
        drawn.draw(count, self._watched()[1])
        self.held.clear()
