"""Chords of a curved law begin and end on it, also where it is preloaded."""

import numpy as np
import pytest

from camopt.exact.affine.lines import CHORD_FORCE, chords
from camopt.scene.laws import HERTZ


@pytest.mark.parametrize("preload", [0.0, 120.0])
def test_chords_of_a_preloaded_point_contact_end_on_its_law(preload):
    """F = k u^m, of which u counts from the touch; pressed in by nothing, the contact has its preload."""
    stiffness, m = 2.0e9, 1.5
    d, force = chords(HERTZ, stiffness, preload, m, np.empty((0, 2)), 8).T
    touch = np.interp(0.0, force, d)
    assert force == pytest.approx(stiffness * np.maximum(d - touch, 0.0) ** m, rel=1e-12, abs=1e-9)
    assert stiffness * max(0.0, -touch) ** m == pytest.approx(preload, rel=1e-12)
    assert (force[0], force[8]) == (0.0, pytest.approx(CHORD_FORCE)) and force[-1] >= 20 * CHORD_FORCE
