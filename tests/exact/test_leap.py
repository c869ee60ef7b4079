"""Leaps over the base circle against the matrix exponential, and what they say of watches against the modes."""

import numpy as np
import pytest
from scipy.linalg import expm

from camopt.exact import prepare
from camopt.exact.kernel.arrays import train_arrays
from camopt.exact.kernel.building import linear_system
from camopt.exact.kernel.elements import compression, value
from camopt.exact.kernel.leap import leap_of, modal_step, no_switch_possible
from camopt.scene import build_train, load_scene
from camopt.scene.rest import rest_position
from tests.exact.interpreted import interpret
from tests.exact.small_trains import ONCE_A_SECOND, STILL, one_mass, spring


@pytest.fixture(autouse=True)
def _by_python(monkeypatch):
    interpret(monkeypatch, __name__, "camopt.exact.")


@pytest.fixture(params=["motori-1", "pushrod-5mass"])
def still(request):
    """(arrays, pieces at rest, state at rest, leap) of a train."""
    train = build_train(load_scene(request.param))
    arrays, rest = train_arrays(train), rest_position(train)
    leap = leap_of(arrays, rest)
    assert leap.key[0] >= 0
    status = leap.key[0] // arrays.place % np.diff(arrays.first)
    return arrays, status, np.concatenate([rest, np.zeros(len(rest))]), leap


def watches(arrays, status, y):
    """All watches in a state while the cam stands still."""
    seen, y = [], np.concatenate([y, np.zeros(2)])
    for e, piece in enumerate(arrays.first[:-1] + status):
        for w in range(arrays.watched[piece], arrays.watched[piece + 1]):
            seen.append(value(arrays.law[w], *compression(arrays, e, 1.0, y), 0.0))
    return np.array(seen)


def test_a_leap_is_the_exponential_of_the_equations_of_motion(still):
    arrays, status, rest, leap = still
    motion, n2 = linear_system(arrays, status), len(rest)
    system = np.zeros((n2 + 1, n2 + 1))
    system[:n2] = motion[:, [*range(n2), motion.shape[1] - 1]]
    random, count = np.random.default_rng(0), leap.rate.shape[1]
    scale = np.repeat([1e-5, 1e-2], n2 // 2)
    for duration in (1e-5, 1e-4, 2e-3):
        start = rest + scale * random.normal(size=n2)
        found, modes = start.copy(), np.empty(2 * count)
        no_switch_possible(leap, start, modes, np.empty(count))
        modal_step(leap, duration, modes, found)
        wanted = (expm(duration * system) @ np.append(start, 1.0))[:n2]
        np.testing.assert_allclose((found - rest) / scale, (wanted - rest) / scale, rtol=1e-6, atol=1e-7)


def test_a_revolution_without_lift_is_leapt_over_from_its_start_to_its_end():
    """A damped swing in closed form: decay 2 per second, and 400 = decay^2 + turn^2."""
    train = one_mass(spring(400.0) + "\ndamping_N_s_per_m = 4.0")
    start, decay, turn = 0.01, 2.0, np.sqrt(396.0)
    shrunk = start * np.exp(-decay)
    end = [shrunk * (np.cos(turn) + decay / turn * np.sin(turn)), -shrunk * 400.0 / turn * np.sin(turn)]
    assert prepare(train, STILL, ONCE_A_SECOND).advance(np.array([start, 0.0])) == pytest.approx(end, rel=1e-9)


def test_the_level_of_a_watch_is_its_value_at_rest(still):
    arrays, status, rest, leap = still
    assert leap.level == pytest.approx(watches(arrays, status, rest), rel=1e-6, abs=1e-3) and np.ptp(leap.level) > 0.0


def test_a_watch_sways_by_no_more_than_its_sway_and_by_no_less(still):
    arrays, status, rest, leap = still
    count, before = leap.rate.shape[1], watches(arrays, status, rest)
    for j in range(count):
        lowest = np.full(len(leap.level), np.inf)
        for phase in np.linspace(0.0, 2.0 * np.pi, 361):
            modes = np.zeros(2 * count)
            modes[j], modes[count + j] = np.cos(phase), np.sin(phase) * (leap.rate[1, j] > 0.0)
            state = modes @ leap.from_modes[:-1]
            change = watches(arrays, status, rest + 1e-6 * state) - before
            lowest = np.minimum(lowest, 1e6 * change)
        np.testing.assert_allclose(-lowest, leap.sway[:, j], rtol=1e-4, atol=1e-5 * leap.sway.max())
