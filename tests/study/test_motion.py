"""The motion from rest: its grid, its columns, and whether the columns belong to one motion under Newton's law."""

import numpy as np
import pytest

from camopt.cam.families.polydyne import polydyne
from camopt.scene import (
    InputError,
    MotionRefused,
    Response,
    build_train,
    load_scene,
    parse_scene,
    rest_position,
    scene_text,
)
from camopt.scene.quantities import QUANTITIES
from camopt.study.simulate import motion
from camopt.study.simulate.dataset import motion_table, resampled
from camopt.study.simulate.motion import simulate

KODAMA = load_scene("kodama")
POLYDYNE = polydyne(KODAMA)
MOTION = simulate(KODAMA, POLYDYNE, 6000.0)


def test_grid_starts_at_rest_and_covers_both_revolutions():
    assert MOTION.sizes == {"sample": 7201, "mass": 10, "element": 12, "measured": 1}
    np.testing.assert_allclose(np.diff(MOTION["time_s"]), 0.1 / 360 / 50, rtol=1e-9)
    revolution, angle = MOTION["revolution"].values, MOTION["cam_angle_deg"].values
    np.testing.assert_array_equal(np.unique(revolution, return_counts=True), [[1, 2], [3600, 3601]])
    once = np.arange(3600) * 0.1 - 180
    np.testing.assert_allclose(angle, [*once, *once, 180], atol=1e-9)
    rest = rest_position(build_train(KODAMA))
    np.testing.assert_allclose(MOTION["position_mm"][0], rest * 1e3, atol=1e-15)
    np.testing.assert_array_equal(MOTION["velocity_m_per_s"][0], np.zeros(10))
    assert float(MOTION["lift_mm"][1800]) == pytest.approx(9.4)


def test_positions_and_velocities_are_of_one_motion():
    """Cubic pieces through positions with slopes: the trapezoid of velocities returns the positions."""
    t, x, v = (MOTION[k].values for k in ("time_s", "position_mm", "velocity_m_per_s"))
    travelled = np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(t)[:, None], axis=0)
    scale = np.abs(x).max() * 1e-3
    np.testing.assert_allclose(travelled, (x[1:] - x[0]) * 1e-3, atol=2e-4 * scale)


@pytest.mark.parametrize("mass", KODAMA.mass, ids=lambda m: m.name)
def test_momentum_of_every_mass_follows_its_forces(mass):
    """m (v - v0) = integral of the forces of the columns, with the signs of the design's section 2."""
    t, v = MOTION["time_s"].values, MOTION["velocity_m_per_s"].sel(mass=mass.name).values
    total = mass.force_N - mass.damping_N_s_per_m * v
    for element in KODAMA.element:
        force = MOTION["force_N"].sel(element=element.name).values
        total = total - force * (element.between[0] == mass.name) + force * (element.between[1] == mass.name)
    impulse = np.concatenate([[0.0], np.cumsum(0.5 * (total[1:] + total[:-1]) * np.diff(t))])
    momentum = mass.mass_kg * (v - v[0])
    # trapezoids over 0.1 deg, 0.6 rad of the highest mode (18 kHz), and force steps where contacts close
    np.testing.assert_allclose(impulse, momentum, atol=0.02 * np.abs(momentum).max())


def test_table_has_a_column_for_every_mass_and_element():
    """Their names and order are those of the stored answers of `camopt simulate` (tests/golden)."""
    table = motion_table(MOTION)
    assert len(table) == 3 + 10 + 10 + 12
    np.testing.assert_array_equal(table["valve_head_mm"], MOTION["position_mm"].sel(mass="valve_head"))
    np.testing.assert_array_equal(table["seat_N"], MOTION["force_N"].sel(element="seat"))


SMOOTH = pytest.param("smooth", 1e-4, marks=pytest.mark.long)


