"""One method at one speed: the step halved until the answer stands, with an error estimate for every figure."""

from collections.abc import Callable, Collection
from dataclasses import dataclass

import numpy as np

from camopt.cam.lift import Lift
from camopt.measure.settling import (
    Figures,
    Measured,
    decay_per_revolution,
    first_revolution,
    settle_and_measure,
)
from camopt.measure.sweep import SettledMany
from camopt.scene.errors import MotionRefused
from camopt.scene.quantities import QUANTITIES
from camopt.scene.response import Revolve, end_state
from camopt.scene.settled import RANGED, SETTLED_POSITION
from camopt.scene.train import Train
from camopt.scene.vibration import highest_rate

Prepare = Callable[[Train, Lift, float, int], Revolve]
"""A method: train, lift, cam speed [rad/s] and steps per revolution to one revolution of a state."""

COARSEST_PHASE = 0.6
"""Highest frequency times the first step [rad]: well inside the stability limits of the explicit methods."""
FEWEST_STEPS = 1440
FINEST_STEPS = 120_000
"""Steps per revolution beyond which a step is not halved again: memory, and minutes. A train that would begin beyond a
quarter of it (very stiff, very slow) begins there, and nothing counts as converged before its fastest rate is resolved:
Houbolt's method, stable at every step, would damp it out and stand at a wrong force."""
RELATIVE = 0.01
"""A figure stands when a halved step moves it less than its absolute tolerance plus this share of itself."""
ABSOLUTE = {
    "seating_velocity_m_per_s": 0.005,
    "contact_force_max_N": 5.0,
    "dynamic_area_mm_deg": 0.1,
}
"""Tolerances beside those of the lengths (bounce and jump), which the caller chooses. The figures not listed hang on
contacts that barely open; they are reported with their error."""
MARGIN, COARSER = 2.0, 3
"""An estimated error is MARGIN times the largest distance to the last COARSER answers. No method that steps across
contacts has an order there that would allow less: it is late by a share of its step that is as good as drawn anew at
every step. Where that share is uniform, the error passes the largest distance to two coarser answers once in six times,
twice that distance once in 24, and twice the distance to three of them once in 250."""
WHERE_LIMITED = {"jump_deg": 0.5, "contact_force_min_N": 5.0}
"""Tolerances of the figures that decide only where the scene limits them. Impact velocity and excess lift never are."""
WANDERING_REVOLUTIONS = 16
"""Most revolutions of a finer step that goes on from a motion which wandered at the coarser one: what led to it has
died out there, so that a motion which settles at the finer step after all soon does."""

FINEST = {
    q.name: {"mm": 1e-5, "deg": 1e-3, "N": 1e-2, "m/s": 1e-5, "mm deg": 1e-3}[q.unit] for q in QUANTITIES.values()
}
"""Least error that is stated: what settling to a micrometre, reading extremes from cubics and rounding leave of a
figure, whatever halved steps move (some thousandths of a micrometre of bounce on drawn scenes)."""


@dataclass(frozen=True, repr=False)
class Converged:
    """A method's answer at one speed: figures of the finest step, how they spread and how far the last halvings moved
    them. NaN throughout where the method refused every step."""

    steps_per_revolution: int  # 0 for a motion without samples
    converged: bool
    worst: dict[str, float]
    range: dict[str, tuple[float, float]]
    error: dict[str, float]
    revolutions: int  # run, of all steps, before those that are measured
    periodic: bool
    state: np.ndarray | None  # settled state (2n + r) at -pi

    def doubt(self, name: str) -> float:
        """How far beyond a metric's measured range other revolutions may lie: the error estimate and, for a motion that
        wanders, the width of this range. It is NaN where there is no figure."""
        low, high = self.range[name]
        return self.error[name] + (high - low) * (bool(np.isnan(high - low)) or not self.periodic)

    def __repr__(self) -> str:
        found = "converged" if self.converged else "not converged"
        return (
            f"Converged({found}, bounce {self.worst['bounce_mm']:.4g} mm +- {self.error['bounce_mm']:.2g}, "
            f"jump {self.worst['jump_mm']:.4g} mm, {self.steps_per_revolution} steps a revolution)"
        )


