"""Stability limits of the step methods on an oscillator against theory, and the steps that Houbolt's method takes."""

import numpy as np
import pytest

from camopt.exact import prepare as event_exact
from camopt.scene import build_train, load_scene
from camopt.scene.train import GROUND
from camopt.scene.units import MM
from camopt.study.extremes.extremes import STEP_METHODS as METHODS
from camopt.verifier.convergence import Prepare
from camopt.verifier.methods import houbolt
from tests.verifier.scenes import from_rest
from tests.verifier.trains import no_lift, train

STEPS = 4000
LIMITS = {
    "rkg": 2 * np.sqrt(2),  # |1 + z + z^2/2 + z^3/6 + z^4/24| = 1 at z = i 2.83: Hairer, Wanner 1996, IV.2
    "houbolt-explicit": 2.0,  # second central difference
}


def oscillator(zeta: float = 0.0):
    return train([1.0], [(GROUND, 0, False, False, 1.0, 2 * zeta, 0.0, 0.0)])


def largest(prepare: Prepare, phase: float, zeta: float = 0.0) -> float:
    """Largest |x| [m] of an oscillator from 1 m at rest after STEPS steps of omega h = phase."""
    revolve = prepare(oscillator(zeta), no_lift(), 2 * np.pi / (STEPS * phase), STEPS)
    with np.errstate(all="ignore"):
        end = np.abs(revolve(np.array([1.0, 0.0])).x[-100:]).max()
    return float(np.nan_to_num(end, nan=np.inf))


def grows(prepare: Prepare, phase: float) -> bool:
    """Whether it has grown beyond 100 m."""
    return largest(prepare, phase) >= 100.0


@pytest.mark.parametrize("name", LIMITS)
def test_limit_is_that_of_theory(name):
    low, high = 0.5, 8.0
    assert not grows(METHODS[name], low) and grows(METHODS[name], high)
    while high - low > 1e-4:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if grows(METHODS[name], middle) else (middle, high)
    # just past the limit growth takes longer than STEPS to show: 100 times in 4000 steps is 1.00115 a step
    assert low == pytest.approx(LIMITS[name], abs=5e-3)


@pytest.mark.parametrize("zeta", [0.01, 0.1, 0.3])
def test_damping_lowers_the_limit_of_the_explicit_form(zeta):
    limit = np.sqrt((20 / 3 * zeta) ** 2 + 4) - 20 / 3 * zeta
    assert largest(METHODS["houbolt-explicit"], 0.99 * limit, zeta) < 20
    assert largest(METHODS["houbolt-explicit"], 1.01 * limit, zeta) > 1e6
    assert largest(METHODS["houbolt"], 1.01 * limit, zeta) < 1


@pytest.mark.parametrize("phase", [0.5, 2.0, 3.0, 10.0, 1e3, 1e6])
@pytest.mark.parametrize("name", ["houbolt", "tmm-exponential"])
def test_houbolt_and_between_contacts_the_exact_exponential_have_none(name, phase):
    assert not grows(METHODS[name], phase)


@pytest.mark.parametrize("phase", [0.02, 0.05])
def test_houbolts_own_damping_is_what_its_steps_are_counted_by(phase):
    motion = houbolt.prepare(oscillator(), no_lift(), 2 * np.pi / (40_000 * phase), 40_000)(np.array([1.0, 0.0]))
    amplitude = np.hypot(motion.x[:, 0], motion.v[:, 0])
    decay = np.log(amplitude[100] / amplitude[-1]) / (motion.time[-1] - motion.time[100])
    assert decay == pytest.approx(phase**3 / 2, rel=0.02)
    steps = houbolt.enough_steps(oscillator(), 1.0)  # omega = 1 rad/s over 2 pi s: h^3 / 2 = 0.1 / (2 pi)
    assert steps == int(np.ceil(2 * np.pi / (0.2 / (2 * np.pi)) ** (1 / 3)))


def test_step_rule_is_the_papers():
    motor = build_train(load_scene("motori-1"))
    assert houbolt.step_rule(motor) == pytest.approx(0.31 / np.sqrt(1.8e8 / 0.24), rel=1e-12)
    two = train([2.0, 0.5], [(GROUND, 0, False, False, 90.0, 0.0, 0.0, 0.0), (0, 1, False, False, 50.0, 0.0, 0.0, 0.0)])
    assert houbolt.step_rule(two) == pytest.approx(0.031, rel=1e-12)  # 50 / 0.5, not 90 / 2


@pytest.mark.parametrize("explicit", [True, False])
def test_step_rule_is_the_default_and_carries_the_papers_motor(explicit):
    (motor, lift, cam_speed), rest = from_rest("motori-1", 5000)
    motion = houbolt.prepare(motor, lift, cam_speed, explicit=explicit)(rest)
    steps = len(motion.angle) - 1
    assert steps == np.ceil(2 * np.pi / cam_speed / houbolt.step_rule(motor))
    exact = event_exact(motor, lift, cam_speed, 7200)(rest)
    apart = np.abs(motion.x[:, 0] - np.interp(motion.angle, exact.angle, exact.x[:, 0])).max()
    assert apart < 2e-3 * MM  # 0.3 um explicit, 0.9 um implicit: contacts are not located
