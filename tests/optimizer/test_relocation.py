"""Crossings between samples, from which switching angles are read."""

import numpy as np
import pytest

from camopt.optimizer.program.relocation import NoLoadTransfer, _crossing

ANGLE = np.array([0.0, 1.0, 2.0, 3.0, 4.0])
VALUE = np.array([-1.0, 0.0, 1.0, -1.0, 3.0])
"""Rises through zero at 1, and at 3 1/4."""


@pytest.mark.parametrize(
    ("low", "high", "last", "expected"),
    [
        (0.0, 4.0, False, 1.0),
        (0.0, 4.0, True, 3.25),
        (1.0, 2.0, False, 1.0),
        (0.5, 1.0, True, 1.0),
        (2.0, 4.0, 0, 3.25),
    ],
)
def test_a_rise_through_zero_is_found_in_its_range_with_both_ends(low, high, last, expected):
    assert _crossing(ANGLE, VALUE, low, high, last=last, what="it rises") == pytest.approx(expected)


def test_where_nothing_rises_through_zero_it_is_said():
    with pytest.raises(NoLoadTransfer, match="no angle at which it rises"):
        _crossing(ANGLE, VALUE, 1.5, 1.9, last=False, what="it rises")
