"""Hunt and Crossley's law by every method: the impact in closed form, a contact torn away, and orders of convergence.

With v the speed of compression, m v dv/du = -k u^n (1 + lambda v) has the integral v / lambda - ln(1 + lambda v) /
lambda^2 + k u^(n + 1) / (m (n + 1)). From the touch at v_i to the touch at -v_r it gives, whatever k, n and m are,
w e^-w = a e^-a with w = 1 - lambda v_r and a = 1 + lambda v_i, which Lambert's W solves.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import lambertw

from camopt.exact import prepare as event
from camopt.exact import with_chords
from camopt.exact.adjoint.motion import TracedMotion
from camopt.scene import InputError
from camopt.scene.laws import KINDS, LINEAR
from camopt.scene.train import GROUND
from camopt.smooth.laws import Layer
from camopt.smooth.simulate import lift_samples
from camopt.smooth.simulate import prepare as smooth
from camopt.smooth.tied import STEPS, parts_of_steps, path_angles, tied_paths, tied_system
from camopt.verifier.methods import dop853, rkg
from tests.verifier.trains import laws, no_lift, smooth_lift, train

MASS, HEIGHT, PERIOD = 0.05, 1e-3, 8e-3
TURNS = 2 * np.pi / PERIOD
DISSIPATION, K = 0.3, 1e3 * 1e-5**-1.5


def ball(exponent: float = 1.5, dissipation: float = DISSIPATION, force: float = 0.0):
    """A mass that is pressed in as far as it lies below zero, with 1 kN at a depth of 10 um."""
    own = laws([KINDS["hunt-crossley"]], 1e3 * 1e-5**-exponent, exponent, dissipation=dissipation)
    return train([MASS], [(GROUND, 0, True, False, 1e8, 0.0, 0.0, 0.0)], force, valve=0, seat=0, laws=own)


def collided(revolve, speed: float) -> tuple[float, float]:
    """Deepest compression [m] and rebound [m/s] of a ball that comes down at a speed [m/s]."""
    motion = revolve(np.array([HEIGHT, -speed]))
    return -motion.x.min(), motion.v[-1, 0]


def expected(exponent: float, speed: float) -> tuple[float, float]:
    """The same in closed form."""
    a, q = 1.0 + DISSIPATION * speed, exponent + 1.0
    rebound = (1.0 + lambertw(-a * np.exp(-a)).real) / DISSIPATION
    work = MASS * (speed / DISSIPATION - np.log(a) / DISSIPATION**2)
    return (q * work / (1e3 * 1e-5**-exponent)) ** (1 / q), rebound


@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.2])
@pytest.mark.parametrize("speed", [0.5, 1.2])
def test_an_impact_is_that_of_the_closed_form(exponent, speed):
    depth, rebound = expected(exponent, speed)
    found = collided(dop853.prepare(ball(exponent), no_lift(), TURNS, 20_000), speed)
    assert found[1] == pytest.approx(rebound, rel=1e-8)
    assert found[0] == pytest.approx(depth, rel=3e-4)  # read off samples: (half of 0.4 us / 20 us)^2 / 2
    found = collided(rkg.prepare(ball(exponent), no_lift(), TURNS, 200_000), speed)
    assert found[1] == pytest.approx(rebound, rel=1e-4)  # it meets the touch up to 0.04 us late


def test_a_slow_impact_has_the_restitution_that_the_source_gives():
    """1 - alpha v with lambda = 3/2 alpha (Hunt and Crossley 1975); the next term is (lambda v)^2 times 4/9."""
    speed = 0.02
    rebound = collided(dop853.prepare(ball(), no_lift(), np.pi / PERIOD / 30, 20_000), speed)[1]
    alpha = DISSIPATION / 1.5
    assert rebound / speed == pytest.approx(1.0 - alpha * speed, abs=(DISSIPATION * speed) ** 2)
    assert 1.0 - rebound / speed > 0.9 * alpha * speed


def test_chords_lose_the_energy_of_the_law_with_an_error_that_falls_with_the_square():
    depth, rebound = expected(1.5, 1.2)
    found = [collided(event(with_chords(ball(), n), no_lift(), TURNS, 20_000), 1.2) for n in (8, 16, 32)]
    errors = np.abs(np.array(found) - (depth, rebound)) / (depth, rebound)
    assert np.all(errors[0] < 0.01) and np.all(errors[:-1] / errors[1:] > 3.0)


def test_the_smoothed_law_is_the_law():
    """The layer of 2 nm is a part in ten thousand of the depth, and begins to push half of it before the touch."""
    depth, rebound = expected(1.5, 1.2)
    found = collided(smooth(ball(), no_lift(), TURNS, eps=2e-9), 1.2)
    assert found[1] == pytest.approx(rebound, rel=1e-5)
    assert found[0] == pytest.approx(depth, rel=1e-3)


def test_runge_kutta_gill_converges_to_dop853():
    """Under n = 2 the force has a slope at the touch, and a step across it errs with the square, on the average."""
    parts, speed = ball(2.0), 2 * np.pi / PERIOD
    truth = dop853.prepare(parts, no_lift(), speed, 40_000)(np.array([HEIGHT, -1.2])).v[-1, 0]
    errors = [abs(collided(rkg.prepare(parts, no_lift(), speed, n), 1.2)[1] - truth) for n in (4000, 8000, 16_000)]
    assert errors[0] < 1e-3 and errors[0] / errors[2] > 10.0


def by_its_own_steps(parts, lift, speed, _):
    return smooth(parts, lift, speed)


@pytest.mark.parametrize("name", ["event", "dop853", "rkg", "smooth"])
def test_a_contact_that_is_torn_away_does_not_pull(name):
    """Pulled off with 5 kN out of a depth of 5 um, faster than 1 / lambda within 3 us: its force is zero then."""
    parts, speed = ball(dissipation=3.0, force=5e3), 2 * np.pi / 1e-4
    prepare = {"event": event, "dop853": dop853.prepare, "rkg": rkg.prepare, "smooth": by_its_own_steps}[name]
    if name == "event":
        parts = with_chords(parts, 64)
    motion = prepare(parts, no_lift(), speed, 20_000)(np.array([-5e-6, 0.0]))
    force, left = motion.force[:, 0], motion.time[np.flatnonzero(motion.force[:, 0] > 0)[-1]]
    assert force.min() == 0.0
    at = np.interp(left, motion.time, motion.v[:, 0])
    assert at == pytest.approx(1.0 / 3.0, rel=0.05)
    assert motion.x[np.searchsorted(motion.time, left), 0] < -1e-6


def test_the_exact_gradient_is_that_of_the_motion_on_chords_and_nears_the_closed_form():
    """Of the rebound by the impact speed, the law's dissipation and its stiffness, which it does not depend on."""
    speed = 1.2

    def rebound(v: float, **numbers: float) -> float:
        parts = ball()
        return event(parts.with_parameters({n: np.array([q]) for n, q in numbers.items()}), no_lift(), TURNS, 20_000)(
            np.array([HEIGHT, -v])
        ).v[-1, 0]

    found = TracedMotion(ball(), no_lift(), TURNS, np.array([HEIGHT, -speed]), mechanical=True).pull_back(
        ends=np.eye(2)
    )
    stiffness = ball().laws.coefficient[0]
    mine = -found.by_start[1, 1], found.by_train.dissipation[1, 0], found.by_train.stiffness[1, 0] * stiffness
    step = 1e-4
    central = [
        (rebound(speed + step) - rebound(speed - step)) / (2 * step),
        (rebound(speed, dissipation=DISSIPATION + step) - rebound(speed, dissipation=DISSIPATION - step)) / (2 * step),
        (rebound(speed, stiffness=stiffness * (1 + step)) - rebound(speed, stiffness=stiffness * (1 - step)))
        / (2 * step),
    ]
    assert mine == pytest.approx(central, rel=1e-6, abs=1e-7)
    slope = (expected(1.5, speed + step)[1] - expected(1.5, speed - step)[1]) / (2 * step)
    assert mine[0] == pytest.approx(slope, rel=0.01) and abs(mine[2]) < 0.01  # sixteen chords


