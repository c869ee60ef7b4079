"""Crossings between samples, from which switching angles are read."""

from pathlib import Path

import numpy as np
import pytest

from camopt.measure.limits import broken_by_shape
from camopt.optimizer.program.no_jump import no_jump_program
from camopt.optimizer.program.program_cam import program_cam
from camopt.optimizer.program.relocation import NoLoadTransfer, _crossing, converge_tangents
from camopt.scene import build_train, load_scene

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


BUCKET = Path(__file__).resolve().parents[3] / "shared" / "data" / "scenes" / "bucket-tappet.toml"


@pytest.mark.skipif(not BUCKET.is_file(), reason="the scene does not lie beside this checkout")
def test_the_program_of_a_bucket_tappet_is_decided_and_keeps_its_limits():
    """HiGHS left its working set of 196 rows undecided ("Not Set"), which has no largest area without a box."""
    scene = load_scene(str(BUCKET))
    speeds = [scene.cam_speed(speed) for speed in scene.operation.speeds_rpm]
    program = no_jump_program(build_train(scene), scene.design, program_cam(scene.design, 3.0), speeds)
    found = converge_tangents(program).solve_below(np.full((3, len(speeds)), 20.0))
    assert 0.55 < found.area_ratio < 0.63
    assert broken_by_shape(found.lift, scene.design) == []
