"""The cam of largest area that a wanted share of drawn trains holds.

Every cam is the largest one of the no-jump program under some margins, so that all limits on its shape hold at every
angle. A common margin that enough of the drawn trains hold comes first. Then Adam moves the margins of opening flank,
closing flank and seat at every speed apart, along the slope of area less expected shortfall: the mean, over the drawn
trains, of what the worst part of a limit exceeds `AIM` by. Yield itself is a count without slope. The shortfall has
one, by the exact adjoint through every train's contacts and through the program's own active rows. The draws are the
same for every cam (common random numbers); once a cam holds, more are drawn.

A train whose spring is a little soft meets at the top speed what the train as designed meets beyond it. So the
program's speeds reach beyond the band.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from camopt.optimizer.as_built.drawn import DrawnTrains
from camopt.optimizer.as_built.journal import TrainsLog
from camopt.optimizer.program.no_jump import Margins, NoCamHoldsContact, NoJumpOptimum, NoJumpProgram
from camopt.scene.errors import InputError
from camopt.scene.units import DEG, MM

OVERSPEED = (1.007, 1.014)
"""Speeds beyond the band's top, as shares of it."""
OVERSPEED_FALL_N = 15.0
"""By how much the common margin falls from each of them to the next."""
AIM = 0.75
"""Part of a limit beyond which a train falls short."""
REFUSED = 10.0
"""What a train whose valve never seats counts as: it has no part of a limit."""
WATCHED = 0.6
"""A train at a speed where it last used more of a limit is judged with every cam; others, with a cam that holds."""
FIRST_MARGIN_N, FIRST_STEP_N, LAST_STEP_N = 60.0, 20.0, 2.5
"""Where the search for the common margin begins, its step until it is bisected, and where it ends."""
SLACK = 1.01
"""Factor on a shortfall of the program, so that margins below it are surely held."""
RATE_N = 2.0
"""Adam's step on a margin."""
STEEPEST = 1500.0
"""Longest slope that is believed: that of a contact that hammers is beyond all measure, and its direction is left."""
WEIGHT, WEIGHT_STEP = 1.0, 1.1
"""Area ratio that a shortfall of one costs at first, and by what factor it rises or falls at most from cam to cam."""
BUDGET = 0.4
"""Expected shortfall that a cam may have, per share of trains that may be lost. A count of few failing trains is a
rough measure, and a search that goes by it alone ends at a cam that suits its own draws."""
RESOLUTION = 2e-4
"""Area ratio by which a cam must exceed the best one to be worth judging everywhere."""


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

    @property
    def best(self) -> NoJumpOptimum | None:
        """The largest cam that holds."""
        return self.held[-1] if self.held else None

    @property
    def allowed(self) -> int:
        """Trains of those drawn that may fail."""
        return int((1.0 - self.wanted) * len(self.drawn.trains) + 1e-9)

    @property
    def budget(self) -> float:
        """Expected shortfall that a cam may have."""
        return BUDGET * (1.0 - self.wanted)

    @property
    def holds(self) -> bool:
        """Whether enough of the trains hold the last cam, as far as they were judged."""
        return self.drawn.failing <= self.allowed and self.shortfall <= self.budget

    def consider(self, stage: str, found: NoJumpOptimum) -> bool:
        """Judges a cam, keeps it if it is the largest that enough trains hold, and reports the step."""
        drawn, self.steps = self.drawn, self.steps + 1
        larger = self.best is None or found.area_ratio > self.best.area_ratio + RESOLUTION
        if not self.log.recalled(self.steps, found.z, drawn):
            self._judge(found, larger)
            self.log.keep(self.steps, found.z, drawn)
        holds = self.holds
        if holds and larger:
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

    def _judge(self, found: NoJumpOptimum, larger: bool) -> None:
        """Judges where limits were used most and, where enough trains hold there and the cam is larger, everywhere."""
        drawn = self.drawn
        watched = drawn.used.max(axis=1) > WATCHED
        watched[:, -1] = True
        drawn.judge(found.lift, watched)
        if larger and self.holds:
            drawn.judge(found.lift, drawn.all & ~watched)

    @property
    def shortfall(self) -> float:
        """The expected shortfall of the last cam."""
        return float(np.mean(np.maximum(np.nan_to_num(self.drawn.worst, posinf=REFUSED) - AIM, 0.0)))

    def common_margin(self) -> np.ndarray:
        """Bisects the common margin to the lowest one that holds; returns that one's margins (3, s) [N].

        Raises InputError where none of those tried holds.
        """
        low, high = -np.inf, np.inf
        level = FIRST_MARGIN_N
        while high - low > LAST_STEP_N:
            try:
                held = self.consider("common margin", self.program.solve(Margins(*self._common(level))))
            except NoCamHoldsContact as short:
                raise InputError(
                    f"{100 * self.wanted:g} % of the drawn trains hold no cam that was tried: {short}"
                ) from short
            low, high = (low, level) if held else (level, high)
            if np.isfinite(low) and np.isfinite(high):
                level = 0.5 * (low + high)
            else:
                level += -FIRST_STEP_N if held else FIRST_STEP_N
        self.common = self.best
        return self._common(high)

    def _common(self, level: float) -> np.ndarray:
        """Margins (3, s) [N] of one level within the band, falling beyond it."""
        speeds = len(self.program.blocks)
        beyond = np.maximum(np.arange(speeds) - (speeds - 1 - len(OVERSPEED)), 0)
        return np.tile(level - OVERSPEED_FALL_N * beyond, (3, 1))

    def by_gradient(self, margins: np.ndarray, steps: int) -> np.ndarray:
        """So many steps of Adam on the margins (3, s) [N]; those of the last cam."""
        import optax  # loads JAX

        adam, weight = optax.adam(RATE_N, b1=0.7, b2=0.9), WEIGHT
        state, found = adam.init(margins), self.program.solve(Margins(*margins))
        self.consider("margins by gradient", found)
        for _ in range(steps):
            slope = self.slope(found, weight)
            update, state = adam.update(slope, state)
            moved = margins + np.asarray(update)
            try:
                found = self.program.solve(Margins(*moved))
            except NoCamHoldsContact as short:
                moved = moved - SLACK * short.shortfall_N
                found = self.program.solve(Margins(*moved))
            margins = moved
            self.consider("margins by gradient", found)
            weight *= float(np.clip(self.shortfall / self.budget, 1.0 / WEIGHT_STEP, WEIGHT_STEP))
        return margins

    def slope(self, found: NoJumpOptimum, weight: float) -> np.ndarray:
        """d (weight * shortfall - area ratio) / d margins [1/N] of the cam that was just judged, (3, s)."""
        _, slopes = self.drawn.slopes(self.program.cam, found.z, AIM)
        length = np.linalg.norm(slopes, axis=1, keepdims=True)
        slopes = slopes * np.minimum(1.0, STEEPEST / np.maximum(length, 1e-12))
        by_z = slopes.sum(axis=0) / len(self.drawn.trains)
        return weight * np.einsum("m,mks->ks", by_z, found.jacobian()) - found.margin_prices

    def more_trains(self, count: int) -> None:
        """Draws trains until there are so many; of the cams that held, those stay, the largest first, that still do."""
        self.drawn.settle(self.program.cam.lift(self.held[-1].z))
        self.drawn.draw(count)
        held, self.held = self.held, []
        for found in held[::-1]:
            self.consider("more trains", found)
            if self.held:
                break
