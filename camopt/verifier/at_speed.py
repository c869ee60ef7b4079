"""The verdict at one speed: whether the methods agree and every limit on the motion holds over the neighbourhood.

The step of every method is halved until its metrics have converged. If a limit is violated far beyond every error
estimate, event-exact once, one other method at its first step with the same outcome, and the neighbourhood suffice.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from camopt.cam.lift import Lift
from camopt.measure.limits import motion_limits
from camopt.measure.settling import Figures, decay_per_revolution, settle_and_measure
from camopt.measure.sweep import SettledMany
from camopt.scene.errors import MotionRefused
from camopt.scene.laws import OIL
from camopt.scene.rest import state_at_rest
from camopt.scene.schema import Scene
from camopt.scene.settled import RANGED
from camopt.scene.train import Train, build_train
from camopt.verifier.convergence import (
    MARGIN,
    RELATIVE,
    WANDERING_REVOLUTIONS,
    Converged,
    Prepare,
    StepRefinement,
    Tolerances,
    apart,
    at_once,
    figures_of,
)
from camopt.verifier.record import HALVED, ONE_STEP, method_record, metrics_record

FAR = 3.0
"""A limit is violated far beyond every error estimate if it is exceeded by this many times the sum of the first
method's error estimate and the difference of the two methods."""
SPEED_NEIGHBOUR = 1e-3  # relative
LIFT_NEIGHBOUR = 1e-7  # m, at the largest lift
OTHER_STARTS = (2, 5)
"""Indices of the neighbours with unchanged speed and lift, which differ in the initial state only."""
STATE_NEIGHBOUR = (1e-6, 1e-3)  # m (of positions and memories), m/s: the tolerances for a settled state


@dataclass(frozen=True)
class Case:
    """A cam in a scene, the methods that judge it at every speed, and their tolerances."""

    scene: Scene
    lift: Lift
    methods: Mapping[str, Prepare]
    tolerances: Tolerances
    many: SettledMany | None = None  # measures many settled motions of the first method; None if there is no such way
    progress: bool = False  # whether progress bars count the judged speeds

    @cached_property
    def train(self) -> Train:
        return build_train(self.scene)

    @property
    def first(self) -> str:
        """The method whose metrics are reported."""
        return next(iter(self.methods))

    def refinement(self, method: str, speed_rpm: float, **changed) -> StepRefinement:
        """A method's step refinement from rest at a speed [r/min]; `changed` replaces some of the case's tolerances."""
        tolerances, rest = replace(self.tolerances, **changed), state_at_rest(self.train)
        cam_speed, many = self.scene.cam_speed(speed_rpm), self.many if method == self.first else None
        return StepRefinement(self.methods[method], self.train, self.lift, cam_speed, rest, tolerances, many)

    def many_from_rest(self, speed_rpm: float) -> Converged:
        """The first method's settled motion by `many`. Raises MotionRefused."""
        assert self.many is not None, "`can_spot_check` says so"
        many = partial(self.many, aperiodic=RANGED)
        return at_once(many, self.train, self.lift, self.scene.cam_speed(speed_rpm), state_at_rest(self.train))


@dataclass(frozen=True, repr=False)
class SpeedVerdict:
    """The methods' answers at one speed, and the verdict. The first method's metrics are the reported ones."""

    speed_rpm: float
    verdict: str
    broken: tuple[str, ...]
    straddled: tuple[str, ...]  # limits that hold in one part of the neighbourhood and are violated in another
    ranges: dict[str, tuple[float, float]]  # of every metric, over measured revolutions and neighbours
    methods: dict[str, Converged]
    decided_after: str = HALVED
    near: tuple[Figures, ...] = ()  # metrics of the first method's neighbourhood, if no other method was run

    @property
    def first(self) -> Converged:
        """The answer of the method whose metrics are reported."""
        return next(iter(self.methods.values()))

    @property
    def bounce_range_mm(self) -> tuple[float, float]:
        """Smallest and largest bounce over measured revolutions and neighbours."""
        return self.ranges["bounce_mm"]

    def __repr__(self) -> str:
        return f"SpeedVerdict({self.speed_rpm:g} r/min: {self.verdict}, by {', '.join(self.methods)})"

    def as_dict(self) -> dict:
        """One record of `speeds` in verification.json: the first method's metrics, then those of every method."""
        return {
            "speed_rpm": self.speed_rpm,
            "verdict": self.verdict,
            "decided_after": self.decided_after,
            "method": next(iter(self.methods)),
            **metrics_record(self.first, self.ranges),
            "methods": {name: method_record(answer) for name, answer in self.methods.items()},
        }


