"""Elements of real trains against closed forms, by every method: tables, oil, friction, forces by the cam angle."""

import numpy as np
import pytest

from camopt.scene.laws import FRICTION, LINEAR, OIL, TABLE
from camopt.scene.train import GROUND, Forcing
from camopt.study.extremes.extremes import STEP_METHODS
from camopt.verifier.methods import dop853
from tests.verifier.trains import laws, no_lift, train

METHODS = {"dop853": dop853.prepare, **STEP_METHODS}
LOCATED = 1e-8
"""Relative error of DOP853 at its finest permitted error, over a few oscillations."""
FINEST = 70_000
STEPS = {name: (500 if "houbolt" in name else 2_000) * 4 ** np.arange(3) for name in METHODS}
"""More would bring out the rounding of Houbolt's second differences, some 1e-16 of the position times their square."""
SHIFTS = 1 + 0.2 * (0.618034 * np.arange(16) % 1.0)
"""Errors scatter with where in a step a corner falls: their mean is taken over steps that are spread evenly."""
SCATTER = 0.3
"""What two corners of one motion, whose errors partly cancel, leave of doubt about the order at these steps."""
ROUNDING = 1e-10
"""Mean relative error from which nothing is read of an order."""


def under_load(k: float, mass: float, load: float, **numbers):
    """A mass that a load presses down onto a column of oil."""
    column = (GROUND, 0, False, False, k, 0.0, 0.0, 0.0)
    return train([mass], [column], force=-load, laws=laws([OIL], k, **numbers))


def error(name, parts, start, period, scale, known, steps):
    """Largest error of position, velocity and memory after a revolution of `period` [s], relative to `scale`."""
    end = METHODS[name](parts, no_lift(), 2 * np.pi / period, int(steps))(np.array(start))
    state = np.concatenate([end.x[-1], end.v[-1], end.memory[-1]])
    assert state.shape == (parts.state_size,)
    return np.abs((state - known) / scale).max()


def judge(name, *case, order=2.0):
    """DOP853 is right; the errors of the other methods fall by their order across a corner, or faster."""
    if name == "dop853":
        assert error(name, *case, FINEST) < LOCATED
        return
    found = np.array([np.mean([error(name, *case, n * shift) for shift in SHIFTS]) for n in STEPS[name]])
    assert found[-1] < 5e-6
    if found[-1] > ROUNDING:
        fitted = -np.polyfit(np.log(STEPS[name]), np.log(found), 1)[0]
        assert fitted > order - SCATTER


@pytest.mark.parametrize("name", METHODS)
def test_a_free_mass_slides_on_friction_and_swings_where_it_stops(name):
    """It sticks up to slip, is slowed by slip to rest, and swings about the place to which the slider followed."""
    mass, k, slip, speed = 0.3, 4e4, 20.0, 1.0
    omega, reach = np.sqrt(k / mass), slip / k
    parts = train([mass], [(0, GROUND, False, False, k, 0.0, 0.0, 0.0)], laws=laws([FRICTION], k, slip=slip))
    begins = np.arcsin(reach * omega / speed) / omega
    then = np.sqrt(speed**2 - slip**2 / (k * mass))
    slid = mass * then**2 / (2 * slip)
    assert slid > 5 * reach
    after = 0.3 / omega
    period = begins + mass * then / slip + after
    end = slid + reach * np.cos(omega * after), -reach * omega * np.sin(omega * after), slid
    judge(name, parts, [0.0, speed, 0.0], period, [slid, speed, slid], end)


@pytest.mark.parametrize("name", METHODS)
def test_an_oscillator_loses_four_slips_a_swing(name):
    """A stiff slider (Coulomb) takes 4 slip / k of amplitude from each period of a spring, but for its own give."""
    mass, k, slip, amplitude = 1.0, 1e4, 5.0, 0.01
    elements = [(0, GROUND, False, False, stiffness, 0.0, 0.0, 0.0) for stiffness in (k, 1e3 * k)]
    parts = train([mass], elements, laws=laws([LINEAR, FRICTION], [k, 1e3 * k], slip=[0.0, slip]))
    give = slip / (1e3 * k)
    swing = 2 * np.pi / np.sqrt(k / mass)
    steps = 20_000 if name == "dop853" else 200_000
    motion = METHODS[name](parts, no_lift(), np.pi / swing, steps)(np.array([amplitude, 0.0, amplitude - give]))
    for i, lost in ((1, 4 * slip / k), (2 - 0.2, 8 * slip / k)):
        near = np.abs(motion.time - i * swing) < 0.2 * swing
        assert amplitude - motion.x[near, 0].max() == pytest.approx(lost, rel=0.01)