def tolerances(tolerance_um: float, limited: Collection[str] = ()) -> dict[str, float]:
    """Absolute tolerance of every deciding figure, in the unit of its name; `limited`: metrics with a limit."""
    also = {name: value for name, value in WHERE_LIMITED.items() if name in limited}
    return {"bounce_mm": tolerance_um * 1e-3, "jump_mm": tolerance_um * 1e-3, **ABSOLUTE, **also}


def first_steps(train: Train, cam_speed: float) -> int:
    """Steps per revolution to begin with, from the fastest rate of the train with every element acting [rad/s]."""
    return max(FEWEST_STEPS, int(np.ceil(2 * np.pi * highest_rate(train) / cam_speed / COARSEST_PHASE)))


@dataclass(frozen=True)
class Demand:
    """What is asked of the methods of a verdict."""

    tolerance_um: float = 2.0  # by how much a halved step may still move bounce and jump
    halvings: int = 6
    limited: Collection[str] = ()  # metrics with a limit
    certain: bool = False  # go on until the error estimate of a settled bounce, too, is within the tolerance
    position: float = SETTLED_POSITION  # as of `settle`
    settled: bool = True  # else the first revolution from the start is measured
    steps: int | None = None  # per revolution to begin with; they then count as resolving the train
    most: int | None = None  # revolutions to settle at the first step, at most
    stands: int = 2  # halved steps in a row that must leave the figures where they are
    everywhere: bool = True  # all methods look at every speed, else where `camopt.verifier.spot_checks` has them look


def converge(
    prepare: Prepare, train: Train, lift: Lift, cam_speed: float, start: np.ndarray, demand: Demand
) -> Converged:
    """Halve the step until every deciding figure stands twice in a row; all arguments as of `Halving`."""
    return Halving(prepare, train, lift, cam_speed, start, demand).answer()


