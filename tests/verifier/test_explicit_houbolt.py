"""MOTORI's explicit form of Houbolt's differences: its stability limit, and the paper's step rule."""

import numpy as np
import pytest

from camopt.cam.families.polydyne import polydyne
from camopt.exact import prepare as event_exact
from camopt.scene import build_train, load_scene
from camopt.scene.rest import state_at_rest
from camopt.scene.train import GROUND
from camopt.scene.units import MM
from camopt.verifier.methods import houbolt
from tests.verifier.trains import no_lift, train


def largest(zeta: float, phase: float, explicit: bool = True) -> float:
    """Largest |x| after 4000 steps of the phase omega h, from 1 m at rest, of one mass on a spring and damper."""
    steps = 4000
    mass = train([1.0], [(GROUND, 0, False, False, 1.0, 2 * zeta, 0.0, 0.0)])
    revolve = houbolt.prepare(mass, no_lift(), 2 * np.pi / (steps * phase), steps, explicit)
    with np.errstate(all="ignore"):
        end = np.abs(revolve(np.array([1.0, 0.0])).x[-100:]).max()
    return float(np.nan_to_num(end, nan=np.inf))


@pytest.mark.parametrize("zeta", [0.0, 0.01, 0.1, 0.3])
def test_stability_limit(zeta):
    limit = np.sqrt((20 / 3 * zeta) ** 2 + 4) - 20 / 3 * zeta
    assert largest(zeta, 0.99 * limit) < 20
    assert largest(zeta, 1.01 * limit) > 1e6
    assert largest(zeta, 1.01 * limit, explicit=False) < 1


def test_step_rule_is_the_papers():
    motor = build_train(load_scene("motori-1"))
    assert houbolt.step_rule(motor) == pytest.approx(0.31 / np.sqrt(1.8e8 / 0.24), rel=1e-12)
    two = train([2.0, 0.5], [(GROUND, 0, False, False, 90.0, 0.0, 0.0, 0.0), (0, 1, False, False, 50.0, 0.0, 0.0, 0.0)])
    assert houbolt.step_rule(two) == pytest.approx(0.031, rel=1e-12)  # 50 / 0.5, not 90 / 2


@pytest.mark.parametrize("explicit", [True, False])
def test_step_rule_is_the_default_and_carries_the_papers_motor(explicit):
    scene = load_scene("motori-1")
    motor, lift, cam_speed = build_train(scene), polydyne(scene), scene.cam_speed(5000)
    rest = state_at_rest(motor)
    motion = houbolt.prepare(motor, lift, cam_speed, explicit=explicit)(rest)
    steps = len(motion.angle) - 1
    assert steps == np.ceil(2 * np.pi / cam_speed / houbolt.step_rule(motor))
    exact = event_exact(motor, lift, cam_speed, 7200)(rest)
    apart = np.abs(motion.x[:, 0] - np.interp(motion.angle, exact.angle, exact.x[:, 0])).max()
    assert apart < 2e-3 * MM  # 0.3 um explicit, 0.9 um implicit: contacts are not located
