"""Step halving of one method at one speed until its metrics converge, with an error estimate of each metric."""

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
"""A method: returns, for train, lift, cam speed [rad/s] and steps per revolution, the integrator of one revolution."""

COARSEST_PHASE = 0.6
"""Highest frequency times the first step [rad]: well inside the stability limits of the explicit methods."""
FEWEST_STEPS = 1440
FINEST_STEPS = 120_000
"""Steps per revolution beyond which the step is not halved again, to limit memory and time. The coarsest step has at
most a quarter of this number. If that is too few for the train's fastest rate, the metrics do not count as converged
before it is resolved: Houbolt's method, which is stable at every step, would damp it and converge to a wrong force."""
RELATIVE = 0.01
"""A metric has converged when a halved step changes it by less than its absolute tolerance plus this share of it."""
ABSOLUTE = {"seating_velocity_m_per_s": 0.005, "contact_force_max_N": 5.0, "dynamic_area_mm_deg": 0.1}
"""Absolute tolerances of the deciding metrics other than bounce and jump, whose tolerance the caller chooses. The
remaining metrics depend on contacts that barely open; they are reported with their error."""
MARGIN, COARSER = 2.0, 3
"""The estimated error is MARGIN times the largest difference from the last COARSER answers. Without locating the
switching of contacts a method has no order of convergence across it: its error is a uniformly distributed fraction of
the step, and exceeds twice the largest difference from two coarser answers once in 24 times, from three once in 250."""
WHERE_LIMITED = {"jump_deg": 0.5, "contact_force_min_N": 5.0}
"""Absolute tolerances of metrics that decide only if limited; scenes cannot limit impact velocity and excess lift."""
WANDERING_REVOLUTIONS = 16
"""Most revolutions to settle after a coarser step that did not settle: start-up transients have already decayed."""

FINEST = {
    q.name: {"mm": 1e-5, "deg": 1e-3, "N": 1e-2, "m/s": 1e-5, "mm deg": 1e-3}[q.unit] for q in QUANTITIES.values()
}
"""Smallest stated error, in the metric's unit: settling, extremes of cubics and rounding cause errors of this size."""


@dataclass(frozen=True, repr=False)
class Converged:
    """A method's answer at one speed: the range of every metric over the measured revolutions of the finest step, and
    its error, estimated from the last halvings. All are NaN if the method refused every step."""

    steps_per_revolution: int  # 0 for a motion that was measured without samples
    converged: bool
    range: dict[str, tuple[float, float]]
    error: dict[str, float]
    revolutions: int  # simulated before the measured ones, over all steps
    periodic: bool
    state: np.ndarray | None  # settled state (2n + r) at -pi

    @cached_property
    def worst(self) -> dict[str, float]:
        """The worst revolution's value of every metric."""
        return {name: ends[0 if name in LESS_IS_WORSE else 1] for name, ends in self.range.items()}

    def doubt(self, name: str) -> float:
        """Uncertainty of a metric: its error estimate plus, for an aperiodic motion, the width of its range. Other
        revolutions may lie so far outside the range. It is NaN if the metric has no value."""
        low, high = self.range[name]
        return self.error[name] + (high - low) * (bool(np.isnan(high - low)) or not self.periodic)

    def __repr__(self) -> str:
        outcome = "converged" if self.converged else "not converged"
        return (
            f"Converged({outcome}, bounce {self.worst['bounce_mm']:.4g} mm +- {self.error['bounce_mm']:.2g}, "
            f"jump {self.worst['jump_mm']:.4g} mm, {self.steps_per_revolution} steps a revolution)"
        )


def first_steps(train: Train, cam_speed: float) -> int:
    """Steps per revolution of the coarsest step, from the train's highest rate [rad/s] with every element acting."""
    return max(FEWEST_STEPS, int(np.ceil(2 * np.pi * highest_rate(train) / cam_speed / COARSEST_PHASE)))


@dataclass(frozen=True)
class Tolerances:
    """When a method's metrics count as converged, and how many steps and revolutions it may take."""

    tolerance_um: float = 2.0  # largest change of bounce and jump by a halved step
    halvings: int = 6
    limited: Collection[str] = ()  # metrics with a limit
    reported: bool = False  # the metrics are reported: the error estimate of bounce must be within tolerance, too
    position: float = SETTLED_POSITION  # [m], as in `settle`
    settled: bool = True  # otherwise the first revolution from the start state is measured
    steps: int | None = None  # per revolution at the coarsest step; taken to resolve the train
    most: int | None = None  # most revolutions to settle at the first step
    unchanged_halvings: int = 2  # consecutive ones that must leave the metrics unchanged within tolerance
    spot_checks: bool = False  # all methods judge only the speeds that `camopt.verifier.spot_checks` chooses

    @property
    def absolute(self) -> dict[str, float]:
        """Absolute tolerance of every deciding metric, in the unit of its name."""
        also = {name: value for name, value in WHERE_LIMITED.items() if name in self.limited}
        return {"bounce_mm": self.tolerance_um * 1e-3, "jump_mm": self.tolerance_um * 1e-3, **ABSOLUTE, **also}


