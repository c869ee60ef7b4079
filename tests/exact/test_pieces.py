"""Elements in pieces against closed forms: tables, friction, oil, gas force, and what is refused."""

from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

from camopt.exact import prepare
from camopt.exact.adjoint.motion import TracedMotion
from camopt.exact.affine.pieces import numbers_of, parts_of
from camopt.scene import InputError, build_train, parse_scene
from tests.exact.gradient_problems import by_train
from tests.exact.small_trains import ONCE_A_SECOND, STILL, friction, one_mass, spring


def moved(train, *state, samples=400):
    """The first second from a state (x, v, z) [m], [m/s], [m]."""
    return prepare(train, STILL, ONCE_A_SECOND, samples)(np.array(state))


def turning_points(response):
    """Positions [m] at which the first mass turns, from parabolas through the samples around."""
    v, x, t = response.v[:, 0], response.x[:, 0], response.time
    k = np.flatnonzero(v[:-1] * v[1:] < 0.0)
    share = v[k] / (v[k] - v[k + 1])
    width = (t[k + 1] - t[k]) * share
    return x[k] + 0.5 * v[k] * width


def test_a_two_slope_spring_swings_half_a_period_on_each_slope():
    table = 'kind = "spring"\nbetween = ["ground", "m"]\nlaw = "table"\nforce_table = [[-5, -2], [0, 0], [5, 6]]'
    response = moved(one_mass(table), 0.0, 1.0, samples=4000)
    period = np.pi / np.sqrt(400.0) + np.pi / np.sqrt(1200.0)
    switch = response.time[:-1][np.diff(response.angle) == 0.0]
    np.testing.assert_allclose(switch[1::2][:3], period * np.arange(1, 4), rtol=1e-12)
    energy = 0.5 * response.v[:, 0] ** 2 + np.where(response.x[:, 0] > 0, 200.0, 600.0) * response.x[:, 0] ** 2
    np.testing.assert_allclose(energy, 0.5, rtol=1e-11)


def test_a_sliding_oscillator_turns_where_friction_has_taken_its_energy():
    k, stick, slip = 400.0, 1.0e5, 10.0
    response = moved(one_mass(spring(k), friction(stick, slip)), 0.2, 0.0, -0.2, samples=4000)
    expected, taken = (
        [0.2],
        slip**2 / stick,
    )  # sliding way is shorter than the swing by what the friction's spring takes
    for _ in range(3):
        x, less = expected[-1], taken if len(expected) == 1 else 2 * taken
        rest = 0.0 if len(expected) > 1 else slip**2 / (2 * stick)  # energy that stays in that spring
        # k (x^2 - y^2) / 2 = slip (x + y) - less + rest
        roots = np.roots([k / 2, slip, slip * x - less + rest - k / 2 * x**2])
        expected.append(float(np.max(np.real(roots))))
    turns = np.abs(turning_points(response))[:3]
    np.testing.assert_allclose(turns, expected[1:], rtol=1e-5)
    stored = 0.5 * response.v[:, 0] ** 2 + 200.0 * response.x[:, 0] ** 2 + response.force[:, 1] ** 2 / (2 * stick)
    z, force = response.memory[:, 0], response.force[:, 1]
    lost = np.concatenate([[0.0], np.cumsum(np.diff(z) * 0.5 * (force[1:] + force[:-1]))])
    np.testing.assert_allclose(stored + lost, 8.0, rtol=1e-9)
    assert np.abs(force).max() <= slip * (1 + 1e-12)
    train = one_mass(spring(k), friction(stick, slip))
    out_of_reach, slipping = (moved(train, 0.2, 0.0, z).x for z in (0.0, slip / stick - 0.2))
    np.testing.assert_allclose(out_of_reach, slipping, atol=1e-12)


OIL = """kind = "adjuster"
between = ["ground", "m"]
stiffness_N_per_m = 1.0e6
leak_N_s_per_m = 1.0e4
preload_N = 40.0
spring_N_per_m = 2000.0
stroke_mm = 30.0
check_travel_mm = 0.1"""


