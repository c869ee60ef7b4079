"""One method at one speed: its step is halved until the metrics converge, and the error of each is estimated."""

from collections.abc import Callable, Collection
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from camopt.cam.lift import Lift
from camopt.measure.settling import Figures, Measured, decay_per_revolution, first_revolution, settle_and_measure
from camopt.measure.sweep import SettledMany
from camopt.scene.errors import MotionRefused
from camopt.scene.quantities import LESS_IS_WORSE, QUANTITIES
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
"""Steps per revolution beyond which a step is not halved again, for memory and time. A train that would begin beyond a
quarter of it begins there, and does not converge before its fastest rate is resolved: Houbolt's method, stable at every
step, would damp it out and converge to a wrong force."""
RELATIVE = 0.01
"""A metric has converged when a halved step changes it by less than its absolute tolerance plus this share of it."""
ABSOLUTE = {"seating_velocity_m_per_s": 0.005, "contact_force_max_N": 5.0, "dynamic_area_mm_deg": 0.1}
"""Tolerances beside those of bounce and jump, which the caller chooses. Other metrics depend on contacts that barely
open; they are reported with their error."""
MARGIN, COARSER = 2.0, 3
"""An estimated error is MARGIN times the largest distance to the last COARSER answers. Across contacts a method without
their instants has no order of convergence: its error is a uniformly distributed fraction of the step, and exceeds twice
the largest distance to two coarser answers once in 24 times, and to three of them once in 250."""
WHERE_LIMITED = {"jump_deg": 0.5, "contact_force_min_N": 5.0}
"""Tolerances of the metrics that decide only where the scene limits them. Impact velocity and excess lift never are."""
WANDERING_REVOLUTIONS = 16
"""Settling limit after a coarser step that did not settle; start-up transients have already decayed."""

FINEST = {
    q.name: {"mm": 1e-5, "deg": 1e-3, "N": 1e-2, "m/s": 1e-5, "mm deg": 1e-3}[q.unit] for q in QUANTITIES.values()
}
"""Least error that is stated: settling, extremes of cubics and rounding leave it."""


@dataclass(frozen=True, repr=False)
class Converged:
    """A method's answer at one speed: the range of every metric over the measured revolutions of the finest step, and
    how much the last halvings changed it. All are NaN where the method refused every step."""

    steps_per_revolution: int  # 0 for a motion without samples
    converged: bool
    range: dict[str, tuple[float, float]]
    error: dict[str, float]
    revolutions: int  # run, of all steps, before those that are measured
    periodic: bool
    state: np.ndarray | None  # settled state (2n + r) at -pi

    @cached_property
    def worst(self) -> dict[str, float]:
        """The worst revolution's value of every metric."""
        return {name: ends[0 if name in LESS_IS_WORSE else 1] for name, ends in self.range.items()}

    def doubt(self, name: str) -> float:
        """How far beyond a metric's range other revolutions may lie: the error estimate and, for an aperiodic motion,
        the width of this range. It is NaN where the metric has no value."""
        low, high = self.range[name]
        return self.error[name] + (high - low) * (bool(np.isnan(high - low)) or not self.periodic)

    def __repr__(self) -> str:
        outcome = "converged" if self.converged else "not converged"
        return (
            f"Converged({outcome}, bounce {self.worst['bounce_mm']:.4g} mm +- {self.error['bounce_mm']:.2g}, "
            f"jump {self.worst['jump_mm']:.4g} mm, {self.steps_per_revolution} steps a revolution)"
        )


def first_steps(train: Train, cam_speed: float) -> int:
    """Steps per revolution to begin with, from the fastest rate of the train with every element acting [rad/s]."""
    return max(FEWEST_STEPS, int(np.ceil(2 * np.pi * highest_rate(train) / cam_speed / COARSEST_PHASE)))


@dataclass(frozen=True)
class Tolerances:
    """When a method's metrics count as converged, and how far it may go for that."""

    tolerance_um: float = 2.0  # by how much a halved step may still move bounce and jump
    halvings: int = 6
    limited: Collection[str] = ()  # metrics with a limit
    certain: bool = False  # go on until the error estimate of a settled bounce, too, is within the tolerance
    position: float = SETTLED_POSITION  # as of `settle`
    settled: bool = True  # else the first revolution from the start is measured
    steps: int | None = None  # per revolution to begin with; they then count as resolving the train
    most: int | None = None  # revolutions to settle at the first step, at most
    stands: int = 2  # halved steps in a row that must leave the metrics where they are
    everywhere: bool = True  # all methods judge every speed, else those that `camopt.verifier.spot_checks` chooses

    @property
    def absolute(self) -> dict[str, float]:
        """Absolute tolerance of every deciding metric, in the unit of its name."""
        also = {name: value for name, value in WHERE_LIMITED.items() if name in self.limited}
        return {"bounce_mm": self.tolerance_um * 1e-3, "jump_mm": self.tolerance_um * 1e-3, **ABSOLUTE, **also}


