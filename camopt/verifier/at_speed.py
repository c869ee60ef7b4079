"""The verdict at one speed: do the methods agree, and does every limit on the motion hold over the neighbourhood.

A verdict asks no more than its answer needs. To confirm, or to say that nothing is known, every method is halved until
its figures stand. A limit that is broken far beyond every error estimate needs less: event-exact once, one other method
at its first step that says the same, and the neighbourhood.
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from camopt.cam.lift import Lift
from camopt.measure.limits import motion_limits
from camopt.measure.settling import Figures
from camopt.measure.sweep import SettledMany
from camopt.scene.errors import MotionRefused
from camopt.scene.rest import state_at_rest
from camopt.scene.schema import Scene
from camopt.scene.settled import RANGED
from camopt.scene.train import build_train
from camopt.verifier.convergence import (
    MARGIN,
    RELATIVE,
    WANDERING_REVOLUTIONS,
    Converged,
    Demand,
    Halving,
    Prepare,
    apart,
    at_once,
    tolerances,
)
from camopt.verifier.neighbourhood import against_limits, neighbours
from camopt.verifier.record import speed_record

FAR = 3.0
"""A limit is broken far beyond every error estimate where it is by FAR times the first method's estimate and the
distance of the two methods together."""
FIRST_LOOK = 2
"""Steps after which a first method with samples has an error estimate."""
HALVED, ONE_STEP, ALONE = "halving", "one step", "event-exact alone"
"""After what a verdict was decided: its methods were halved until they stood (or could not), one step showed it, or no
other method was asked at that speed (`camopt.verifier.spot_checks`)."""


@dataclass(frozen=True)
class Case:
    """What is judged at every speed, by which methods, and how far each of them is asked to go."""

    scene: Scene
    lift: Lift
    methods: Mapping[str, Prepare]
    demand: Demand
    many: SettledMany | None = None  # measures many settled motions of the first method, where it can
    progress: bool = False  # whether bars count the speeds that have been judged


@dataclass(frozen=True, repr=False)
class SpeedVerdict:
    """What the methods found at one speed, and what follows. Figures are the first method's."""

    speed_rpm: float
    verdict: str
    broken: tuple[str, ...]
    straddled: tuple[str, ...]  # limits that some of the neighbourhood keeps and some breaks
    ranges: dict[str, tuple[float, float]]  # of every metric, over measured revolutions and neighbours
    methods: dict[str, Converged]
    decided_after: str = HALVED
    near: tuple[Figures, ...] = ()  # of the first method's neighbourhood, where it alone was asked

    @property
    def bounce_range_mm(self) -> tuple[float, float]:
        """Smallest and largest bounce over measured revolutions and neighbours."""
        return self.ranges["bounce_mm"]

    def __repr__(self) -> str:
        return f"SpeedVerdict({self.speed_rpm:g} r/min: {self.verdict}, by {', '.join(self.methods)})"

    def as_dict(self) -> dict:
        """One record of `speeds` in verification.json."""
        return speed_record(self)


def judge_speed(case: Case, speed_rpm: float) -> SpeedVerdict:
    """The verdict on a case at one speed [r/min]; a limit that is plainly broken ends it early."""
    train, cam_speed = build_train(case.scene), case.scene.cam_speed(speed_rpm)
    rest, first = state_at_rest(train), next(iter(case.methods))
    halved = {
        name: Halving(prepare, train, case.lift, cam_speed, rest, replace(case.demand, certain=name == first))
        for name, prepare in case.methods.items()
    }
    near_to = partial(neighbours, case.methods[first], train, case.lift, cam_speed, many=case.many)
    try:
        many = partial(case.many, aperiodic=RANGED) if case.many else None
        look = at_once(many, train, case.lift, cam_speed, rest) if many else halved[first].answer(FIRST_LOOK)
        early = plainly_broken(case, speed_rpm, look, near_to)
    except MotionRefused:
        early = None
    if early is not None:
        return early
    answers = {name: one.answer() for name, one in halved.items()}
    if answers[first].state is None:
        return SpeedVerdict(speed_rpm, "not converged", (), (), answers[first].range, answers)
    try:
        near = near_to(answers[first])
    except MotionRefused:
        return SpeedVerdict(speed_rpm, "not converged", (), (), answers[first].range, answers)
    agree = agreement(list(answers.values()), case.demand.tolerance_um, case.demand.limited)
    return held(case, speed_rpm, answers, near, agree=agree)


