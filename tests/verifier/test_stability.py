"""Stability limits of the step methods on an undamped oscillator, by bisection, against theory."""

import numpy as np
import pytest

from camopt.scene.train import GROUND
from camopt.study.extremes.extremes import STEP_METHODS as METHODS
from camopt.verifier.convergence import Prepare
from camopt.verifier.methods import houbolt
from tests.verifier.trains import no_lift, train

STEPS = 4000
LIMITS = {
    "rkg": 2 * np.sqrt(2),  # |1 + z + z^2/2 + z^3/6 + z^4/24| = 1 at z = i 2.83: Hairer, Wanner 1996, IV.2
    "houbolt-explicit": 2.0,  # second central difference
}


def grows(prepare: Prepare, phase: float) -> bool:
    """Whether an oscillator from 1 m at rest has grown beyond 100 m after STEPS steps of omega h = phase."""
    mass = train([1.0], [(GROUND, 0, False, False, 1.0, 0.0, 0.0, 0.0)])
    revolve = prepare(mass, no_lift(), 2 * np.pi / (STEPS * phase), STEPS)
    with np.errstate(all="ignore"):
        end = np.abs(revolve(np.array([1.0, 0.0])).x[-100:]).max()
    return not end < 100.0


@pytest.mark.parametrize("name", LIMITS)
def test_limit_is_that_of_theory(name):
    low, high = 0.5, 8.0
    assert not grows(METHODS[name], low) and grows(METHODS[name], high)
    while high - low > 1e-4:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if grows(METHODS[name], middle) else (middle, high)
    # just past the limit growth takes longer than STEPS to show: 100 times in 4000 steps is 1.00115 a step
    assert low == pytest.approx(LIMITS[name], abs=5e-3)


@pytest.mark.parametrize("phase", [0.5, 2.0, 3.0, 10.0, 1e3, 1e6])
def test_houbolt_has_none(phase):
    assert not grows(METHODS["houbolt"], phase)


@pytest.mark.parametrize("phase", [0.5, 3.0, 10.0, 100.0])
def test_the_exact_exponential_has_none_between_contacts(phase):
    assert not grows(METHODS["tmm-exponential"], phase)


@pytest.mark.parametrize("phase", [0.02, 0.05])
def test_houbolts_own_damping_is_what_its_steps_are_counted_by(phase):
    mass = train([1.0], [(GROUND, 0, False, False, 1.0, 0.0, 0.0, 0.0)])
    motion = houbolt.prepare(mass, no_lift(), 2 * np.pi / (40_000 * phase), 40_000)(np.array([1.0, 0.0]))
    amplitude = np.hypot(motion.x[:, 0], motion.v[:, 0])
    decay = np.log(amplitude[100] / amplitude[-1]) / (motion.time[-1] - motion.time[100])
    assert decay == pytest.approx(phase**3 / 2, rel=0.02)
    steps = houbolt.enough_steps(mass, 1.0)  # omega = 1 rad/s over 2 pi s: h^3 / 2 = 0.1 / (2 pi)
    assert steps == int(np.ceil(2 * np.pi / (0.2 / (2 * np.pi)) ** (1 / 3)))
