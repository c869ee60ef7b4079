"""Is an answer right, told to be uncertain, or wrong without a warning? Judged against event-exact at several steps.

An answer is what `camopt.verifier.convergence` makes of a method, here for the first revolution from rest: every figure
that limits read, an error estimate from halved steps, and whether it converged. The truth is event-exact's finest step;
how far a start moved by 1e-9 m moves it says what no method can be asked for.
"""

from dataclasses import dataclass

import numpy as np

from camopt.cam.lift import Lift
from camopt.measure.settling import first_revolution
from camopt.scene import Train, rest_position
from camopt.verifier.convergence import (
    MOST_STEPS,
    RELATIVE,
    Converged,
    Prepare,
    apart,
    converge,
    first_steps,
    tolerances,
)

TOLERANCE_UM = 2.0
"""What `standard` asks of bounce and jump; the other figures have `camopt.verifier.convergence.ABSOLUTE`."""
DISTURBANCE = 1e-9
"""Change of the start [m] that tells an error of the method from one that the motion makes of anything."""
DISTURBED = 2
SENSITIVE = 0.1
"""Share of the allowance that the disturbance may use up: beyond it 1e-8 m at the start are more than allowed, and
methods that locate no switching, off by some 1e-8 m at each, can only wander."""
SAMPLES = 3600, MOST_STEPS // 4
"""Fewest and most samples per revolution that the reference begins with: they resolve the peaks of its forces."""
WITHIN, RANGE, NOT_CONVERGED, REFUSED, WRONG = VERDICTS = (
    "within tolerance",
    "range",
    "not converged",
    "refused",
    "wrong",
)
"""In tolerance; beyond it in figures that the motion itself makes of a hair; beyond it, and the method says so; no
answer, with a reason; beyond it although the method calls itself converged: a defect."""


@dataclass(frozen=True)
class Truth:
    """Deciding figures by name, what they are allowed to be off, and what a disturbed start makes of them."""

    figures: dict[str, float]
    allowed: dict[str, float]
    spread: dict[str, float]
    answer: Converged
    train: Train

    def sensitive(self, name: str) -> bool:
        """Whether no method can be asked for the figure: the motion multiplies any disturbance."""
        return self.spread[name] > SENSITIVE * self.allowed[name]


def at_rest(train: Train) -> np.ndarray:
    """State (2n) at rest on the base circle."""
    position = rest_position(train)
    return np.concatenate([position, np.zeros_like(position)])


def first_answer(
    prepare: Prepare, train: Train, lift: Lift, cam_speed: float, halvings: int = 4, steps: int | None = None
) -> Converged:
    """A method's figures of the first revolution from rest; `cam_speed` [rad/s], `steps` as of `converge`."""
    start = at_rest(train)
    return converge(prepare, train, lift, cam_speed, start, TOLERANCE_UM, halvings, settled=False, steps=steps)


def truth(prepare: Prepare, train: Train, lift: Lift, cam_speed: float) -> Truth:
    """The reference by a method that locates switchings. Raises MotionRefused where it refuses the motion."""
    count = samples(first_steps(train, cam_speed))
    answer = first_answer(prepare, train, lift, cam_speed, 2, count)
    revolve = prepare(train, lift, cam_speed, count)
    start, n = at_rest(train), len(train.mass)
    rng = np.random.default_rng(0)
    figures = {name: answer.worst[name] for name in tolerances(TOLERANCE_UM)}
    still = first_revolution(revolve, start).metrics(lift)
    spread = dict.fromkeys(figures, 0.0)
    for _ in range(DISTURBED):
        away = np.append(DISTURBANCE * rng.choice([-1.0, 1.0], n), np.zeros(n))
        moved = first_revolution(revolve, start + away).metrics(lift)
        spread = {name: max(spread[name], apart(moved.worst(name), still.worst(name))) for name in figures}
    allowed = {name: t + RELATIVE * abs(np.nan_to_num(figures[name])) for name, t in tolerances(TOLERANCE_UM).items()}
    return Truth(figures, allowed, spread, answer, train)


def samples(first: int) -> int:
    """Samples per revolution that a locating method begins with, from the first steps of the others."""
    return int(np.clip(first, *SAMPLES))


def doubtful_figure(true: Truth) -> tuple[str, float]:
    """The figure whose steps are furthest apart, as a share of what is allowed and of what 1e-9 m makes of it."""
    shares = {name: true.answer.error[name] / (true.allowed[name] + true.spread[name]) for name in true.figures}
    name = max(shares, key=lambda q: shares[q])
    return name, shares[name]


def judge(answer: Converged, true: Truth) -> tuple[str, str, float]:
    """Verdict, the figure that is off by most of what it is allowed, and by how much, in the unit of its name."""
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
    told = {q: off[q] / (true.allowed[q] + answer.error[q]) for q in astray}
    if not answer.converged or max(told.values()) <= 1.0:
        return NOT_CONVERGED, name, off[name]
    worst = max(told, key=lambda q: told[q])
    return WRONG, worst, off[worst]
