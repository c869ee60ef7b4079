"""Programs whose margins no cam keeps: what they fall by, and what is held where forces ring."""

from dataclasses import replace

import numpy as np
import pytest

from camopt.optimizer.program.force_rows import averaged
from camopt.optimizer.program.kinematic import SHORT_OF_FORCE
from camopt.optimizer.search import region
from camopt.optimizer.search.region import solve_elastic
from tests.optimizer.test_no_jump import SPEEDS, program

MARGINS = np.full((3, len(SPEEDS)), 20.0)


@pytest.fixture(scope="module")
def ringing():
    """A program with a force that no cam changes, of a period of two rows, on every contact at every speed."""
    blocks = (replace(b, offset=b.offset + 3e3 * (-1.0) ** np.arange(len(b.kind))) for b in program().blocks)
    return replace(program(), blocks=tuple(blocks))


def test_where_forces_ring_with_what_no_cam_can_help_their_means_are_held(ringing, monkeypatch):
    monkeypatch.setattr(region, "RINGS", 5.0)
    held = solve_elastic(ringing, MARGINS)
    assert held.program.blocks is ringing.blocks and held.program.averaged == 16
    np.testing.assert_array_equal(held.margins, MARGINS)
    of_neither = [averaged(block, 16).offset for block in program().blocks]
    left = np.concatenate([block.offset for block in held.program.constrained]) - np.concatenate(of_neither)
    np.testing.assert_allclose(np.abs(left), 3e3 / 33, rtol=1e-9)  # the mean of 33 that alternate
    assert solve_elastic(program(), MARGINS).program.averaged == 0


def test_margins_fall_for_forces_that_ring_where_the_means_may_not_be_held(ringing, monkeypatch):
    monkeypatch.setattr(region, "RINGS", np.inf)
    lower = solve_elastic(ringing, MARGINS)
    assert lower.program is ringing and lower.margins.max() < -1e3


def test_margins_that_no_cam_keeps_fall_by_what_is_worth_its_price():
    """The cam that comes nearest to them has less area than one that misses a little more."""
    least, priced = program().solve_below(10.0 * MARGINS), solve_elastic(program(), 10.0 * MARGINS)
    fallen = least.margins.min() - priced.margins.min()
    assert fallen > 0.0 and priced.area_ratio - least.area_ratio > SHORT_OF_FORCE * fallen
    further = program().solve(priced.margins - 1.0)
    assert further.area_ratio - priced.area_ratio < SHORT_OF_FORCE