class StepRefinement:
    """A method's answers at one speed, each with half the step of the one before.

    `start` (2n + r) is the state at rest; a finer step continues from the settled state of the coarser one. The step is
    halved at most `tolerances.halvings` times and, after the second halving, not beyond FINEST_STEPS. An aperiodic
    motion has converged when its metrics change by no more than their own range; with `tolerances.reported` this range
    is then taken over RANGED revolutions, which `many`, if given, measures without the samples of the finest step. The
    finer step has one step per revolution more than twice the coarser one: if its samples included those of the coarser
    step, a contact that closes just before one of them would be equally late at every step. A method may require more
    steps by an attribute `enough_steps` (train, cam_speed). The metrics do not count as converged before the train's
    slowest mode has had time to decay.
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
        self._unchanged_steps: list[bool] = []
        self._state, self._last, self._faded = self._start, None, False
        self._revolutions, self._measured = 0, 0

    @property
    def ended(self) -> bool:
        """Whether the metrics have converged or no finer step is allowed."""
        too_fine = self._taken > 2 and self._first << self._taken > FINEST_STEPS
        if self._taken > self._tolerances.halvings or too_fine:
            return True
        reported = self._tolerances.reported and self.periodic
        accurate = not reported or _errors(self._runs)["bounce_mm"] <= self._allowed["bounce_mm"]
        return self._unchanged_enough() and accurate

    @property
    def periodic(self) -> bool:
        """Whether the motion settled at the last step."""
        return self._last is not None and self._last.periodic

    def refine(self) -> None:
        """Run the next finer step. If the method refuses it, the step after it begins again from `start`."""
        train, lift, cam_speed = self._case
        self._steps = (self._first << self._taken) + self._taken
        self._taken += 1
        try:
            settled = self._run(self._prepare(train, lift, cam_speed, self._steps), lift)
        except MotionRefused:
            self._begin_again()
            return
        self._revolutions += self._measured + settled.revolutions
        self._measured, self._faded = settled.figures.revolutions + 1, self._faded or settled.faded
        self._last, self._state = settled, settled.state
        self._runs.append(settled.figures)
        if len(self._runs) > 1:
            self._unchanged_steps.append(_unchanged(self._runs[-2], self._runs[-1], self._allowed, settled.periodic))

    def answer(self, steps: int | None = None) -> Converged:
        """Refine until the metrics have converged, or at most `steps` times if given, and return the answer."""
        while not self.ended and (steps is None or self._taken < steps):
            self.refine()
        if self._last is None:
            spread, errors = dict.fromkeys(QUANTITIES, (np.nan, np.nan)), dict.fromkeys(QUANTITIES, np.nan)
            return Converged(self._steps, False, spread, errors, 0, False, None)
        figures = self._runs[-1] if self.periodic or not self._tolerances.reported else self._ranged()
        spread, errors = {name: figures.range(name) for name in QUANTITIES}, _errors(self._runs)
        converged = self._faded and self._unchanged_enough()
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
        """The metrics of an aperiodic motion at the last step over RANGED revolutions, which give their range."""
        train, lift, cam_speed = self._case
        if self._many is not None:
            many = partial(self._many, most=0, aperiodic=RANGED)
            return figures_of(at_once(many, train, lift, cam_speed, self._state))
        revolve = self._prepare(train, lift, cam_speed, self._steps)
        return settle_and_measure(revolve, self._state, lift, 0, aperiodic=RANGED).figures

    def _unchanged_enough(self) -> bool:
        last, needed = self._unchanged_steps, self._tolerances.unchanged_halvings
        return self._steps >= self._enough and len(last) >= needed and all(last[-needed:])


def at_once(many: SettledMany, train: Train, lift: Lift, cam_speed: float, start: np.ndarray) -> Converged:
    """A method's settled motion from `start` (2n + r), measured by `many`, which has no step to halve.

    It does not count as converged; its errors hold for motions whose contacts do not switch. Raises MotionRefused.
    """
    settled = many([train], [lift], [cam_speed], starts=start, workers=1)
    at = 0, 0, 0
    if settled.refused[at]:
        raise MotionRefused(f"the motion at {cam_speed:g} rad/s is refused")
    spread = {name: (float(settled.lowest[name][at]), float(settled.highest[name][at])) for name in QUANTITIES}
    errors, revolutions = dict(settled.errors), int(settled.revolutions[at])
    return Converged(0, False, spread, errors, revolutions, bool(settled.periodic[at]), settled.states[at])


def figures_of(answer: Converged) -> Figures:
    """An answer as Figures of two revolutions: the lower and the upper end of the range of every metric."""
    return Figures({name: np.array(ends) for name, ends in answer.range.items()})


def _errors(runs: list[Figures]) -> dict[str, float]:
    """Error estimate of every metric of the last run; infinite if there is no earlier run."""
    errors = {}
    for name in QUANTITIES:
        changes = [apart(r.worst(name), runs[-1].worst(name)) for r in runs[-COARSER - 1 : -1]]
        errors[name] = max(FINEST[name], MARGIN * max(changes, default=np.inf))
    return errors


def apart(a: float, b: float) -> float:
    """Difference of two values of a metric: zero if both are NaN (the valve does not seat), infinite if only one is."""
    if np.isnan(a) or np.isnan(b):
        return 0.0 if np.isnan(a) and np.isnan(b) else np.inf
    return abs(a - b)


def _unchanged(before: Figures, after: Figures, allowed: dict[str, float], periodic: bool) -> bool:
    """Whether halving the step changed no deciding metric beyond its tolerance.

    If the valve does not seat at either step, the metrics have no values and count as unchanged.
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
