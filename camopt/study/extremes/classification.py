"""Classification of an answer as right, declared uncertain, or wrong without a warning, against event-exact motion.

An answer is what `camopt.verifier.convergence` gives for a method, here for the first revolution from rest. The motion
is computed again from a start that is 1e-9 m away. Where this changes a metric strongly, the motion itself amplifies
the smallest errors, and no method can be expected to compute the metric.
"""

from dataclasses import dataclass

import numpy as np

from camopt.cam.lift import Lift
from camopt.measure.settling import first_revolution
from camopt.scene import MotionRefused, Train, state_at_rest
from camopt.verifier.convergence import (
    FINEST_STEPS,
    RELATIVE,
    Converged,
    Prepare,
    StepRefinement,
    Tolerances,
    apart,
    first_steps,
)

TOLERANCE_UM = 2.0
"""Tolerance of bounce and jump [um], as at `standard`; `camopt.verifier.convergence.ABSOLUTE` holds the others."""
DISTURBANCE, DISTURBANCES = 1e-9, 2
"""Disturbance of the start [m], which shows how the motion amplifies errors, and the number of random disturbances."""
SENSITIVE = 0.1
"""Share of the tolerance above which the effect of the disturbance makes a metric sensitive. An error of 1e-8 m at the
start would then exceed the tolerance, and methods that do not locate switchings make errors of about 1e-8 m at each."""
SAMPLES = 3600, FINEST_STEPS // 4
"""Range of the reference's first number of samples per revolution, which must resolve its force peaks."""
WITHIN, RANGE, NOT_CONVERGED = "within tolerance", "range", "not converged"
REFUSED, WRONG = "refused", "wrong"
VERDICTS = WITHIN, RANGE, NOT_CONVERGED, REFUSED, WRONG
"""Verdicts from best to worst: the answer is within tolerance; it is outside in sensitive metrics only; it is outside,
and the method reports this (as not converged, or by its error estimate); the method refuses, with a reason; it is
outside although the method claims to have converged, which is a defect."""


@dataclass(frozen=True)
class Truth:
    """The deciding metrics by name, their tolerances, and the changes of the metrics by a disturbed start."""

    figures: dict[str, float]
    allowed: dict[str, float]
    spread: dict[str, float]
    answer: Converged

    def sensitive(self, name: str) -> bool:
        """Whether the motion amplifies any disturbance so far that no method can be expected to compute the metric."""
        return self.spread[name] > SENSITIVE * self.allowed[name]


def first_answer(
    prepare: Prepare, train: Train, lift: Lift, cam_speed: float, halvings: int = 4, steps: int | None = None
) -> Converged:
    """A method's metrics of the first revolution from rest; `cam_speed` is in rad/s, `steps` as in `Tolerances`."""
    start = state_at_rest(train)
    tolerances = Tolerances(TOLERANCE_UM, halvings, settled=False, steps=steps)
    return StepRefinement(prepare, train, lift, cam_speed, start, tolerances).answer()


def truth(prepare: Prepare, train: Train, lift: Lift, cam_speed: float) -> Truth:
    """The reference by a method that locates switchings; raises MotionRefused where its finest step is refused."""
    count = samples(first_steps(train, cam_speed))
    answer = first_answer(prepare, train, lift, cam_speed, 2, count)
    if answer.state is None:
        raise MotionRefused(
            f"the reference refuses the motion at its finest step, {answer.steps_per_revolution} a revolution"
        )
    revolve = prepare(train, lift, cam_speed, count)
    start, n, rng = state_at_rest(train), len(train.mass), np.random.default_rng(0)
    absolute = Tolerances(TOLERANCE_UM).absolute
    figures = {name: answer.worst[name] for name in absolute}
    still = first_revolution(revolve, start).metrics(lift)
    spread = dict.fromkeys(figures, 0.0)
    for _ in range(DISTURBANCES):
        moved = start.copy()
        moved[:n] += DISTURBANCE * rng.choice([-1.0, 1.0], n)
        moved = first_revolution(revolve, moved).metrics(lift)
        spread = {name: max(spread[name], apart(moved.worst(name), still.worst(name))) for name in figures}
    allowed = {name: t + RELATIVE * abs(np.nan_to_num(figures[name])) for name, t in absolute.items()}
    return Truth(figures, allowed, spread, answer)


def samples(first: int) -> int:
    """First number of samples per revolution of a locating method, from that of the steps of other methods."""
    return int(np.clip(first, *SAMPLES))


def doubtful_figure(true: Truth) -> tuple[str, float]:
    """The metric with the largest estimated error over the sum of tolerance and disturbance, and this quotient."""
    error, spread = true.answer.error, true.spread
    shares = {q: error[q] / (true.allowed[q] + spread[q]) if np.isfinite(error[q]) else np.inf for q in true.figures}
    name = max(shares, key=lambda q: shares[q])
    return name, shares[name]


def judge(answer: Converged, true: Truth) -> tuple[str, str, float]:
    """The verdict, the metric with the largest error relative to its tolerance, and this error in the metric's unit.

    A metric that has a value in only one of the two answers has an infinite error; where the method's own error
    estimate is infinite too, this metric is not wrong without a warning, though another metric may be.
    """
    if answer.state is None:
        return REFUSED, "", np.nan
    error = {name: apart(answer.worst[name], true.figures[name]) for name in true.figures}
    excess = {name: error[name] / true.allowed[name] for name in error}
    name = max(excess, key=lambda q: excess[q])
    if excess[name] <= 1.0:
        return WITHIN, name, error[name]
    outside = [q for q in error if excess[q] > 1.0 and not true.sensitive(q)]
    if not outside:
        return RANGE, name, error[name]
    declared = {q: true.allowed[q] + answer.error[q] for q in outside}
    undeclared = [q for q in outside if not error[q] <= declared[q]]
    if not answer.converged or not undeclared:
        return NOT_CONVERGED, name, error[name]
    worst = max(undeclared, key=lambda q: error[q] / declared[q])
    return WRONG, worst, error[worst]