@pytest.mark.parametrize(
    ("method", "within_mm"), [("event", 1e-6), ("rkg", 1e-4), ("tmm", 1e-3), ("houbolt", 1e-3), SMOOTH]
)
def test_every_method_gives_the_motion_of_event_exact_whatever_the_step_of_the_result(method, within_mm):
    """One step for all (0.3 rad of the highest mode), so errors differ; measured 1.3e-5, 2.8e-4, 2.1e-4, 2.0e-5 mm."""
    exact = simulate(KODAMA, POLYDYNE, 5000.0, revolutions=1).isel(sample=slice(None, None, 5))
    other = simulate(KODAMA, POLYDYNE, 5000.0, method, revolutions=1, step_deg=0.5)
    np.testing.assert_allclose(other["position_mm"], exact["position_mm"], atol=within_mm)
    assert other.attrs["method"] == method


def test_slow_turning_valve_follows_the_lift():
    """At 100 r/min inertia is nothing: the valve follows lift less lash, short by what the spring load compresses."""
    slow = simulate(KODAMA, POLYDYNE, 100.0, revolutions=1, step_deg=1.0)
    valve = slow["position_mm"].sel(mass="valve_head").values
    high = slow["lift_mm"].values > 1.0
    short = slow["lift_mm"].values[high] - 0.169 - valve[high]
    series = 1 / (1 / 152e6 + 1 / 81.2e6 + 1 / 91.8e6)  # cam to valve tip
    spring = 197 + 152 / 6 * valve[high]
    bearing = (spring + 19.1) / series * 1e3
    # the hold-down loads bearing and cam only: 19.1 N over 5e7 N/m is below 0.4 um
    np.testing.assert_allclose(short, bearing, atol=2e-3)
    assert 0.003 < short.mean() < 0.03


class TestResampled:
    TRAIN = build_train(load_scene("motori-1"))

    def record(self, angle, force):
        """x = t^3 - 2 t^2 on a record of `angle` at 10 rad/s."""
        t = (angle - angle[0]) / 10.0
        x, v = t**3 - 2 * t**2, 3 * t**2 - 4 * t
        return Response(self.TRAIN, 10.0, angle, t, x[:, None], v[:, None], np.tile(force[:, None], 4))

    def test_cubic_motion_is_met_exactly(self):
        angle = np.linspace(-np.pi, np.pi, 14) + np.array([0, *(0.1 * np.sin(np.arange(12))), 0])
        got = resampled(self.record(angle, 5 + 2 * angle), 100)
        t = (np.linspace(-np.pi, np.pi, 101) + np.pi) / 10.0
        np.testing.assert_allclose(got.x[:, 0], t**3 - 2 * t**2, atol=1e-15)
        np.testing.assert_allclose(got.v[:, 0], 3 * t**2 - 4 * t, atol=1e-14)
        np.testing.assert_allclose(got.force[:, 2], 5 + 2 * (10 * t - np.pi), atol=1e-14)
        np.testing.assert_allclose(got.lift, t, atol=1e-15)

    def test_later_value_stands_where_a_force_jumps(self):
        angle = np.array([-np.pi, 0.0, 0.0, 1.0, np.pi, np.pi])
        got = resampled(self.record(angle, np.array([1.0, 1.0, 7.0, 7.0, 7.0, 9.0])), 4)
        np.testing.assert_allclose(got.force[:, 0], [1, 1, 7, 7, 9])
        assert np.all(np.isfinite(got.v))