@pytest.mark.parametrize("name", METHODS)
def test_an_adjuster_leaks_down_under_a_constant_load(name):
    """In laminar leakage it sinks at load / leak, steadily: every method has this to rounding."""
    k, leak, load, period = 2e7, 5e4, 600.0, 0.02
    parts = under_load(k, 0.2, load, leak=leak)
    sunk = load / leak * period
    known = -load / k - sunk, -load / leak, sunk
    for steps in STEPS[name][:2]:
        start, scale = [-load / k, -load / leak, 0.0], [sunk, load / leak, sunk]
        assert error(name, parts, start, period, scale, known, steps) < 1e-7


def step_response(t, mass, k, leak, load, speed=0.0):
    """Compression, its rate and memory of a column at t after a load met it at this speed: w = d - z obeys
    m w'' + (m k / leak) w' + k w = load, and z' = k w / leak."""
    a = k / (2 * leak)
    b = np.sqrt(k / mass - a**2)
    static, decay, cos, sin = load / k, np.exp(-a * t), np.cos(b * t), np.sin(b * t)
    q = (speed - a * static) / b
    w = static + decay * (-static * cos + q * sin)
    rate = decay * ((a * static + b * q) * cos + (b * static - a * q) * sin)
    # int e^-at cos bt = (a + e^-at (b sin - a cos)) / (a^2 + b^2), int e^-at sin bt = (b - e^-at (a sin + b cos)) / ...
    both = a**2 + b**2
    area = static * t - static * (a + decay * (b * sin - a * cos)) / both + q * (b - decay * (a * sin + b * cos)) / both
    z = k / leak * area
    return w + z, rate + k / leak * w, z


@pytest.mark.parametrize("name", METHODS)
def test_a_step_load_on_an_adjuster_rings_and_leaks(name):
    mass, k, leak, load, period = 0.2, 2e6, 2e3, 600.0, 6e-3
    d, rate, z = step_response(period, mass, k, leak, load)
    judge(name, under_load(k, mass, load, leak=leak), [0.0, 0.0, 0.0], period, [d, 1.0, d], (-d, -rate, z))


@pytest.mark.parametrize("travel", [0.0, 2e-4])
@pytest.mark.parametrize("name", METHODS)
def test_an_adjuster_fills_while_the_mass_flies_and_holds_it_there(name, travel):
    """Pump-up: the column follows the mass up; from the top the ball first travels, then oil carries the step load."""
    mass, k, leak, load, speed, held = 0.2, 2e6, 2e3, 600.0, 0.9, 2e-3
    parts = under_load(k, mass, load, leak=leak, travel=travel)
    weight = load / mass
    top, falls = speed**2 / (2 * weight), np.sqrt(2 * travel / weight)
    d, rate, z = step_response(held, mass, k, leak, load, weight * falls)
    end = top - travel - d, -rate, -top + z
    period = speed / weight + falls + held
    judge(name, parts, [0.0, speed, 0.0], period, [top, speed, top], end)


@pytest.mark.parametrize("name", METHODS)
def test_a_spring_of_two_slopes_swings_with_half_the_period_of_each(name):
    mass, soft, stiff, speed = 0.4, 2e4, 9e4, 1.5
    rows = np.array([[-1.0, -soft], [0.0, 0.0], [1.0, stiff]])
    slow, fast = np.sqrt(soft / mass), np.sqrt(stiff / mass)
    period = np.pi / slow + 2 * np.pi / fast + 0.25 / slow  # two half swings on the stiff side, one on the soft one
    parts = train([mass], [(0, GROUND, False, False, soft, 0.0, 0.0, 0.0)], laws=laws([TABLE], soft, table=rows))
    end = -speed / slow * np.sin(0.25), -speed * np.cos(0.25)
    judge(name, parts, [0.0, speed], period, [speed / slow, speed], end)


@pytest.mark.parametrize("name", METHODS)
def test_a_gas_impulse_moves_a_free_mass(name):
    """The integral of force over time is its momentum, and twice integrated its way; rows lie between samples."""
    mass, period = 0.15, 0.02
    angle, force = np.array([-np.pi, -1.234, -0.987, 0.555, np.pi]), np.array([0.0, 0.0, 300.0, 0.0, 0.0])
    forcing = (Forcing(0, angle, force), Forcing(0, angle, 0.5 * force))
    parts = train([mass], [(0, GROUND, True, False, 1e5, 0.0, 0.0, 10.0)], forcing=forcing)
    per = period / (2 * np.pi)
    rise, fall = (angle[2] - angle[1]) * per, (angle[3] - angle[2]) * per
    impulse = 1.5 * 0.5 * 300.0 * (rise + fall)
    moment = 1.5 * 0.5 * 300.0 * (rise * (angle[1] * per + rise * 2 / 3) + fall * (angle[2] * per + fall / 3))
    way = (impulse * period / 2 - moment) / mass  # int F (T - t) dt, times from the nose
    judge(name, parts, [0.0, 0.0], period, [way, impulse / mass], (way, impulse / mass))