def judge_speed(case: Case, speed_rpm: float) -> SpeedVerdict:
    """The verdict on a case at one speed [r/min]; a violation far beyond all errors needs no further halving."""
    first = case.first
    refinements = {name: case.refinement(name, speed_rpm, reported=name == first) for name in case.methods}
    try:
        # an error estimate needs two steps
        coarse = case.many_from_rest(speed_rpm) if case.many else refinements[first].answer(2)
        early = one_step_rejection(case, speed_rpm, coarse)
    except MotionRefused:
        early = None
    if early is not None:
        return early
    answers = {name: refinement.answer() for name, refinement in refinements.items()}
    try:
        near = neighbours(case, speed_rpm, answers[first])
    except MotionRefused:
        return SpeedVerdict(speed_rpm, "not converged", (), (), answers[first].range, answers)
    return verdict_from_answers(case, speed_rpm, answers, near, agree=agreement([*answers.values()], case.tolerances))


def verdict_from_answers(
    case: Case,
    speed_rpm: float,
    answers: dict[str, Converged],
    near: list[Figures],
    *,
    agree: bool,
    decided_after: str = HALVED,
) -> SpeedVerdict:
    """The verdict from the methods' answers, whether they agree, and the metrics `near` of the neighbourhood."""
    first = next(iter(answers.values()))
    broken, straddled = against_limits(case.scene, speed_rpm, first, near)
    verdict = "rejected" if broken else "sensitive" if straddled else "confirmed"
    if not agree:
        verdict, broken = "not converged", ()
    all_ends = {name: np.array([ends, *(f.range(name) for f in near)]) for name, ends in first.range.items()}
    ranges = {name: (float(values.min()), float(values.max())) for name, values in all_ends.items()}
    return SpeedVerdict(speed_rpm, verdict, broken, straddled, ranges, answers, decided_after)


def one_step_rejection(
    case: Case, speed_rpm: float, answer: Converged, near: list[Figures] | None = None
) -> SpeedVerdict | None:
    """A rejection for which the first two methods need not have converged, or None.

    Both methods must exceed one limit by FAR times the sum of the first one's error estimate and their difference, and
    must agree on whether the valve seats; the motions of the neighbourhood must exceed it as well. `answer` is that of
    the first method. The second method is run at its first step only, with at most WANDERING_REVOLUTIONS to settle,
    since a motion far beyond its limits seldom settles. `near` holds the metrics of the neighbourhood if they have been
    computed already. Raises MotionRefused if a motion of the neighbourhood is refused.
    """
    if len(case.methods) < 2 or not violates_by_margin(case.scene, [answer.worst], answer.error):
        return None
    first, second = list(case.methods)[:2]
    check = case.refinement(second, speed_rpm, most=WANDERING_REVOLUTIONS).answer(1)
    error = {name: estimate + apart(answer.worst[name], check.worst[name]) for name, estimate in answer.error.items()}
    if np.isnan(answer.worst["bounce_mm"]) != np.isnan(check.worst["bounce_mm"]) or not violates_by_margin(
        case.scene, [answer.worst, check.worst], error
    ):
        return None
    near = neighbours(case, speed_rpm, answer) if near is None else near
    metrics = [answer.worst, check.worst, *({name: f.worst(name) for name in error} for f in near)]
    if not violates_by_margin(case.scene, metrics, error):
        return None
    answers = {first: replace(answer, error=error), second: check}
    return verdict_from_answers(case, speed_rpm, answers, near, agree=True, decided_after=ONE_STEP)


def violates_by_margin(scene: Scene, metrics: list[dict[str, float]], error: dict[str, float]) -> bool:
    """Whether all of the `metrics` violate the same limit by more than FAR times its `error`.

    A limit whose metric is missing (the valve does not seat, or the motion is refused) is ignored.
    """
    for limit in motion_limits(scene.design).values():
        values, margin = [m[limit.metric] for m in metrics], FAR * error[limit.metric]
        if np.all(np.isfinite([*values, margin])) and all(limit.breaks(value, margin) for value in values):
            return True
    return False


