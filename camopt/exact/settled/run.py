"""Settling revolution by revolution and measuring what has settled, for many motions of one train in compiled code."""

from typing import NamedTuple

import numpy as np

from camopt.exact.kernel.arrays import CamArrays
from camopt.exact.kernel.revolution import CHATTER, DONE, NOT_FINITE, revolve
from camopt.exact.kernel.setting import Setting
from camopt.exact.kernel.trace import first, later
from camopt.exact.settled.figures import NAMES, figures
from camopt.programs import compiled, inner

SETTLING, PERIODIC, APERIODIC, REFUSED = 0, 1, 2, 3
"""How far a motion has come: it still settles; it repeats; it did not settle; it cannot be followed."""


class Plan(NamedTuple):
    """How long motions may settle, and what is measured."""

    position: float  # m
    velocity: float  # m/s
    unbound: float  # m
    measured: int
    aperiodic: int
    switchings: int  # most per revolution


class Cams(NamedTuple):
    """k cams, the pieces of cam j being `first[j]` to `first[j + 1]`."""

    borders: np.ndarray  # (pieces + k) rad
    pieces: np.ndarray  # (pieces, q) m/rad^k
    first: np.ndarray  # (k + 1)
    half_duration: np.ndarray  # (k) rad
    foot: np.ndarray  # (k) opening foot, rad


class SettlingMotions(NamedTuple):
    """m motions of one train: what they are, how far they are, and what was found."""

    cam: np.ndarray  # (m) its number
    speed: np.ndarray  # (m) rad/s
    left: np.ndarray  # (m) way left in changes over the last revolution
    most: np.ndarray  # (m) revolutions to settle, at most
    state: np.ndarray  # (m, 2n + r) start, then where settling has come to, then the end of the measured revolutions
    stage: np.ndarray  # (m)
    revolutions: np.ndarray  # (m) run to settle
    lowest: np.ndarray  # (m, metrics) over the measured revolutions; NaN where one is NaN
    highest: np.ndarray  # (m, metrics)


@compiled
def run(s, plan, cams, motions, room, begin):
    """Runs the motions from `begin` on; the setting s gives the train, its tables, valve, seat and contacts.

    `room` is (rows, no trace, trace, seeds). Stops where a table or room in the trace is missing; called again, it goes
    on from the last revolution. Returns (number of the motion, code of `revolve`, the missing key).
    """
    for i in range(begin, len(motions.cam)):
        one = of_motion(s, cams, motions, i)
        if motions.stage[i] == SETTLING:
            code, key = settle(one, plan, motions, room, i)
            if not went_on(motions, i, code):
                return i, code, key
        if motions.stage[i] != REFUSED:
            code, key = measured(one, plan, motions, room, i)
            if not went_on(motions, i, code):
                return i, code, key
        if motions.stage[i] == REFUSED:
            motions.state[i], motions.lowest[i], motions.highest[i] = np.nan, np.nan, np.nan
    return len(motions.cam), DONE, 0


@inner
def went_on(motions, i, code):
    """Whether the motions can go on after a code; one that cannot be followed is marked."""
    if code == DONE:
        return True
    if code < 0:
        motions.stage[i] = REFUSED
        return True
    return False


@inner
def of_motion(s, cams, motions, i):
    """The setting of motion i."""
    j = motions.cam[i]
    low, high = cams.first[j], cams.first[j + 1]
    cam = CamArrays(cams.borders[low + j : high + j + 1], cams.pieces[low:high], motions.speed[i])
    half, foot = cams.half_duration[j], cams.foot[j]
    return Setting(s.train, cam, s.step, s.tables, s.valve, s.seat, s.cam_side, half, foot)


@inner
def turned(s, plan, room, state, trace):
    """One revolution of `state` (2n + r), changed in place: (code, segments or missing key), code < 0 for refusals."""
    code, count, _ = revolve(s.train, s.cam, s.step, s.tables, state, room[0], trace, plan.switchings)
    if code == DONE and np.abs(state[: len(s.train.mass)]).max() > plan.unbound:
        code = NOT_FINITE
    return (-code if code in (CHATTER, NOT_FINITE) else code), count


@inner
def settle(s, plan, motions, room, i):
    """Revolutions until the way that is left is short enough, or there have been the most: (code, missing key)."""
    after, n = motions.state[i].copy(), len(s.train.mass)
    while motions.revolutions[i] < motions.most[i]:
        code, key = turned(s, plan, room, after, room[1])
        if code != DONE:
            return code, key
        stands = True
        for j in range(len(after)):
            way = motions.left[i] * abs(after[j] - motions.state[i, j])
            stands = stands and way < (plan.velocity if n <= j < 2 * n else plan.position)
        motions.state[i] = after
        motions.revolutions[i] += 1
        if stands:
            motions.stage[i] = PERIODIC
            return DONE, 0
    motions.stage[i] = APERIODIC
    return DONE, 0


@inner
def measured(s, plan, motions, room, i):
    """The metrics of the measured revolutions and one more for the last bounce window: (code, missing key)."""
    turns = plan.measured if motions.stage[i] == PERIODIC else plan.aperiodic
    starts, used, state, row = np.zeros(turns + 2, dtype=np.int64), 0, motions.state[i].copy(), np.empty(len(NAMES))
    for turn in range(turns + 1):
        rest = later(room[2], used)
        code, count = turned(s, plan, room, state, rest)
        if code != DONE:
            return code, count
        for k in range(count + 1):
            rest.angle[k] += 2.0 * np.pi * turn
        used += count
        starts[turn + 1] = used
    motions.lowest[i], motions.highest[i] = np.inf, -np.inf
    for turn in range(turns):
        both = first(later(room[2], starts[turn]), starts[turn + 2] - starts[turn])
        figures(s, both, room[3], turn, row)
        for j in range(len(row)):
            unknown = np.isnan(row[j]) or np.isnan(motions.lowest[i, j])
            motions.lowest[i, j] = np.nan if unknown else min(motions.lowest[i, j], row[j])
            motions.highest[i, j] = np.nan if unknown else max(motions.highest[i, j], row[j])
    motions.state[i] = state
    return DONE, 0
