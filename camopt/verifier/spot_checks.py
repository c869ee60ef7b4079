"""Verdicts at many speeds where only some speeds are judged by all methods: for drafts and for rejected baselines.

Event-exact, which has no step to halve, judges every speed with its neighbourhood and states its own error. The other
methods judge the worst speed of every limited metric and of the peak force, and the lowest and the highest speed.
"""

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial

import numpy as np
from tqdm import tqdm

from camopt.measure.limits import motion_limits
from camopt.measure.settling import decay_per_revolution
from camopt.measure.sweep import badness
from camopt.scene.errors import MotionRefused
from camopt.scene.quantities import LESS_IS_WORSE
from camopt.scene.settled import MOST_REVOLUTIONS, revolutions_needed
from camopt.verifier.at_speed import (
    OTHER_STARTS,
    Case,
    SpeedVerdict,
    agreement,
    judge_speed,
    neighbours,
    one_step_rejection,
    verdict_from_answers,
    violates_by_margin,
)
from camopt.verifier.convergence import MARGIN, RELATIVE, WANDERING_REVOLUTIONS, apart
from camopt.verifier.record import ALONE

WORKERS = 2
"""Threads over the speeds of a verdict."""

Verdicts = tuple[SpeedVerdict, ...]


def judge_all(judge: Callable[[Case, float], SpeedVerdict], case: Case, speeds_rpm: Iterable[float]) -> Verdicts:
    """The verdicts at crankshaft speeds [r/min], computed WORKERS at a time."""
    speeds, hidden = [float(speed) for speed in speeds_rpm], None if case.progress else True
    with ThreadPoolExecutor(WORKERS) as pool:
        verdicts = pool.map(lambda speed: judge(case, speed), speeds)
        return tuple(tqdm(verdicts, total=len(speeds), desc="judged", unit="speed", leave=False, disable=hidden))


def event_alone(case: Case, speed_rpm: float) -> SpeedVerdict:
    """The verdict by event-exact without another method.

    All methods judge the speed instead if event-exact refuses a motion, if its metrics have not converged, or if the
    train's slowest mode has not had time to decay. The metrics of a periodic motion have converged if motions from
    neighbouring states settle to the same metrics within the tolerances of a halved step. Its error is the one that the
    method states or, if larger, MARGIN times the difference of these metrics. An aperiodic motion has a range instead.
    """
    assert case.many is not None, "`can_spot_check` says so"
    try:
        answer = case.many_from_rest(speed_rpm)
        many = case.many if answer.periodic else partial(case.many, most=WANDERING_REVOLUTIONS)
        near = neighbours(case, speed_rpm, answer, many)
    except MotionRefused:
        return judge_speed(case, speed_rpm)
    decay = decay_per_revolution(case.train, case.scene.cam_speed(speed_rpm))
    if not answer.periodic and revolutions_needed(decay) > MOST_REVOLUTIONS:
        return judge_speed(case, speed_rpm)
    error, allowed = dict(answer.error), case.tolerances.absolute
    for name in error if answer.periodic else ():
        distance = max(apart(near[i].worst(name), answer.worst[name]) for i in OTHER_STARTS)
        if name in allowed and distance > allowed[name] + RELATIVE * np.nan_to_num(abs(answer.worst[name])):
            return judge_speed(case, speed_rpm)
        error[name] = max(error[name], MARGIN * distance)
    answers = {case.first: replace(answer, error=error, converged=True)}
    verdict = verdict_from_answers(case, speed_rpm, answers, near, agree=True, decided_after=ALONE)
    return replace(verdict, near=tuple(near))


def with_all_methods(case: Case, alone: SpeedVerdict) -> SpeedVerdict:
    """A verdict by event-exact alone, judged again by all methods; its error then includes their differences."""
    if alone.decided_after != ALONE:
        return alone
    speed_rpm, near = alone.speed_rpm, list(alone.near)
    first, answer = case.first, alone.first
    early = one_step_rejection(case, speed_rpm, answer, near)
    if early is not None:
        return early
    checks = {name: case.refinement(name, speed_rpm).answer() for name in case.methods if name != first}
    agree = agreement([answer, *checks.values()], case.tolerances)
    away = {name: max(apart(answer.worst[name], o.worst[name]) for o in checks.values()) for name in answer.error}
    error = {name: max(estimate, away[name]) for name, estimate in answer.error.items()}
    answers = {first: replace(answer, error=error), **checks}
    return verdict_from_answers(case, speed_rpm, answers, near, agree=agree)


def can_spot_check(case: Case) -> bool:
    """Whether the first method can judge a speed alone and another method is available to check it."""
    return case.many is not None and len(case.methods) > 1


def early_rejection(case: Case, alone: Verdicts) -> Verdicts | None:
    """The verdicts with that of the worst speed replaced by a rejection by all methods, or None.

    Only the speed where a limit is exceeded most is judged by all methods. None is returned if event-exact exceeds no
    limit far beyond its error, or if the other methods do not confirm the rejection.
    """
    not_checked = [s for s in alone if s.decided_after == ALONE]
    plainly = [s for s in not_checked if violates_by_margin(case.scene, [s.first.worst], s.first.error)]
    if not plainly:
        return None
    most = max(plainly, key=lambda s: _largest_usage(case, s))
    judged = with_all_methods(case, most)
    return tuple(judged if s is most else s for s in alone) if judged.verdict == "rejected" else None


def spot_checked(case: Case, alone: Verdicts) -> dict[float, SpeedVerdict]:
    """The verdicts of the speeds that all methods judge, by speed [r/min].

    All methods judge the speeds named in the module's docstring and, if none of these is rejected, every further speed
    that event-exact does not confirm. If all methods have already rejected a speed, they judge no other.
    """
    if any(s.verdict == "rejected" and s.decided_after != ALONE for s in alone):
        return {}
    by_speed = {s.speed_rpm: s for s in alone}
    chosen = {min(by_speed), max(by_speed)}
    for name in {*case.tolerances.limited, "contact_force_max_N"}:
        bad_ends = np.array([s.ranges[name][0 if name in LESS_IS_WORSE else 1] for s in alone])
        chosen.add(alone[int(np.argmax(badness(name, bad_ends)))].speed_rpm)

    def judged(speeds: set[float]) -> dict[float, SpeedVerdict]:
        verdicts = judge_all(lambda _, speed: with_all_methods(case, by_speed[speed]), case, sorted(speeds))
        return {s.speed_rpm: s for s in verdicts}

    first = judged(chosen)
    if any(s.verdict == "rejected" for s in first.values()):
        return first
    return first | judged({s.speed_rpm for s in alone if s.verdict != "confirmed"} - chosen)


def _largest_usage(case: Case, verdict: SpeedVerdict) -> float:
    """The largest usage of a limit by a verdict's metrics, as a share of the limit; missing metrics are ignored."""
    worst = verdict.first.worst
    shares = [limit.share(np.array(worst[limit.metric])) for limit in motion_limits(case.scene.design).values()]
    return max(float(share) for share in shares if np.isfinite(share))
