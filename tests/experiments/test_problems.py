"""Every method on every fixed problem, within the tolerance of the table."""

from functools import cache

import numpy as np
import pytest

from camopt.study.extremes.extremes import LOCATING, STEP_METHODS
from experiments.fixed_problems import ANGLE, FINE, HEIGHT, PROBLEMS, bouncing, position

METHODS = {**STEP_METHODS, "event": LOCATING["event"]}
EXACT_SAMPLES = 1440
"""Fewer than those of the reference, so that event-exact takes other internal steps."""


@cache
def reference(i: int) -> np.ndarray:
    return PROBLEMS[i].reference(ANGLE)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("i", range(len(PROBLEMS)), ids=[p.name for p in PROBLEMS])
def test_method_within_its_tolerance(i, method):
    problem, setting = PROBLEMS[i], PROBLEMS[i].setting()
    steps = EXACT_SAMPLES if method == "event" else FINE
    motion = METHODS[method](setting.train, setting.lift, setting.cam_speed, steps)(setting.start)
    error = np.abs(position(setting, motion, ANGLE) - reference(i)).max()
    assert error < problem.tolerance[method]
    assert np.ptp(reference(i)) > 5e-3  # it moves
    if method != "event":
        assert error > 1e-3 * problem.tolerance[method]  # a tolerance far above the error would test nothing


def test_the_ball_keeps_its_energy_and_its_law():
    t = np.linspace(0.0, 1.0, 200_001)
    x = bouncing(t)
    v, a = np.gradient(x, t), np.gradient(np.gradient(x, t), t)
    assert x.max() == pytest.approx(HEIGHT, rel=1e-6)
    energy = 0.5 * v**2 + 10.0 * x + 0.5 * 4e4 * np.minimum(x, 0.0) ** 2
    assert np.abs(energy[5:-5] - 10.0 * HEIGHT).max() < 1e-3
    force = np.where(x < 0, -4e4 * x, 0.0) - 10.0
    away = np.abs(x) > 1e-4
    assert np.abs(a - force)[5:-5][away[5:-5]].max() < 1e-2 * np.abs(force).max()
