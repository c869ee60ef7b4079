"""Springs by tables, where resonances are looked for: as stiff as at rest, and as at full lift."""

from dataclasses import replace

import numpy as np
import pytest

from camopt.measure.resonance import _linearised
from camopt.scene.laws import LINEAR, PROGRESSIVE
from camopt.scene.train import GROUND
from tests.verifier.trains import laws, smooth_lift, train


def test_a_spring_by_a_table_is_as_stiff_as_its_compression_at_rest_and_at_full_lift_asks():
    """The cam moves the mass by its lift through an element so stiff that it gives way by a micrometre at most."""
    elements = [(GROUND, 0, False, True, 1e9, 0.0, 0.0, 0.0), (0, GROUND, False, False, 1e4, 0.0, 50.0, 0.0)]
    table = [[0.0, 1e4], [0.01, 3e4]]
    sprung = replace(train([0.1], elements), laws=laws([LINEAR, PROGRESSIVE], [1e9, 1e4], table=table))
    found = _linearised(sprung, smooth_lift(0.008))
    expected = [[1e9, np.interp(compression, *np.transpose(table))] for compression in (0.0, 0.008)]
    np.testing.assert_allclose([one.stiffness for one in found], expected, rtol=1e-3)
    assert _linearised(replace(sprung, laws=None), smooth_lift(0.008))[0].stiffness == pytest.approx(sprung.stiffness)
