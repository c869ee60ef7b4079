"""Verdicts at many speeds in which not every method looks at every speed: those of a draft, and of a rejected baseline.

Event-exact locates its switchings and extremes and has no step that could be halved. It looks at every speed with its
neighbourhood, and states its own error. The other methods look where a limit is nearest: at the worst speed of every
limited metric and of the peak force, and at both ends. The verdict of every other speed says "event-exact alone".
"""

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial

import numpy as np
from tqdm import tqdm

from camopt.measure.limits import motion_limits
from camopt.measure.settling import decay_per_revolution
from camopt.scene.errors import MotionRefused
from camopt.scene.quantities import LESS_IS_WORSE
from camopt.scene.rest import state_at_rest
from camopt.scene.settled import MOST_REVOLUTIONS, RANGED, revolutions_needed
from camopt.scene.train import build_train
from camopt.verifier.at_speed import (
    ALONE,
    Case,
    SpeedVerdict,
    agreement,
    far_beyond,
    held,
    judge_speed,
    plainly_broken,
)
from camopt.verifier.convergence import (
    MARGIN,
    RELATIVE,
    WANDERING_REVOLUTIONS,
    Halving,
    apart,
    at_once,
    tolerances,
)
from camopt.verifier.neighbourhood import OTHER_STARTS, neighbours

PEAK_FORCE = "contact_force_max_N"
WORKERS = 2
"""Threads over the speeds of a verdict."""

Verdicts = tuple[SpeedVerdict, ...]


def at_every(judge: Callable[[Case, float], SpeedVerdict], case: Case, speeds_rpm: Iterable[float]) -> Verdicts:
    """The verdicts at crankshaft speeds [r/min], some of them side by side."""
    speeds, hidden = [float(speed) for speed in speeds_rpm], None if case.progress else True
    with ThreadPoolExecutor(WORKERS) as pool:
        found = pool.map(lambda speed: judge(case, speed), speeds)
        return tuple(tqdm(found, total=len(speeds), desc="judged", unit="speed", leave=False, disable=hidden))


def event_alone(case: Case, speed_rpm: float) -> SpeedVerdict:
    """The verdict of event-exact without another method; of all methods where event-exact refuses a motion, where its
    answer does not stand, or where the train's slowest mode had no time to die out.

    A periodic motion stands where those that settle from other states near by have the same figures within the
    tolerances of a halved step: contacts that part multiply what settling leaves. Its error is what the method states
    or, where that is more, MARGIN times the distance of these figures. A motion that never repeats has its range.
    """
    train, cam_speed, first = build_train(case.scene), case.scene.cam_speed(speed_rpm), next(iter(case.methods))
    assert case.many is not None, "`allows` says so"
    try:
        look = at_once(partial(case.many, aperiodic=RANGED), train, case.lift, cam_speed, state_at_rest(train))
        many = case.many if look.periodic else partial(case.many, most=WANDERING_REVOLUTIONS)
        near = neighbours(case.methods[first], train, case.lift, cam_speed, look, many)
    except MotionRefused:
        return judge_speed(case, speed_rpm)
    if not look.periodic and revolutions_needed(decay_per_revolution(train, cam_speed)) > MOST_REVOLUTIONS:
        return judge_speed(case, speed_rpm)
    error, allowed = dict(look.error), tolerances(case.demand.tolerance_um, case.demand.limited)
    for name in error if look.periodic else ():
        moved = max(apart(near[i].worst(name), look.worst[name]) for i in OTHER_STARTS)
        if name in allowed and moved > allowed[name] + RELATIVE * np.nan_to_num(abs(look.worst[name])):
            return judge_speed(case, speed_rpm)
        error[name] = max(error[name], MARGIN * moved)
    look = replace(look, error=error, converged=True)
    return replace(held(case, speed_rpm, {first: look}, near, agree=True, decided_after=ALONE), near=tuple(near))


def with_all_methods(case: Case, alone: SpeedVerdict) -> SpeedVerdict:
    """A verdict of event-exact alone, judged again by all methods; the error is then also how far they are apart."""
    if alone.decided_after != ALONE:
        return alone
    speed_rpm, near = alone.speed_rpm, list(alone.near)
    ((first, look),) = alone.methods.items()
    early = plainly_broken(case, speed_rpm, look, lambda _: near)
    if early is not None:
        return early
    train, cam_speed = build_train(case.scene), case.scene.cam_speed(speed_rpm)
    others = {
        name: Halving(prepare, train, case.lift, cam_speed, state_at_rest(train), case.demand).answer()
        for name, prepare in case.methods.items()
        if name != first
    }
    agree = agreement([look, *others.values()], case.demand.tolerance_um, case.demand.limited)
    away = {name: max(apart(look.worst[name], o.worst[name]) for o in others.values()) for name in look.error}
    error = {name: max(own, away[name]) for name, own in look.error.items()}
    return held(case, speed_rpm, {first: replace(look, error=error), **others}, near, agree=agree)


def allows(case: Case) -> bool:
    """Whether the first method can answer alone at a speed, and another one look at it as well."""
    return case.many is not None and len(case.methods) > 1


def until_broken(case: Case, alone: Verdicts) -> Verdicts | None:
    """Verdicts that reject: all methods looked at the speed where a limit is broken most, none at the others.

    None where event-exact finds no limit broken far beyond its error, or another method does not confirm it.
    """
    plainly = [s for s in alone if s.decided_after == ALONE and far_beyond(case.scene, *_alone(s))]
    if not plainly:
        return None
    most = max(plainly, key=lambda s: _excess(case, s))
    judged = with_all_methods(case, most)
    return tuple(judged if s is most else s for s in alone) if judged.verdict == "rejected" else None


def spot_checked(case: Case, alone: Verdicts) -> dict[float, SpeedVerdict]:
    """By speed [r/min], the verdicts of those that all methods are to look at.

    These are both ends, and the worst speed of every limited metric and of the peak force. If they reject nothing, also
    those that event-exact does not confirm. Where all methods have rejected one already, they are to look at no other.
    """
    if any(s.verdict == "rejected" and s.decided_after != ALONE for s in alone):
        return {}
    by_speed = {s.speed_rpm: s for s in alone}
    chosen = {min(by_speed), max(by_speed)}
    for name in {*case.demand.limited, PEAK_FORCE}:
        chosen.add(max(alone, key=lambda s: _badness(s, name)).speed_rpm)

    def judged(speeds: set[float]) -> dict[float, SpeedVerdict]:
        found = at_every(lambda _, speed: with_all_methods(case, by_speed[speed]), case, sorted(speeds))
        return {s.speed_rpm: s for s in found}

    found = judged(chosen)
    if any(s.verdict == "rejected" for s in found.values()):
        return found
    return found | judged({s.speed_rpm for s in alone if s.verdict != "confirmed"} - chosen)


def _alone(one: SpeedVerdict) -> tuple[list[dict[str, float]], dict[str, float]]:
    """Figures and errors of a verdict's only method."""
    (look,) = one.methods.values()
    return [look.worst], look.error


def _badness(one: SpeedVerdict, name: str) -> float:
    """How bad a metric is over the neighbourhood; no figure is the worst."""
    low, high = one.ranges[name]
    return float(np.nan_to_num(-low if name in LESS_IS_WORSE else high, nan=np.inf))


def _excess(case: Case, one: SpeedVerdict) -> float:
    """The largest of a verdict's figures in parts of their limits; those without a figure are left out."""
    (figures,), _ = _alone(one)
    shares = [limit.share(np.array(figures[limit.metric])) for limit in motion_limits(case.scene.design).values()]
    return max(float(share) for share in shares if np.isfinite(share))