class Halving:
    """A method's answers at one speed, each with half the step of the one before.

    `start` (2n + r) is the state at rest; a finer step goes on from the coarser one's settled state. There are at most
    `demand.halvings` of them and, after the second, none beyond FINEST_STEPS. The error estimate is MARGIN times the
    largest distance to the coarser answers, COARSER of them at most, and never below FINEST. An aperiodic motion stands
    when it moves by no more than its own range; if the demand is to be certain, its range is then that of RANGED
    revolutions. A halved step takes a step more: were its samples among the coarser
    one's, a contact that closes just before one of them would be as late at every step. A method may ask for more steps
    by an attribute `enough_steps` (train, cam_speed). Nothing converges before the train's slowest mode had time to die
    out.
    """

    def __init__(self, prepare: Prepare, train: Train, lift: Lift, cam_speed: float, start: np.ndarray, demand: Demand):
        first = demand.steps or first_steps(train, cam_speed)
        self._prepare, self._case, self._start, self._demand = prepare, (train, lift, cam_speed), start, demand
        self._first = self._steps = min(first, FINEST_STEPS // 4)
        self._enough = max(first, getattr(prepare, "enough_steps", lambda *_: 0)(train, cam_speed))
        self._allowed = tolerances(demand.tolerance_um, demand.limited)
        self._decay = decay_per_revolution(train, cam_speed)
        self._taken = 0
        self._begin_again()

    def _begin_again(self) -> None:
        self._runs: list[Figures] = []
        self._stood: list[bool] = []
        self._state, self._last, self._faded = self._start, None, False
        self._revolutions, self._measured = 0, 0

    @property
    def ended(self) -> bool:
        """Whether the answer stands, or no finer step is left."""
        return self._stands() or self._taken > self._demand.halvings or self._too_fine()

    @property
    def periodic(self) -> bool:
        """Whether the motion settled at the last step."""
        return self._last is not None and self._last.periodic

    def refine(self) -> None:
        """Takes the next step; where the method refuses it, the one after it begins again from `start`."""
        train, lift, cam_speed = self._case
        self._steps = (self._first << self._taken) + self._taken
        self._taken += 1
        try:
            done = self._run(self._prepare(train, lift, cam_speed, self._steps), lift)
        except MotionRefused:
            self._begin_again()
            return
        self._revolutions += self._measured + done.revolutions
        self._measured, self._faded = done.figures.revolutions + 1, self._faded or done.faded
        self._last, self._state = done, done.state
        self._runs.append(done.figures)
        if len(self._runs) > 1:
            self._stood.append(_unmoved(self._runs[-2], self._runs[-1], self._allowed, done.periodic))

    def answer(self, steps: int | None = None) -> Converged:
        """The answer once it stands or, where a number of `steps` is given, after so many at most."""
        while not self.ended and (steps is None or self._taken < steps):
            self.refine()
        if self._last is None:
            nothing = dict.fromkeys(QUANTITIES, np.nan)
            spread = dict.fromkeys(QUANTITIES, (np.nan, np.nan))
            return Converged(self._steps, False, nothing, spread, nothing, 0, False, None)
        figures = self._runs[-1] if self.periodic or not self._demand.certain else self._ranged()
        worst = {name: figures.worst(name) for name in QUANTITIES}
        spread = {name: figures.range(name) for name in QUANTITIES}
        converged = self._faded and self._stood_enough()
        errors = _errors(self._runs)
        return Converged(self._steps, converged, worst, spread, errors, self._revolutions, self.periodic, self._state)

    def _run(self, revolve: Revolve, lift: Lift) -> Measured:
        if not self._demand.settled:
            first = first_revolution(revolve, self._start)
            return Measured(first.metrics(lift), end_state(first.response), 0, True)
        most = self._demand.most if self._last is None or self.periodic else WANDERING_REVOLUTIONS
        return settle_and_measure(revolve, self._state, lift, most, position=self._demand.position, decay=self._decay)

    def _ranged(self) -> Figures:
        """The figures of a wandering motion at the last step, over so many revolutions that their range holds."""
        train, lift, cam_speed = self._case
        revolve = self._prepare(train, lift, cam_speed, self._steps)
        return settle_and_measure(revolve, self._state, lift, 0, aperiodic=RANGED).figures

    def _stands(self) -> bool:
        if not self._stood_enough():
            return False
        asks = self._demand.certain and self.periodic
        return not (asks and _errors(self._runs)["bounce_mm"] > self._allowed["bounce_mm"])

    def _stood_enough(self) -> bool:
        last = self._stood[-self._demand.stands :]
        return self._steps >= self._enough and len(last) == self._demand.stands and all(last)

    def _too_fine(self) -> bool:
        return self._taken > 2 and self._first << self._taken > FINEST_STEPS


def at_once(many: SettledMany, train: Train, lift: Lift, cam_speed: float, start: np.ndarray) -> Converged:
    """A method's settled motion from `start` (2n + r) where it has no samples whose step could be halved.

    Its errors are those that the method states for motions whose contacts keep; nothing is said to have converged.
    Raises MotionRefused.
    """
    found = many([train], [lift], [cam_speed], starts=start, workers=1)
    at = 0, 0, 0
    if found.refused[at]:
        raise MotionRefused(f"the motion at {cam_speed:g} rad/s is refused")
    worst = {name: float(found.worst(name)[at]) for name in QUANTITIES}
    spread = {name: (float(found.lowest[name][at]), float(found.highest[name][at])) for name in QUANTITIES}
    errors, revolutions = dict(found.errors), int(found.revolutions[at])
    return Converged(0, False, worst, spread, errors, revolutions, bool(found.periodic[at]), found.states[at])


def _errors(runs: list[Figures]) -> dict[str, float]:
    """Error estimate of every metric of the last run; infinite where there is no other."""
    found = {}
    for name in QUANTITIES:
        moved = [apart(r.worst(name), runs[-1].worst(name)) for r in runs[-COARSER - 1 : -1]]
        found[name] = max(FINEST[name], MARGIN * max(moved, default=np.inf))
    return found


def apart(one: float, other: float) -> float:
    """Distance of two figures; not seating (NaN) in both is the same answer, in one of them another one."""
    if np.isnan(one) or np.isnan(other):
        return 0.0 if np.isnan(one) and np.isnan(other) else np.inf
    return abs(one - other)


def _unmoved(before: Figures, after: Figures, allowed: dict[str, float], periodic: bool) -> bool:
    """Whether halving the step left every deciding figure where it was.

    That the valve does not seat is an answer of its own, which needs no figure: it stands wherever both steps give it.
    """
    if np.isnan(before.worst("bounce_mm")) and np.isnan(after.worst("bounce_mm")):
        return True
    for name, absolute in allowed.items():
        old, new = before.worst(name), after.worst(name)
        low, high = after.range(name)
        width = 0.0 if periodic else high - low
        if apart(new, old) > absolute + RELATIVE * np.nan_to_num(abs(new)) + np.nan_to_num(width):
            return False
    return True