def agreement(answers: list[Converged], tolerances: Tolerances) -> bool:
    """Whether at least two methods have converged and their deciding metrics overlap within range and error estimate.

    Methods agree if the valve seats in none of them, whatever the other metrics are, since that alone rejects the cam.
    The error of a metric is taken as at least half of the change that a halved step is allowed, because changes across
    contacts can be small by chance; two exact answers then agree if they differ by no more than that allowed change.
    """
    if len(answers) < 2 or not all(a.converged for a in answers):
        return False
    seated = [not np.isnan(a.worst["bounce_mm"]) for a in answers]
    if not all(seated):
        return not any(seated)
    for name, tolerance in tolerances.absolute.items():
        least = [0.5 * (tolerance + RELATIVE * abs(a.worst[name])) for a in answers]
        errors = [max(a.error[name] / MARGIN, e) for a, e in zip(answers, least, strict=True)]  # change by halving
        lows = [a.range[name][0] - error for a, error in zip(answers, errors, strict=True)]
        highs = [a.range[name][1] + error for a, error in zip(answers, errors, strict=True)]
        if not max(lows) <= min(highs):
            return False
    return True


def neighbours(case: Case, speed_rpm: float, answer: Converged, many: SettledMany | None = None) -> list[Figures]:
    """The first method's metrics at neighbouring speeds (+-0.1 %), lifts (+-0.1 um at the nose) and initial states.

    `many`, by default that of the case, measures settled motions without taking samples, many times as fast. Raises
    MotionRefused if the motion of `answer` or of a neighbour is refused.
    """
    if answer.state is None:
        raise MotionRefused(f"the motion at {speed_rpm:g} r/min is refused")
    train, lift, many = case.train, case.lift, many or case.many
    cam_speed, n, length = case.scene.cam_speed(speed_rpm), len(train.mass), train.state_size
    units = np.repeat((*STATE_NEIGHBOUR, STATE_NEIGHBOUR[0]), (n, n, length - 2 * n))
    away = units * np.random.default_rng(0).choice([-1.0, 1.0], length)
    motions = []
    for sign in (-1.0, 1.0):
        scaled = replace(lift, coefficients=lift.coefficients * (1 + sign * LIFT_NEIGHBOUR / lift.max_lift))
        motions.append((lift, cam_speed * (1 + sign * SPEED_NEIGHBOUR), answer.state))
        motions.append((scaled, cam_speed, answer.state))
        motions.append((lift, cam_speed, answer.state + sign * away))
    if many is not None:
        return [figures_of(at_once(many, train, *motion)) for motion in motions]
    steps = answer.steps_per_revolution // 2  # the error estimate covers the change by the last halving
    most, prepare = None if answer.periodic else WANDERING_REVOLUTIONS, case.methods[case.first]
    return [
        settle_and_measure(
            prepare(train, cam, speed, steps), state, cam, most, decay=decay_per_revolution(train, speed)
        ).figures
        for cam, speed, state in motions
    ]


def against_limits(
    scene: Scene, speed_rpm: float, answer: Converged, near: list[Figures]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Limits that are violated in the whole neighbourhood, and those that are or may be violated in a part of it."""
    at = f"at {speed_rpm:g} r/min"
    seats = [not np.isnan(v) for v in (answer.worst["bounce_mm"], *(f.worst("bounce_mm") for f in near))]
    if not all(seats):
        never = f"{'pump-up, ' * pumped_up(build_train(scene), answer.state)}never seats {at}"
        return ((never,), ()) if not any(seats) else ((), (never,))
    broken, straddled = [], []
    for key, limit in motion_limits(scene.design).items():
        values, error = [answer.worst[limit.metric], *(f.worst(limit.metric) for f in near)], answer.error[limit.metric]
        if all(limit.breaks(value, error) for value in values):
            broken.append(f"{key} {at}")
        elif not all(limit.keeps(value, answer.doubt(limit.metric)) for value in values):
            straddled.append(f"{key} {at}")
    return tuple(broken), tuple(straddled)


def pumped_up(train: Train, state: np.ndarray | None) -> bool:
    """Whether an adjuster that filled during valve float holds the valve off its seat.

    `state` (2n + r) is a settled state at -pi, where the follower is on the base circle. The adjuster has pumped up if
    the valve is off its seat there and an oil column is longer than in the train at rest by more than the travel of its
    ball. Whether the oil carries load at that instant depends on the vibration and is not tested.
    """
    if train.laws is None or state is None:
        return False
    n = len(train.mass)
    off = train.compression(state[:n], 0.0)[train.seat] < train.touch_compression[train.seat]
    longer = (state_at_rest(train) - state)[2 * n :]
    oil = [i for i, e in enumerate(train.memory) if train.laws.kind[e] == OIL]
    return bool(off and any(longer[i] > train.laws.travel[train.memory[i]] for i in oil))
