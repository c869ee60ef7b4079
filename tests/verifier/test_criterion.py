"""When a contact opens: by its force, or by displacement alone as Kodama prints it; told apart on a bouncing mass."""

from functools import partial

import numpy as np
import pytest

from camopt.scene import InputError
from camopt.verifier.methods import rkg, tmm
from tests.verifier.trains import ball_on_seat, no_lift

METHODS = {"rkg": rkg.prepare, "tmm": tmm.prepare, "tmm-exponential": partial(tmm.prepare, exponential=True)}
STIFFNESS, FALL, WEIGHT = 1e6, 0.2, 10.0
STEP = 0.4 / 60_000
OMEGA, TOUCH = np.sqrt(STIFFNESS), np.sqrt(2 * FALL / WEIGHT)


def restitution(zeta: float, criterion: str) -> float:
    """Speed leaving over speed touching of a weightless mass on a spring and damper, both unloaded at the touch.

    x ~ exp(-zeta w t) sin(b t) / b, b = w sqrt(1 - zeta^2): x is zero again at t = pi / b; the force, at which
    k x = -c v, is zero already at t = (pi - arctan(2 zeta b w / (w^2 - 2 (zeta w)^2))) / b for zeta < 1 / sqrt(2).
    """
    b = np.sqrt(1 - zeta**2)
    t = np.pi / b if criterion == "displacement" else (np.pi - np.arctan2(2 * zeta * b, 1 - 2 * zeta**2)) / b
    return float(-np.exp(-zeta * t) * (np.cos(b * t) - zeta / b * np.sin(b * t)))


def rebound(name, zeta, criterion):
    """Restitution and least force of a bounce on the seat, by a method."""
    seat, start = ball_on_seat(STIFFNESS, 2 * zeta * OMEGA), np.array([FALL, 0.0])
    motion = METHODS[name](seat, no_lift(), 2 * np.pi / 0.4, round(0.4 / STEP), criterion=criterion)(start)
    apart = np.flatnonzero((motion.time > TOUCH) & (motion.v[:, 0] > 0) & (motion.x[:, 0] > 0))[0]
    return motion.v[apart, 0] / (WEIGHT * TOUCH), motion.force.min()


@pytest.mark.parametrize("zeta", [0.05, 0.3])
@pytest.mark.parametrize("name", METHODS)
def test_the_mass_leaves_as_fast_as_the_criterion_says(name, zeta):
    by_force, least = rebound(name, zeta, "force")
    by_displacement, pulled = rebound(name, zeta, "displacement")
    # the weight shifts both by some g / (w v), and an unlocated closing errs by about a step's damper impulse
    assert by_force == pytest.approx(restitution(zeta, "force"), abs=0.01)
    assert by_displacement == pytest.approx(restitution(zeta, "displacement"), abs=0.01)
    assert by_force > by_displacement
    assert least == 0.0
    speed = by_displacement * WEIGHT * TOUCH
    damper = -2 * zeta * OMEGA * speed  # at the touch it alone pulls; a step before, the spring still pushes
    assert damper * 1.001 < pulled < damper + 1.1 * STIFFNESS * speed * STEP


def test_the_two_laws_are_far_enough_apart_to_be_told():
    assert restitution(0.3, "force") - restitution(0.3, "displacement") > 0.05
    assert restitution(0.3, "displacement") == pytest.approx(np.exp(-0.3 * np.pi / np.sqrt(1 - 0.09)))


@pytest.mark.parametrize("name", METHODS)
def test_without_a_damper_both_are_one_law(name):
    assert rebound(name, 0.0, "force") == rebound(name, 0.0, "displacement")


@pytest.mark.parametrize("name", METHODS)
def test_force_is_the_default_and_others_are_refused(name):
    ball, start = ball_on_seat(STIFFNESS, 300.0), np.array([FALL, 0.0])
    plain = METHODS[name](ball, no_lift(), 2 * np.pi / 0.4, 20_000)(start)
    force = METHODS[name](ball, no_lift(), 2 * np.pi / 0.4, 20_000, criterion="force")(start)
    assert np.array_equal(plain.x, force.x)
    with pytest.raises(InputError, match="expected force or displacement"):
        METHODS[name](ball, no_lift(), 2 * np.pi, 20_000, criterion="distance")