def test_an_oil_column_under_a_constant_load_leaks_down():
    """Ball on its seat: a linear system of position, velocity and memory. It begins at the speed load / leak."""
    train = one_mass(OIL, mass_kg=0.5, force_N=-100.0)
    k, leak, spring_N, rate = 1.0e6, 1.0e4, 40.0, 2000.0
    # x'' = -(load - plunger - oil) / m, d = -x: plunger = 40 + 2000 d, oil = k (d - z - travel), z' = oil / leak
    a = np.array([[0, 1, 0, 0], [-(k + rate) / 0.5, 0, -k / 0.5, (-100.0 + spring_N - k * 1e-4) / 0.5],
                  [-k / leak, 0, -k / leak, -k * 1e-4 / leak], [0, 0, 0, 0]])  # fmt: skip
    start = np.array([0.0, -60.0 / leak, -1e-4 - 60.0 / k, 1.0])
    response = moved(train, *start[:3])
    expected = np.array([expm(a * t) @ start for t in response.time[::40]])
    np.testing.assert_allclose(response.x[::40, 0], expected[:, 0], atol=1e-15)
    np.testing.assert_allclose(response.memory[::40, 0], expected[:, 2], atol=1e-15)
    assert response.x[-1, 0] == pytest.approx(-60.0 / leak, rel=0.2)


def test_a_step_load_on_an_adjuster_rings_on_the_oil_and_refills_without_force():
    train = one_mass(OIL, mass_kg=0.5, force_N=-100.0)
    response = moved(train, 0.0, 0.5, 0.0)  # thrown off: the ball opens, oil follows, and the column catches the mass
    oil, z, d = response.force[:, 1], response.memory[:, 0], -response.x[:, 0]
    assert oil.max() > 100.0 and oil.min() > -1e-9
    assert (d - z).min() > -1e-12 and z.min() < -1e-3
    energy = 0.25 * response.v[:, 0] ** 2 + 100.0 * response.x[:, 0] + 40.0 * d + 1000.0 * d**2 + oil**2 / 2.0e6
    flying = response.time < response.time[np.argmax(oil > 0.0)]
    np.testing.assert_allclose(energy[flying], energy[0], rtol=1e-12)
    assert np.all(np.diff(energy) < 1e-12)


def test_a_gas_force_gives_a_free_mass_its_impulse():
    gas = '[[force]]\non = "m"\ntable = [[-180, 0], [-90, 0], [-45, 300], [45, 0], [180, 0]]'
    train = one_mass(spring(1e-10), mass_kg=2.0, more=gas)
    response = moved(train, 0.0, 0.0)
    assert response.v[-1, 0] == pytest.approx(0.5 * 300 * (135 / 360) / 2.0, rel=1e-9)
    centre = (-90 + -45 + 45) / 3  # of the triangle of force, by the angle
    assert response.x[-1, 0] == pytest.approx(response.v[-1, 0] * (180 - centre) / 360, rel=1e-9)
    motion = TracedMotion(train, STILL, ONCE_A_SECOND, np.zeros(2), mechanical=True)
    by_rows = by_train(motion.pull_back(ends=np.eye(2))).forcing
    assert by_rows @ train.forcing[0].force == pytest.approx(motion.end, rel=1e-9), "the motion is linear in the force"


def test_too_many_combinations_are_refused_in_one_sentence():
    rows = ", ".join(f"[{i}, {i}]" for i in range(60))
    table = f'kind = "spring"\nbetween = ["ground", "m"]\nlaw = "table"\nforce_table = [{rows}]'
    train = one_mass(*[table] * 11)
    with pytest.raises(InputError, match=r"combine in .* ways, and at most"):
        prepare(train, STILL, ONCE_A_SECOND)


def test_a_long_adjuster_keeps_its_stops():
    """Rows that lie further apart than any other table's are still the element's own."""
    text = (Path(__file__).parents[1] / "scene" / "real.toml").read_text()
    changes = {"stroke_mm = 3.0": "stroke_mm = 600.0", "spring_N_per_m = 2000.0": "spring_N_per_m = 100.0"}
    for old, new in changes.items():
        assert text.count(old) == 1
        text = text.replace(old, new)
    train = build_train(parse_scene(text, "real.toml"))
    e = train.element_names.index("lifter")
    acting = [piece.force[1] for piece in parts_of(train, numbers_of(train))[e].pieces if piece.force[1]]
    assert acting == pytest.approx([2.0e7, 100.0, 2.0e7])