@pytest.mark.parametrize("method", [dop853, rkg], ids=lambda m: m.__name__)
def test_a_judge_refuses_a_law_that_it_has_not_written(method):
    parts = ball()
    later = replace(parts, laws=replace(parts.laws, kind=np.array([max(KINDS.values()) + 1])))
    with pytest.raises(InputError, match="does not implement the law of e0: add it to camopt/verifier/methods/"):
        method.prepare(later, no_lift(), TURNS, 20_000)


def test_a_tied_contact_is_that_of_dop853_on_its_formula():
    """A mass under a spring, pulled along by a cam that it would leave: below 20 N the law goes on along its tangent,
    with the damper of 20 N. Both err by less than a millionth of the largest force."""
    own = laws([KINDS["hunt-crossley"], LINEAR], [K, 3e4], [1.5, 1.0], dissipation=[DISSIPATION, 0.0])
    elements = [(GROUND, 0, True, True, 1e8, 0.0, 0.0, 0.0), (0, GROUND, False, False, 3e4, 5.0, 50.0, 0.0)]
    parts = train([0.1], elements, valve=0, seat=0, cam_side=(0,), laws=own)
    lift, speed = smooth_lift(5e-3), 2 * np.pi / 0.005
    touch, rest = (20.0 / K) ** (2 / 3), -((50.0 / K) ** (2 / 3))

    def pull(theta, x, v):
        u, rate = lift(theta) - x, lift(theta, 1) * speed - v
        pressed = K * max(u, touch) ** 1.5
        return pressed * (1.0 + DISSIPATION * rate) + 1.5 * K * touch**0.5 * min(u - touch, 0.0)

    def rates(theta, y):
        x, v = y
        return np.array([v, (pull(theta, x, v) - 50.0 - 3e4 * x - 5.0 * v) / 0.1]) / speed

    angles, start = path_angles(), np.array([rest, 0.0])
    found = solve_ivp(rates, (-np.pi, np.pi), start, "DOP853", angles, rtol=1e-11, atol=1e-14)
    theirs = np.array([pull(theta, *y) for theta, y in zip(angles, found.y.T, strict=True)])
    tied, samples = tied_system(parts), lift_samples(lift, STEPS)
    more = 4 * parts_of_steps(tied, speed)
    y0, whole = start.reshape(2, 1, 1), (-np.pi, np.pi)
    paths = tied_paths(tied, samples, np.array([speed]), y0, whole, 1.0, Layer(1e-6), parts=more)
    assert theirs.min() < -50.0
    assert np.asarray(paths.force)[:, 0, 0] == pytest.approx(theirs, abs=1e-6 * np.abs(theirs).max())
