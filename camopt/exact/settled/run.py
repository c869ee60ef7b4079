"""Settling and measurement of many motions of one train, revolution by revolution, in compiled code."""

from typing import NamedTuple

import numpy as np

from camopt.exact.kernel.arrays import CamArrays
from camopt.exact.kernel.revolution import DONE, WHOLE, Setting, follow_inside, revolve
from camopt.exact.kernel.trace import cut
from camopt.exact.settled.figures import NAMES, figures
from camopt.programs import compiled, inner
from camopt.scene import settled

goes_on, goes_back, shrinks = inner(settled.goes_on), inner(settled.goes_back), inner(settled.shrinks)
SETTLING, PERIODIC, APERIODIC, REFUSED = 0, 1, 2, 3
"""Stages of a motion: still settling, periodic, not settled, refused."""


class Plan(NamedTuple):
    """Tolerances of settling, and numbers of measured revolutions."""

    position: float  # m
    velocity: float  # m/s
    measured: int  # revolutions of a periodic motion
    aperiodic: int  # revolutions of an aperiodic motion, a whole number of blocks
    block: int  # revolutions of an aperiodic motion that are measured together
    watched: bool  # whether there are enough measured revolutions to confirm that the motion settles


class Cams(NamedTuple):
    """k cams; the pieces of cam j are `first[j]` to `first[j + 1]`."""

    borders: np.ndarray  # (pieces + k) rad
    pieces: np.ndarray  # (pieces, q) m/rad^k
    first: np.ndarray  # (k + 1)
    half_duration: np.ndarray  # (k) rad
    foot: np.ndarray  # (k) opening foot, rad


class SettlingMotions(NamedTuple):
    """m motions of one train: their cams and speeds, their states, and their metrics."""

    cam: np.ndarray  # (m) number of the cam
    speed: np.ndarray  # (m) rad/s
    remaining: np.ndarray  # (m) remaining change until settled, as a multiple of the change over the last revolution
    most: np.ndarray  # (m) largest number of revolutions to settle
    state: np.ndarray  # (m, 2n + r) at the start, then while settling, then at the end of the measured revolutions
    stage: np.ndarray  # (m)
    revolutions: np.ndarray  # (m) simulated to settle
    within: np.ndarray  # (m) number of latest consecutive ones whose remaining change is within the tolerances
    apart: np.ndarray  # (m, 3) changes over a revolution, in the tolerances: largest within them, last but one, last
    turns: np.ndarray  # (m) measured revolutions
    lowest: np.ndarray  # (m, metrics) over the measured revolutions; NaN if any of them is NaN
    highest: np.ndarray  # (m, metrics)


@compiled
def run(s, plan, cams, motions, trace, begin):
    """Simulate the motions from number `begin` on; the setting s holds the train and its tables.

    Stops if the tables or the trace are full; the next call continues after the last completed revolution. Returns
    (number of the motion, code of `revolve`).
    """
    for i in range(begin, len(motions.cam)):
        setting = setting_for(s, cams, motions, i)
        while needs_more(plan, motions, i):
            code = settle(setting, plan, motions, trace, i) if motions.stage[i] == SETTLING else DONE
            if code == DONE:
                code = measured(setting, plan, motions, trace, i)
            if code < 0:
                motions.stage[i] = REFUSED
            elif code != DONE:
                return i, code
        if motions.stage[i] == REFUSED:
            motions.state[i], motions.lowest[i], motions.highest[i] = np.nan, np.nan, np.nan
    return len(motions.cam), DONE


@inner
def needs_more(plan, motions, i):
    """Whether motion i needs more revolutions."""
    stage = motions.stage[i]
    most = plan.measured if stage == PERIODIC else plan.aperiodic
    return stage == SETTLING or (stage != REFUSED and motions.turns[i] < most)


@inner
def setting_for(s, cams, motions, i):
    """The setting of motion i."""
    j = motions.cam[i]
    low, high = cams.first[j], cams.first[j + 1]
    cam = CamArrays(cams.borders[low + j : high + j + 1], cams.pieces[low:high], motions.speed[i])
    half, foot = cams.half_duration[j], cams.foot[j]
    return Setting(s.train, cam, s.step, s.tables, half, foot)


@inner
def accept(s, plan, motions, i, after):
    """Move on to the state a revolution later; returns whether the remaining change is within the tolerances."""
    distance, n, apart = 0.0, len(s.train.mass), motions.apart[i]
    for j in range(len(after)):
        unit = plan.velocity if n <= j < 2 * n else plan.position
        distance = max(distance, abs(after[j] - motions.state[i, j]) / unit)
    within = motions.remaining[i] * distance < 1.0
    motions.state[i] = after
    motions.within[i] = motions.within[i] + 1 if within else 0
    apart[0], apart[1], apart[2] = (max(apart[0], distance) if within else 0.0), apart[2], distance
    return within


@inner
def settle(s, plan, motions, trace, i):
    """Simulate revolutions until the remaining change is small enough or the limit is reached; returns the code."""
    after, untraced = motions.state[i].copy(), cut(trace, 0, 0)
    while goes_on(motions.revolutions[i], motions.most[i], motions.within[i]):
        code = revolve(s, after, False, untraced, WHOLE)[0]
        if code != DONE:
            return code
        motions.revolutions[i] += 1
        if accept(s, plan, motions, i, after):
            motions.stage[i] = PERIODIC
            return DONE
    motions.stage[i] = APERIODIC
    return DONE


@inner
def measured(s, plan, motions, trace, i):
    """Measure revolutions, followed by one more for the last bounce window; returns the code.

    If the measured revolutions contradict the stage, periodic or not, the motion continues to settle. The last
    revolution of a periodic motion that is not watched ends with the bounce window, at the next opening foot.
    """
    periodic = motions.stage[i] == PERIODIC
    turns = plan.measured if periodic else plan.block
    starts, state, row = np.zeros(turns + 2, dtype=np.int64), motions.state[i].copy(), np.empty(len(NAMES))
    last = s.opening_foot + np.pi if periodic and not plan.watched and s.opening_foot > -np.pi else WHOLE
    code = follow_inside(s, state, starts, False, trace, last)[0]
    if code != DONE:
        return code
    apart, start = motions.apart[i], motions.apart[i, 2] if periodic else 0.0
    for turn in range(turns + (last == WHOLE)):
        accept(s, plan, motions, i, trace.y[starts[turn + 1], : len(state)])
    settles = shrinks(apart[0], start, apart[1], apart[2], motions.within[i] - 2)
    late = motions.revolutions[i] + motions.turns[i] - motions.most[i]
    if plan.watched and (not settles if periodic else goes_back(settles, late, motions.within[i])):
        motions.stage[i] = SETTLING
        motions.revolutions[i] += turns + 1 + motions.turns[i] + motions.turns[i] // turns
        motions.turns[i] = 0
        return DONE
    if motions.turns[i] == 0:
        motions.lowest[i], motions.highest[i] = np.inf, -np.inf
    motions.turns[i] += turns
    for turn in range(turns):
        figures(s, cut(trace, starts[turn], starts[turn + 2]), turn, row)
        for j in range(len(row)):
            unknown = np.isnan(row[j]) or np.isnan(motions.lowest[i, j])
            motions.lowest[i, j] = np.nan if unknown else min(motions.lowest[i, j], row[j])
            motions.highest[i, j] = np.nan if unknown else max(motions.highest[i, j], row[j])
    return DONE
