"""Settling and measuring in stages: which cam a motion has, and the angles of its trace."""

from types import SimpleNamespace

import numpy as np
import pytest

from camopt.exact.kernel import revolution
from camopt.exact.kernel.arrays import CamArrays
from camopt.exact.kernel.revolution import DONE, TRACE_FULL, next_stop
from camopt.exact.kernel.trace import empty_trace
from camopt.exact.settled import run as stages
from camopt.exact.settled.figures import NAMES
from camopt.exact.settled.run import APERIODIC, PERIODIC, SETTLING, Cams, measured, setting_for
from tests.exact.interpreted import interpret


@pytest.fixture(autouse=True)
def _by_python(monkeypatch):
    interpret(monkeypatch, __name__, "camopt.exact.")


def test_every_motion_has_the_borders_and_pieces_of_its_own_cam():
    own = [np.linspace(-np.pi, np.pi, pieces + 1) for pieces in (3, 1, 4)]
    pieces = [np.full((len(borders) - 1, 2), float(j)) for j, borders in enumerate(own)]
    first = np.cumsum([0, *(len(part) for part in pieces)])
    cams = Cams(
        np.concatenate(own), np.concatenate(pieces), first, np.array([1.0, 1.1, 1.2]), np.array([-2.0, -2.1, -2.2])
    )
    s = SimpleNamespace(train=None, step=1.0, tables=None)
    motions = SimpleNamespace(cam=np.array([2, 0, 1]), speed=np.array([10.0, 20.0, 30.0]))
    for i, j in enumerate(motions.cam):
        one = setting_for(s, cams, motions, i)
        assert np.array_equal(one.cam.borders, own[j]) and np.array_equal(one.cam.pieces, pieces[j])
        assert (one.cam.speed, one.half_duration) == (motions.speed[i], cams.half_duration[j])
        assert one.opening_foot == cams.foot[j]


@pytest.mark.parametrize("watched", [False, True])
@pytest.mark.parametrize("missing", [0, 1])
def test_measured_revolutions_follow_each_other_in_a_trace_without_room_to_spare(monkeypatch, missing, watched):
    """What is not watched ends where the valve opens again, and its state is that of the last whole revolution."""
    segments, turns, seen = 3, 2, []
    trace = empty_trace(segments * (turns + 1 - missing), 2, 0)
    trace.angle[:] = np.nan

    angles = []

    def revolve(s, state, regular, rest, angle):
        angles.append(angle)
        rest.angle[: segments + 1] = np.linspace(-np.pi, np.pi, segments + 1)
        state += 1.0
        rest.y[segments] = state
        return DONE, segments, 0

    def figures(s, both, turn, row):
        seen.append(both.angle.copy())
        row[:] = turn

    monkeypatch.setattr(revolution, "revolve", revolve)
    monkeypatch.setattr(stages, "figures", figures)
    rows = np.empty((1, len(NAMES)))
    motions = SimpleNamespace(
        stage=np.array([PERIODIC]), state=np.zeros((1, 2)), lowest=rows, highest=rows.copy(), remaining=np.ones(1),
        within=np.zeros(1, dtype=int), most=np.zeros(1), revolutions=np.zeros(1), apart=np.zeros((1, 3)),
        turns=np.zeros(1, dtype=int),
    )  # fmt: skip
    plan = SimpleNamespace(measured=turns, block=turns, watched=watched, position=1e-6, velocity=1e-3)
    s = SimpleNamespace(train=SimpleNamespace(mass=np.ones(1)), opening_foot=-1.0)
    if watched:  # and seen to settle
        monkeypatch.setattr(stages, "shrinks", lambda *_: True)
    assert measured(s, plan, motions, trace, 0) == (TRACE_FULL if missing else DONE)
    if missing:
        return
    assert angles == [2.0 * np.pi] * turns + [2.0 * np.pi if watched else np.pi - 1.0]
    for turn, shown in enumerate(seen):
        assert shown == pytest.approx(2.0 * np.pi * turn + np.linspace(-np.pi, 3.0 * np.pi, 2 * segments + 1))
    assert np.all(motions.lowest == 0.0) and np.all(motions.highest == turns - 1.0)
    assert np.all(motions.state == turns + watched) and len(seen) == turns
    if watched:  # and all that was run of a motion that goes back has run to settle: of each block one more
        motions.stage[0], motions.turns[0] = APERIODIC, 3 * turns
        monkeypatch.setattr(stages, "goes_back", lambda settles, late, within: late == 3 * turns)
        assert measured(s, plan, motions, trace, 0) == DONE and motions.stage[0] == SETTLING
        assert motions.revolutions[0] == 4 * (turns + 1) and motions.turns[0] == 0


@pytest.mark.parametrize(("share", "within"), [(0.4, 4), (0.6, 0)])
def test_the_way_that_is_left_is_counted_in_shares_of_the_tolerances(share, within):
    """Twice the last change, of two positions, two velocities and a memory."""
    after, s = share * np.array([1e-6, 1e-6, 1e-3, 1e-3, 1e-6]), SimpleNamespace(train=SimpleNamespace(mass=np.ones(2)))
    plan = SimpleNamespace(position=1e-6, velocity=1e-3)
    motions = SimpleNamespace(state=np.zeros((1, 5)), apart=np.zeros((1, 3)), remaining=[2.0], within=[3])
    stages.accept(s, plan, motions, 0, after)
    assert motions.apart[0, 2] == pytest.approx(share) and motions.within == [within]


def test_the_last_border_is_the_end_of_the_revolution_where_rounding_puts_it_before():
    """A span of no length would follow there for ever."""
    cam = CamArrays(np.array([-np.pi, 1.0, np.pi - 1e-13]), np.zeros((2, 1)), 7.0)
    assert next_stop(cam, 1, 0.8, 2.0, 1e-3) == (2.0 * np.pi / 7.0, 2.0, 2.0 * np.pi / 7.0)
