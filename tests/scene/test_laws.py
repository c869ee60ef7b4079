"""Elastic laws beyond the linear one: what a scene may say, the force, its slope and its zero, and the rest."""

import numpy as np
import pytest
from scipy.integrate import quad

from camopt.scene import build_train, load_scene, parse_scene, rest_position
from camopt.scene.element import LAWS
from camopt.scene.laws import STAND_IN_FORCE
from tests.scene.test_load import EXAMPLE, assert_one_fault, changed

TRAIN = "stiffness_N_per_m = 1.5e8"
SPRING = "stiffness_N_per_m = 38200.0"
DAMPED, HUNT_CROSSLEY = "damping_N_s_per_m = 1200.0", 'law = "hunt-crossley"\ndissipation_s_per_m = '
TABLE = 'law = "progressive"\nstiffness_table = [[-1.0, 30000.0], [2.0, 36000.0], [8.0, 90000.0]]'


def train(*changes):
    """The example with a progressive spring and a Hertz contact at the cam."""
    own = (SPRING, TABLE), (TRAIN, 'law = "hertz"\nstiffness_N_per_m = 4e10')
    return build_train(parse_scene(changed(EXAMPLE, *own, *changes), "mine.toml"))


def force(parts, e: int, d: float) -> float:
    return float(parts.laws.force(np.full(len(parts.a), d), parts.preload)[e])


@pytest.mark.parametrize(
    ("old", "new", "key", "says"),
    [
        (TRAIN, TRAIN + '\nlaw = "cubic"', "element.1.law", f"{', '.join(map(repr, LAWS[:-1]))} or {LAWS[-1]!r}"),
        (SPRING, 'law = "hertz"', "element.2.stiffness_N_per_m", "missing"),
        (SPRING, SPRING + "\nexponent = 1.5", "element.2.exponent", "only to these"),
        (DAMPED, 'law = "hunt-crossley"', "element.1.dissipation_s_per_m", "missing"),
        (DAMPED, HUNT_CROSSLEY + "0.0", "element.1.dissipation_s_per_m", "greater than 0"),
        (DAMPED, f"{HUNT_CROSSLEY}0.3\n{DAMPED}", "element.1.damping_N_s_per_m", "dissipates energy"),
        (DAMPED, DAMPED + "\ndissipation_s_per_m = 0.3", "element.1.dissipation_s_per_m", "only to it"),
        (TRAIN, TRAIN + '\nlaw = "hertz"\nexponent = 0.5', "element.1.exponent", "greater than or equal to 1"),
        ("preload_N = 0.0 ", 'preload_N = -3.0\nlaw = "hertz" ', "element.1.preload_N", "gap_mm"),
        (SPRING, SPRING + "\nstiffness_table = [[0, 1], [1, 2]]", "element.2.stiffness_table", "only to it"),
        (SPRING, 'law = "progressive"', "element.2.stiffness_table", "missing; give rows"),
        (SPRING, SPRING + "\n" + TABLE, "element.2.stiffness_N_per_m", "leave this key out"),
        (SPRING, TABLE.replace("[2.0,", "[-2.0,"), "element.2.stiffness_table", "ascend"),
        (SPRING, TABLE.replace("36000.0", "-1.0"), "element.2.stiffness_table.2.2", "greater than 0"),
        (SPRING, 'law = "progressive"\nstiffness_table = [[0, 1e4]]', "element.2.stiffness_table", "at least 2"),
    ],
)  # fmt: skip
def test_one_fault_is_one_sentence_with_its_key(old, new, key, says):
    assert_one_fault(changed(EXAMPLE, old, new), f"{key}: ", says)


def test_hertz_is_no_law_of_a_bilateral_spring():
    spring = (SPRING, SPRING + '\nlaw = "hertz"'), ('"spring"\nkind = "contact"', '"spring"\nkind = "spring"')
    assert_one_fault(changed(EXAMPLE, *spring), "element.2.law: ", "law of contacts")


def test_linear_scenes_carry_no_laws():
    linear = build_train(parse_scene(EXAMPLE.replace(TRAIN, TRAIN + '\nlaw = "linear"'), "mine.toml"))
    assert linear.laws is None and linear.stiffness[0] == 1.5e8


