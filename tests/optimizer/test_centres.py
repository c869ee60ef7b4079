"""The centres of durations, searched on an area that is a known function of them."""

from types import SimpleNamespace

import numpy as np
import pytest

from camopt.optimizer.program import program_cam as module
from camopt.optimizer.program.program_cam import centres
from camopt.scene import load_scene

DESIGN = load_scene("kodama").design
TWO = DESIGN.model_copy(update={"duration_at": ((1.0, 90.0, 140.0), (4.0, 60.0, 100.0))})


@pytest.mark.parametrize("top", [(3.0, -4.0), (-5.2, 7.7)])
def test_two_rounds_leave_a_sixteenth_of_what_pulls_the_centres_together(monkeypatch, top):
    """The area falls by p^2 + q^2 + p q with the distances p and q from its top: each round moves p to -q / 2, and then
    q to -p / 2."""

    def known(design, cam, explain):
        p, q = np.degrees(cam.about.centres) - top
        return SimpleNamespace(optimum=SimpleNamespace(value=-(p**2 + q**2 + p * q)))

    monkeypatch.setattr(module, "kinematic_optimum", known)
    q = -top[1]
    expected = top[0] - q / 8, top[1] + q / 16
    assert np.degrees(centres(TWO)) == pytest.approx(expected, abs=2 * module.RESOLUTION_DEG)