class StepRefinement:
    """A method's answers at one speed, each with half the step of the one before.

    `start` (2n + r) is the state at rest; a finer step continues from the coarser one's settled state. There are at
    most `tolerances.halvings` of them and, after the second, none beyond FINEST_STEPS. An aperiodic motion has
    converged when it changes by no more than its own range; with `tolerances.certain` its range is then that of RANGED
    revolutions, which `many`, where it is given, measures without samples of the finest step. A halved step takes one
    step more: were its samples among the coarser one's, a contact that closes just before one of them would be as late
    at every step. A method may require more steps by an attribute `enough_steps` (train, cam_speed). Nothing converges
    before the train's slowest mode had time to decay.
    """

    def __init__(
        self,
        prepare: Prepare,
        train: Train,
        lift: Lift,
        cam_speed: float,
        start: np.ndarray,
        tolerances: Tolerances,
        many: SettledMany | None = None,
    ):
        first = tolerances.steps or first_steps(train, cam_speed)
        self._prepare, self._case, self._start, self._tolerances = prepare, (train, lift, cam_speed), start, tolerances
        self._many = many
        self._first = self._steps = min(first, FINEST_STEPS // 4)
        self._enough = max(first, getattr(prepare, "enough_steps", lambda *_: 0)(train, cam_speed))
        self._allowed = tolerances.absolute
        self._decay = decay_per_revolution(train, cam_speed)
        self._taken = 0
        self._begin_again()

    def _begin_again(self) -> None:
        self._runs: list[Figures] = []
        self._unmoved_steps: list[bool] = []
        self._state, self._last, self._faded = self._start, None, False
        self._revolutions, self._measured = 0, 0

    @property
    def ended(self) -> bool:
        """Whether the metrics have converged, or no finer step is left."""
        too_fine = self._taken > 2 and self._first << self._taken > FINEST_STEPS
        if self._taken > self._tolerances.halvings or too_fine:
            return True
        certain = self._tolerances.certain and self.periodic
        exact = not certain or _errors(self._runs)["bounce_mm"] <= self._allowed["bounce_mm"]
        return self._unmoved_enough() and exact

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
            self._unmoved_steps.append(_unmoved(self._runs[-2], self._runs[-1], self._allowed, done.periodic))

    def answer(self, steps: int | None = None) -> Converged:
        """The answer once the metrics have converged or, where a number of `steps` is given, after so many at most."""
        while not self.ended and (steps is None or self._taken < steps):
            self.refine()
        if self._last is None:
            spread, errors = dict.fromkeys(QUANTITIES, (np.nan, np.nan)), dict.fromkeys(QUANTITIES, np.nan)
            return Converged(self._steps, False, spread, errors, 0, False, None)
        figures = self._runs[-1] if self.periodic or not self._tolerances.certain else self._ranged()
        spread, errors = {name: figures.range(name) for name in QUANTITIES}, _errors(self._runs)
        converged = self._faded and self._unmoved_enough()
        return Converged(self._steps, converged, spread, errors, self._revolutions, self.periodic, self._state)

    def _run(self, revolve: Revolve, lift: Lift) -> Measured:
        if not self._tolerances.settled:
            first = first_revolution(revolve, self._start)
            return Measured(first.metrics(lift), end_state(first.response), 0, True)
        most = self._tolerances.most if self._last is None or self.periodic else WANDERING_REVOLUTIONS
        return settle_and_measure(
            revolve, self._state, lift, most, position=self._tolerances.position, decay=self._decay
        )

    def _ranged(self) -> Figures:
        """The metrics of an aperiodic motion at the last step, over so many revolutions that their range is known."""
        train, lift, cam_speed = self._case
        if self._many is not None:
            many = partial(self._many, most=0, aperiodic=RANGED)
            return figures_of(at_once(many, train, lift, cam_speed, self._state))
        revolve = self._prepare(train, lift, cam_speed, self._steps)
        return settle_and_measure(revolve, self._state, lift, 0, aperiodic=RANGED).figures

    def _unmoved_enough(self) -> bool:
        last = self._unmoved_steps[-self._tolerances.stands :]
        return self._steps >= self._enough and len(last) == self._tolerances.stands and all(last)


def at_once(many: SettledMany, train: Train, lift: Lift, cam_speed: float, start: np.ndarray) -> Converged:
    """A method's settled motion from `start` (2n + r) by `many`, which has no step that could be halved: not converged.

    Its errors are those that `many` states for motions whose contacts do not switch. Raises MotionRefused.
    """
    settled = many([train], [lift], [cam_speed], starts=start, workers=1)
    at = 0, 0, 0
    if settled.refused[at]:
        raise MotionRefused(f"the motion at {cam_speed:g} rad/s is refused")
    spread = {name: (float(settled.lowest[name][at]), float(settled.highest[name][at])) for name in QUANTITIES}
    errors, revolutions = dict(settled.errors), int(settled.revolutions[at])
    return Converged(0, False, spread, errors, revolutions, bool(settled.periodic[at]), settled.states[at])


def figures_of(answer: Converged) -> Figures:
    """Both ends of the range of every metric of an answer, in place of its revolutions."""
    return Figures({name: np.array(ends) for name, ends in answer.range.items()})


def _errors(runs: list[Figures]) -> dict[str, float]:
    """Error estimate of every metric of the last run; infinite where there is no other."""
    errors = {}
    for name in QUANTITIES:
        changes = [apart(r.worst(name), runs[-1].worst(name)) for r in runs[-COARSER - 1 : -1]]
        errors[name] = max(FINEST[name], MARGIN * max(changes, default=np.inf))
    return errors


def apart(one: float, other: float) -> float:
    """Distance of two values of a metric: zero where both are NaN (the valve does not seat), infinite where one is."""
    if np.isnan(one) or np.isnan(other):
        return 0.0 if np.isnan(one) and np.isnan(other) else np.inf
    return abs(one - other)


def _unmoved(before: Figures, after: Figures, allowed: dict[str, float], periodic: bool) -> bool:
    """Whether halving the step changed no deciding metric beyond its tolerance.

    That the valve does not seat is an answer of its own, without values: it has converged where both steps give it.
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