def test_state_is_carried_into_the_next_revolution(monkeypatch):
    """A method that adds 1 um to every position per revolution, in place of a real one."""
    starts = []

    def prepare(train, lift, cam_speed, steps_per_revolution):
        def revolve(state):
            starts.append(state.copy())
            angle = np.linspace(-np.pi, np.pi, steps_per_revolution + 1)
            x = state[:10] + np.linspace(0, 1e-6, len(angle))[:, None]
            v = np.full_like(x, 1e-6 / (2 * np.pi / cam_speed))
            return Response(train, cam_speed, angle, lift(angle), x, v, np.zeros((len(angle), 12)))

        return revolve

    monkeypatch.setattr(motion, "method_named", lambda name: prepare)
    out = simulate(KODAMA, POLYDYNE, 6000.0, method="rkg", revolutions=3, step_deg=1.0)
    np.testing.assert_allclose(starts[2][:10] - starts[0][:10], 2e-6, atol=1e-15)
    np.testing.assert_allclose(out["position_mm"][-1] - out["position_mm"][0], 3e-3, atol=1e-12)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"speed_rpm": 0.0}, "above 0"),
        ({"speed_rpm": float("nan")}, "above 0"),
        ({"speed_rpm": 1e-3}, "raise the speed"),
        ({"speed_rpm": 1.0}, "million steps of 34 numbers.*GB.*raise the speed"),
        ({"speed_rpm": 1.0, "method": "rkg"}, "raise the speed"),
        ({"speed_rpm": 1.0, "accuracy": "draft"}, "raise the speed"),
        ({"speed_rpm": 1.0, "parameters": {}, "method": "smooth"}, "raise the speed"),
        ({"method": "euler"}, "'euler'"),
        ({"revolutions": 0}, "from 1 to 1000"),
        ({"revolutions": 1.5}, "from 1 to 1000"),
        ({"step_deg": 0.7}, "divides 360"),
        ({"step_deg": -1.0}, "divides 360"),
        ({"step_deg": 1e-5}, "divides 360"),
    ],
)
def test_unusable_arguments(options, says):
    with pytest.raises(InputError, match=says):
        simulate(KODAMA, POLYDYNE, **({"speed_rpm": 6000.0} | options))


@pytest.mark.parametrize("method", ["event", "rkg", pytest.param("smooth", marks=pytest.mark.long)])
def test_every_motion_has_its_metrics(method):
    """With parameters or without, one rule: every declared metric over the revolutions but the last."""
    scene = load_scene("motori-1")
    lift = polydyne(scene)
    plain = simulate(scene, lift, 6000.0, method=method, step_deg=1.0, revolutions=3)
    assert set(QUANTITIES) <= set(plain.data_vars)
    assert plain["bounce_mm"].dims == ("measured",) and plain["measured"].values.tolist() == [1, 2]
    assert plain["bounce_mm"].attrs["units"] == "mm" and plain["bounce_mm"].values[0] > 0.01
    if method != "rkg":
        given = simulate(scene, lift, 6000.0, method=method, step_deg=1.0, revolutions=3, parameters={})
        left_out = {"excess_lift_mm"} if method == "event" else set()
        assert set(QUANTITIES) - left_out <= set(given.data_vars)
        for name in set(QUANTITIES) - left_out:
            assert given[name].dims == plain[name].dims and given[name].attrs == plain[name].attrs
            # a plain record is cubic, its forces linear, between samples of at most 0.8 rad of the highest mode
            np.testing.assert_allclose(given[name], plain[name], rtol=1e-3, atol=1e-3)
    assert simulate(scene, lift, 6000.0, method=method, revolutions=1)["bounce_mm"].shape == (0,)


def test_scene_without_valve():
    with pytest.raises(InputError, match="needs valve"):
        simulate(load_scene("ohv-3dof"), POLYDYNE, 6000.0)


def test_a_motion_that_leaves_all_bounds_is_refused_in_a_sentence():
    """So large a dissipation makes a law that no step follows."""
    text = scene_text("kodama-hertz")
    for damping in ("200.0", "114.0"):  # of the contacts with this law
        text = text.replace(f"damping_N_s_per_m = {damping}\n", "")
    text = text.replace('law = "hertz"', 'law = "hunt-crossley"\ndissipation_s_per_m = 1000.0')
    scene = parse_scene(text, "mine.toml")
    with pytest.raises(MotionRefused, match="has no bound: the step is above"):
        simulate(scene, polydyne(scene), 7000.0, "rkg")
