"""Every method against motions known from elsewhere: order of convergence, a bouncing mass, each other."""

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from camopt.scene.train import GROUND
from camopt.scene.units import MM
from camopt.study.extremes.extremes import STEP_METHODS as METHODS
from camopt.verifier.methods import rkg
from tests.verifier.scenes import from_rest
from tests.verifier.trains import ball_on_seat, no_lift, smooth_lift, train, two_springs

START = np.array([0.02, -0.03, 0.4, -0.2])
SPEED = 1.5


@cache
def reference():
    """End of one revolution of `two_springs` from START, its equations written out by hand."""
    lift = smooth_lift(0.5)

    def slope(t, y):
        x0, x1, v0, v1 = y
        theta = SPEED * t - np.pi
        s, s_rate = lift(theta), lift(theta, 1) * SPEED
        cam = 1.5 + 300.0 * (s - x0 - 0.1) + 2.0 * (s_rate - v0)
        middle = -0.5 + 150.0 * (x0 - x1 - 0.05) + 1.0 * (v0 - v1)
        spring = 0.7 + 80.0 * x1 + 0.5 * v1
        return [v0, v1, (0.3 - 0.4 * v0 + cam - middle) / 1.0, (0.3 - 0.4 * v1 + middle - spring) / 0.5]

    done = solve_ivp(slope, (0, 2 * np.pi / SPEED), START, "DOP853", rtol=1e-13, atol=1e-14)
    return done.y[:, -1]


@pytest.mark.parametrize(
    ("name", "order", "steps"),
    [  # tmm: v is expanded up to h^3/6 x''''; exponential: the force up to F'': both err by h^4 a step, 3 globally
        ("rkg", 4, (400, 800, 1600, 3200)),
        ("tmm", 3, (400, 800, 1600, 3200)),
        ("tmm-exponential", 3, (400, 800, 1600, 3200)),
        ("houbolt", 2, (3200, 6400, 12800)),
        ("houbolt-explicit", 2, (1600, 3200, 6400)),
    ],
)
def test_order_on_smooth_motion(name, order, steps):
    errors = []
    for count in steps:
        end = METHODS[name](two_springs(), smooth_lift(0.5), SPEED, count)(START)
        errors.append(np.abs(np.concatenate([end.x[-1], end.v[-1]]) - reference()).max())
    slope = -np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert abs(slope - order) < 0.25
    assert errors[-1] < 1e-3 * np.abs(reference()).max()


@pytest.mark.parametrize("name", METHODS)
def test_record_has_every_step_and_the_forces_of_the_motion(name):
    response = METHODS[name](two_springs(), smooth_lift(0.5), SPEED, 4000)(START)
    assert response.angle.shape == (4001,) and response.revolutions == 1
    assert np.allclose(response.x[0], START[:2]) and np.allclose(response.v[0], START[2:])
    cam, middle, _ = response.force.T
    acceleration = np.gradient(response.v[:, 0], response.time)
    balance = 0.3 - 0.4 * response.v[:, 0] + cam - middle
    # central differences of the record and Houbolt's velocities are of second order in a step of about 1e-3 s
    assert np.abs(acceleration - balance)[2:-2].max() < 2e-3 * np.abs(acceleration).max()


def test_gill_carries_the_round_off():
    free = train([1.0], [(0, GROUND, True, False, 1.0, 0.0, 0.0, 1e3)])
    steps, velocity = 200_000, 0.1 / np.pi
    end = rkg.prepare(free, no_lift(), 2 * np.pi, steps)(np.array([1.0, velocity]))
    # a plain sum of 2e5 equal increments is off by about 1e-12; Gill's is off by a few units in the last place
    assert abs(end.x[-1, 0] - (1.0 + velocity)) < 1e-15


def second_flight(stiffness: float, damping: float, height: float) -> tuple[float, float, float]:
    """Touch time, leaving time (force zero) and apex after it of `ball_on_seat` dropped from `height`: analytic."""
    g, v0 = 10.0, np.sqrt(20.0 * height)
    rate, omega = damping / 2, np.sqrt(stiffness - damping**2 / 4)
    sag = g / stiffness

    def x(t):
        return -sag + np.exp(-rate * t) * (sag * np.cos(omega * t) + (rate * sag - v0) / omega * np.sin(omega * t))

    def v(t):
        a, b = sag, (rate * sag - v0) / omega
        cos, sin = np.cos(omega * t), np.sin(omega * t)
        return np.exp(-rate * t) * ((b * omega - rate * a) * cos - (a * omega + rate * b) * sin)

    leave = brentq(lambda t: stiffness * x(t) + damping * v(t), 0.5 * np.pi / omega, 1.2 * np.pi / omega)
    touch = v0 / g
    return touch, touch + leave, x(leave) + v(leave) ** 2 / 20.0


@pytest.mark.parametrize("damping", [0.0, 120.0])
@pytest.mark.parametrize("name", METHODS)
def test_mass_bounces_on_its_seat_as_known(name, damping):
    stiffness, height = 4e4, 0.2
    touch, leave, apex = second_flight(stiffness, damping, height)
    if damping:
        assert 0.1 * height < apex < 0.6 * height  # the case is worth its name
    motion = METHODS[name](ball_on_seat(stiffness, damping), no_lift(), 2 * np.pi / 0.6, 60_000)(
        np.array([height, 0.0])
    )
    step = 0.6 / 60_000
    pushing = np.flatnonzero(motion.force[:, 0] > 0)
    end = pushing[np.flatnonzero(np.append(np.diff(pushing), 2) > 1)[0]]
    assert abs(motion.time[pushing[0]] - touch) < 3 * step
    assert abs(motion.time[end] - leave) < 5 * step
    # contacts are not located: a step early or late moves the velocity by k v h^2 (and c v h), some 1e-3 of itself
    late = motion.time > leave
    assert abs(motion.x[late, 0].max() - apex) < 2e-3 * apex
    assert motion.force.min() >= 0


def test_methods_converge_to_each_other_on_a_valve_train():
    case, rest = from_rest("kodama", 5000)

    def apart(steps):
        runs = [prepare(*case, steps)(rest) for prepare in METHODS.values()]
        return [np.abs(run.x - runs[0].x).max() for run in runs[1:]]

    coarse, fine = apart(7200), apart(28_800)
    assert max(fine) < 1e-3 * MM
    assert max(fine) < 0.5 * max(coarse)


def test_a_step_past_the_stability_limit_shows_itself():
    case, rest = from_rest("kodama", 2000)
    for name, stable in (("rkg", False), ("tmm", False), ("houbolt", True)):
        with np.errstate(all="ignore"):
            end = METHODS[name](*case, 720)(rest).x[-1]
        assert bool(np.abs(end).max() < 1.0) == stable
