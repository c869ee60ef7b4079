"""Is an answer right, said to be uncertain, or wrong without a warning? It is judged against event-exact motion.

An answer is what `camopt.verifier.convergence` gives for a method, here for the first revolution from rest. The motion
is computed once more from a start that is 1e-9 m away: where a figure changes much by that, the motion itself
multiplies the smallest errors, and no method can be asked for the figure.
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
"""Tolerance of bounce and jump [um], as at `standard`; `camopt.verifier.convergence.ABSOLUTE` has the others."""
DISTURBANCE, DISTURBED = 1e-9, 2
"""Change of the start [m] that shows what the motion itself makes of any error, and how often it is drawn."""
SENSITIVE = 0.1
"""Share of the tolerance that the disturbance may use up. Beyond it, 1e-8 m at the start would cost more than the
tolerance, and methods that locate no switching are wrong by some 1e-8 m at each."""
SAMPLES = 3600, FINEST_STEPS // 4
"""Smallest and largest number of samples per revolution with which the reference begins, to resolve its force peaks."""
WITHIN, RANGE, NOT_CONVERGED = "within tolerance", "range", "not converged"
REFUSED, WRONG = "refused", "wrong"
VERDICTS = WITHIN, RANGE, NOT_CONVERGED, REFUSED, WRONG
"""From best to worst: the answer is within tolerance; it is beyond in figures whose error the motion itself makes of
the smallest disturbance; it is beyond, and the method says so; there is a reason but no answer; it is beyond although
the method calls itself converged, which is a defect."""


@dataclass(frozen=True)
class Truth:
    """Deciding figures by name, the error that each of them may have, and how far a disturbed start moves them."""

    figures: dict[str, float]
    allowed: dict[str, float]
    spread: dict[str, float]
    answer: Converged

    def sensitive(self, name: str) -> bool:
        """Whether no method can be asked for the figure: the motion multiplies any disturbance."""
        return self.spread[name] > SENSITIVE * self.allowed[name]


def first_answer(
    prepare: Prepare, train: Train, lift: Lift, cam_speed: float, halvings: int = 4, steps: int | None = None
) -> Converged:
    """A method's figures of the first revolution from rest; `cam_speed` is in rad/s, `steps` as of `Tolerances`."""
    start = state_at_rest(train)
    tolerances = Tolerances(TOLERANCE_UM, halvings, settled=False, steps=steps)
    return StepRefinement(prepare, train, lift, cam_speed, start, tolerances).answer()


def truth(prepare: Prepare, train: Train, lift: Lift, cam_speed: float) -> Truth:
    """The reference by a method that locates switchings; raises MotionRefused also where only its finest step does."""
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
    for _ in range(DISTURBED):
        moved = start.copy()
        moved[:n] += DISTURBANCE * rng.choice([-1.0, 1.0], n)
        moved = first_revolution(revolve, moved).metrics(lift)
        spread = {name: max(spread[name], apart(moved.worst(name), still.worst(name))) for name in figures}
    allowed = {name: t + RELATIVE * abs(np.nan_to_num(figures[name])) for name, t in absolute.items()}
    return Truth(figures, allowed, spread, answer)


def samples(first: int) -> int:
    """Samples per revolution with which a locating method begins, given the number of first steps of the others."""
    return int(np.clip(first, *SAMPLES))


def doubtful_figure(true: Truth) -> tuple[str, float]:
    """The figure whose last steps differ most, and that difference as a share of its tolerance and its disturbance."""
    error, spread = true.answer.error, true.spread
    shares = {q: error[q] / (true.allowed[q] + spread[q]) if np.isfinite(error[q]) else np.inf for q in true.figures}
    name = max(shares, key=lambda q: shares[q])
    return name, shares[name]


def judge(answer: Converged, true: Truth) -> tuple[str, str, float]:
    """(verdict, the figure that uses most of its tolerance, its error in the unit of its name).

    A figure that seats in one answer only is infinitely far off; where the method's own error estimate of it is
    infinite too, it is not wrong without a warning, and any other figure can still be.
    """
    if answer.state is None:
        return REFUSED, "", np.nan
    off = {name: apart(answer.worst[name], true.figures[name]) for name in true.figures}
    excess = {name: off[name] / true.allowed[name] for name in off}
    name = max(excess, key=lambda q: excess[q])
    if excess[name] <= 1.0:
        return WITHIN, name, off[name]
    astray = [q for q in off if excess[q] > 1.0 and not true.sensitive(q)]
    if not astray:
        return RANGE, name, off[name]
    said = {q: true.allowed[q] + answer.error[q] for q in astray}
    untold = [q for q in astray if not off[q] <= said[q]]
    if not answer.converged or not untold:
        return NOT_CONVERGED, name, off[name]
    worst = max(untold, key=lambda q: off[q] / said[q])
    return WRONG, worst, off[worst]
