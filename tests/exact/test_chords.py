"""Curved laws by chords: the error of the force is what is said, and the motion's error falls as the force's does."""

import numpy as np
import pytest

from camopt.exact import prepare, with_chords
from camopt.exact.affine import lines
from camopt.exact.affine.lines import CHORD_FORCE, chords
from camopt.scene import InputError, build_train, load_scene
from camopt.scene.laws import HERTZ as HERTZ_LAW
from experiments.chords import chord_error
from tests.exact.small_trains import ONCE_A_SECOND, STILL, one_mass

HERTZ = 'kind = "contact"\nbetween = ["ground", "m"]\nlaw = "hertz"\nstiffness_N_per_m = 1.0e9'
PROGRESSIVE = """kind = "spring"
between = ["ground", "m"]
law = "progressive"
preload_N = 50.0
stiffness_table = [[0, 2.0e4], [4, 3.0e4], [5, 9.0e4]]"""
PULLED = PROGRESSIVE.replace("[[0, 2.0e4], [4, 3.0e4], [5, 9.0e4]]", "[[-5, 9.0e4], [-4, 3.0e4], [0, 2.0e4]]")
"""The same law for a spring that is pulled: no row of its table has a positive compression."""
HELD = 'kind = "spring"\nbetween = ["ground", "m"]\nstiffness_N_per_m = 1.0'


def hertz(d):
    return 1.0e9 * np.maximum(d, 0.0) ** 1.5


def progressive(d):
    """50 N, and the integral of a stiffness that rises from 2e4 by 1e4 over 4 mm and by 6e4 over the fifth one."""
    inside = 2.0e4 * d + 0.5 * 2.5e6 * np.clip(d, 0.0, 4e-3) ** 2 + 1.0e4 * np.maximum(d - 4e-3, 0.0)
    bend = 0.5 * 6.0e7 * np.clip(d - 4e-3, 0.0, 1e-3) ** 2 + 6.0e4 * np.maximum(d - 5e-3, 0.0)
    return 50.0 + inside + bend


def pulled(d):
    """`progressive`, turned about the preload of 50 N at compression zero."""
    return 100.0 - progressive(-d)


@pytest.mark.parametrize(
    ("element", "law", "range_m"),
    [
        (HERTZ, hertz, (0.0, (5000 / 1e9) ** (2 / 3))),
        (PROGRESSIVE, progressive, (-1e-3, 8e-3)),
        (PULLED, pulled, (-8e-3, 1e-3)),
    ],
    ids=["hertz", "progressive", "pulled"],
)
@pytest.mark.parametrize("count", [8, 16])
def test_the_force_misses_by_what_is_said(element, law, range_m, count):
    train = one_mass(element, HELD)
    rows, d = with_chords(train, count).laws.table[0], np.linspace(*range_m, 100_001)
    error = np.abs(np.interp(d, *rows.T) - law(d)).max()
    assert error == pytest.approx(chord_error(train, count)[0], rel=1e-3)
    if element == HERTZ:
        assert error == pytest.approx(5000 / (6 * count**2), rel=1e-3)


@pytest.mark.parametrize("count", [8, 16, 64])
def test_a_contact_that_hammers_misses_by_one_share_of_its_force(count):
    """2 (m - 1) / (m N^2) = 2 / (3 N^2) of the force, from 5 to 100 kN, as long as chords are many."""
    rows, d = with_chords(one_mass(HERTZ, HELD), count).laws.table[0], np.geomspace(5e3, 1e5, 20_001)
    d = (d / 1e9) ** (2 / 3)
    share = np.abs(np.interp(d, *rows.T) / hertz(d) - 1).max()
    assert share == pytest.approx(2 / (3 * count**2), rel=1.0 / count)
    assert rows[-1, 1] >= 1e5


@pytest.mark.parametrize("speed", [1.0, 6.0])
def test_a_ball_is_pressed_in_as_deep_as_its_energy_says_with_an_error_that_falls_with_the_square(speed):
    """Hertz contact in closed form: m v^2 / 2 = (2 / 5) k d^(5/2). The faster ball presses with 39 kN."""
    train = one_mass(HERTZ, HELD)
    depth = (1.25 * speed**2 / 1e9) ** 0.4

    def deepest(count):
        state = np.array([0.0, -speed])
        return -prepare(with_chords(train, count), STILL, 40 * ONCE_A_SECOND, 20_000)(state).x[:, 0].min()

    errors = np.array([abs(deepest(count) - depth) for count in (4, 8, 16)]) / depth
    assert errors[0] < 0.02 and np.all(errors[:-1] / errors[1:] > 3.0)


@pytest.mark.parametrize("preload", [0.0, 120.0])
def test_chords_of_a_preloaded_point_contact_end_on_its_law(preload):
    """F = k u^m, of which u counts from the touch; pressed in by nothing, the contact has its preload."""
    stiffness, m = 2.0e9, 1.5
    d, force = chords(HERTZ_LAW, stiffness, preload, m, np.empty((0, 2)), 8).T
    touch = np.interp(0.0, force, d)
    assert force == pytest.approx(stiffness * np.maximum(d - touch, 0.0) ** m, rel=1e-12, abs=1e-9)
    assert stiffness * max(0.0, -touch) ** m == pytest.approx(preload, rel=1e-12)
    assert (force[0], force[8]) == (0.0, pytest.approx(CHORD_FORCE)) and force[-1] >= 20 * CHORD_FORCE


def test_without_curved_laws_nothing_changes():
    train = build_train(load_scene("kodama"))
    assert with_chords(train) is train and not chord_error(train, 16).any()


def test_a_law_that_chords_do_not_represent_is_refused(monkeypatch):
    monkeypatch.setattr(lines, "WRITTEN", range(1))
    with pytest.raises(InputError, match="event-exact does not implement the law of cam_follower, follower_valve"):
        with_chords(build_train(load_scene("kodama-hertz")), 3)