def held(
    case: Case,
    speed_rpm: float,
    answers: dict[str, Converged],
    near: list[Figures],
    *,
    agree: bool,
    decided_after: str = HALVED,
) -> SpeedVerdict:
    """What follows from the methods' answers, whether they agree, and the first one's neighbourhood."""
    first = next(iter(answers.values()))
    broken, straddled = against_limits(case.scene, speed_rpm, first, near)
    verdict = "rejected" if broken else "sensitive" if straddled else "confirmed"
    if not agree:
        verdict, broken = "not converged", ()
    return SpeedVerdict(speed_rpm, verdict, broken, straddled, ranges_of(first, near), answers, decided_after)


def plainly_broken(
    case: Case, speed_rpm: float, look: Converged, near_to: Callable[[Converged], list[Figures]]
) -> SpeedVerdict | None:
    """A rejection for which the first two methods need not stand, or None.

    Every limit that it names is broken by both methods, and one of them at least far beyond every error estimate. The
    first method says so in its first `look`, the second one at its first step, after WANDERING_REVOLUTIONS at most: a
    motion far beyond its limits seldom settles. Both must also agree on whether the valve seats. `near_to` gives the
    figures of the neighbourhood of an answer. Raises MotionRefused where a motion of the neighbourhood is refused.
    """
    if len(case.methods) < 2 or not far_beyond(case.scene, [look.worst], look.error):
        return None
    names, train = list(case.methods)[:2], build_train(case.scene)
    prepare, demand = case.methods[names[1]], replace(case.demand, most=WANDERING_REVOLUTIONS)
    cam_speed, rest = case.scene.cam_speed(speed_rpm), state_at_rest(train)
    other = Halving(prepare, train, case.lift, cam_speed, rest, demand).answer(1)
    doubt = {name: error + apart(look.worst[name], other.worst[name]) for name, error in look.error.items()}
    if np.isnan(look.worst["bounce_mm"]) != np.isnan(other.worst["bounce_mm"]) or not far_beyond(
        case.scene, [look.worst, other.worst], doubt
    ):
        return None
    near, first = near_to(look), replace(look, error=doubt)
    every = [look.worst, other.worst, *({name: f.worst(name) for name in doubt} for f in near)]
    if not far_beyond(case.scene, every, doubt):
        return None
    answers = dict(zip(names, (first, other), strict=True))
    return held(case, speed_rpm, answers, near, agree=True, decided_after=ONE_STEP)


def far_beyond(scene: Scene, figures: list[dict[str, float]], doubt: dict[str, float]) -> bool:
    """Whether all `figures` break one and the same limit by more than FAR times its `doubt`.

    A figure that is none (the valve does not seat, the motion is refused) shows nothing here.
    """
    for limit in motion_limits(scene.design).values():
        values, margin = [f[limit.metric] for f in figures], FAR * doubt[limit.metric]
        if np.all(np.isfinite([*values, margin])) and all(limit.breaks(value, margin) for value in values):
            return True
    return False


def ranges_of(answer: Converged, near: list[Figures]) -> dict[str, tuple[float, float]]:
    """Smallest and largest value of every metric over the measured revolutions and the neighbourhood."""
    every = {name: np.array([own, *(f.range(name) for f in near)]) for name, own in answer.range.items()}
    return {name: (float(values.min()), float(values.max())) for name, values in every.items()}


def agreement(answers: list[Converged], tolerance_um: float, limited: Collection[str] = ()) -> bool:
    """Whether two methods or more have converged and their deciding figures overlap within range and error estimate.

    Methods that all find that the valve does not seat agree, whatever their other figures are: that alone rejects the
    cam. Half of what a halved step was allowed to change is the least error of a figure: then two exact answers still
    agree when they differ by what either may move. Changes across contacts are erratic and can be small by chance.
    """
    if len(answers) < 2 or not all(a.converged for a in answers):
        return False
    seated = [not np.isnan(a.worst["bounce_mm"]) for a in answers]
    if not all(seated):
        return not any(seated)
    for name, tolerance in tolerances(tolerance_um, limited).items():
        least = [0.5 * (tolerance + RELATIVE * abs(a.worst[name])) for a in answers]
        errors = [max(a.error[name] / MARGIN, e) for a, e in zip(answers, least, strict=True)]  # what halving moved
        lows = [a.range[name][0] - error for a, error in zip(answers, errors, strict=True)]
        highs = [a.range[name][1] + error for a, error in zip(answers, errors, strict=True)]
        if not max(lows) <= min(highs):
            return False
    return True