def test_hertz_force_touch_and_tangent():
    parts = train()
    assert force(parts, 0, 1e-6) == pytest.approx(4e10 * 1e-9)
    assert force(parts, 0, 4e-6) == pytest.approx(8 * 4e10 * 1e-9)
    assert force(parts, 0, -1e-6) == 0.0
    assert parts.touch_compression[0] == 0.0
    tangent = parts.laws.tangent(np.full(3, 4e-6), parts.preload)[0]
    assert tangent == pytest.approx(1.5 * 4e10 * np.sqrt(4e-6))
    pressed = (STAND_IN_FORCE / 4e10) ** (2 / 3)
    assert parts.stiffness[0] == pytest.approx(1.5 * STAND_IN_FORCE / pressed)


def test_a_preloaded_hertz_contact_has_its_preload_at_compression_zero_and_touches_where_it_ends():
    seat = 'law = "hertz"\nexponent = 1.2\nstiffness_N_per_m = 2e9'
    parts = train(("stiffness_N_per_m = 1.8e8", seat))
    touch = -((250.0 / 2e9) ** (1 / 1.2))
    assert parts.touch_compression[2] == pytest.approx(touch, rel=1e-12)
    assert force(parts, 2, 0.0) == pytest.approx(250.0, rel=1e-12)
    assert force(parts, 2, touch + 3e-6) == pytest.approx(2e9 * 3e-6**1.2, rel=1e-9)
    assert force(parts, 2, touch) == 0.0


@pytest.mark.parametrize("d_mm", [-4.0, -1.0, -0.3, 0.0, 1.1, 2.0, 5.0, 8.0, 12.0])
def test_progressive_force_is_preload_plus_the_integral_of_the_stiffness(d_mm):
    parts, d = train(), d_mm * 1e-3

    def stiffness(c):
        return np.interp(c, [-1e-3, 2e-3, 8e-3], [30e3, 36e3, 90e3])

    expected, _ = quad(stiffness, 0.0, d, points=[-1e-3, 2e-3, 8e-3])
    assert force(parts, 1, d) == pytest.approx(250.0 + expected, rel=1e-9)
    assert parts.laws.tangent(np.full(3, d), parts.preload)[1] == pytest.approx(stiffness(d))
    assert parts.stiffness[1] == pytest.approx(32e3)


@pytest.mark.parametrize("preload", [400.0, 100.0, 10.0, 0.0, -20.0, -100.0, -900.0])
def test_a_progressive_element_is_forceless_at_its_touch(preload):
    parts = train()
    preloads = np.array([0.0, preload, 250.0])
    d = parts.laws.touch(preloads)
    assert parts.laws.force(d, preloads)[1] == pytest.approx(0.0, abs=1e-9)
    assert np.sign(d[1]) == -np.sign(preload)


def test_a_hertz_contact_at_rest_is_pressed_in_by_what_it_carries():
    train = build_train(load_scene("kodama-hertz"))
    x = dict(zip(train.mass_names, rest_position(train), strict=True))
    assert x["camshaft"] - x["follower"] == pytest.approx((19.1 / 2.3138e10) ** (2 / 3), rel=1e-6)  # held by 19.1 N


@pytest.mark.parametrize("preload", [250.0, 260.0, 3000.0])
def test_rest_far_from_that_of_the_linear_stand_in(preload):
    """A seat far softer than its stand-in at small loads, against a spring that stiffens."""
    seat = 'law = "hertz"\nexponent = 3.0\nstiffness_N_per_m = 3e12'
    damped = "damping_N_s_per_m = 4000.0\npreload_N ="
    parts = train((f"stiffness_N_per_m = 1.8e8\n{damped} 250.0", f"{seat}\n{damped} {preload}"))
    (x,) = rest_position(parts)
    spring = 250.0 + quad(lambda c: np.interp(c, [-1e-3, 2e-3, 8e-3], [30e3, 36e3, 90e3]), 0.0, x)[0]
    pressed = max(0.0, (preload / 3e12) ** (1 / 3) - x)
    assert 3e12 * pressed**3 == pytest.approx(spring, rel=1e-8)
    assert (x > 1e-4) == (preload > 1000)


def test_a_mass_that_nothing_holds_is_refused_under_nonlinear_laws_too():
    floating = EXAMPLE + (
        '\n[[mass]]\nname = "loose"\nmass_kg = 0.1\n[[element]]\nname = "loose_contact"\nkind = "contact"\n'
        'between = ["ground", "loose"]\nlaw = "hertz"\nstiffness_N_per_m = 1e10\n'
    )
    assert_one_fault(floating, "nothing holds", "loose")
