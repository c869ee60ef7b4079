"""Parts of single experiments compared with closed forms, other programs, and other formulations."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import linprog

from camopt.cam.families.free import free_cam
from camopt.cam.families.polydyne import polydyne
from camopt.exact import prepare
from camopt.highs import FEASIBILITY
from camopt.optimizer.program.kinematic import kinematic_optimum
from camopt.scene import build_train, load_scene
from camopt.scene.parameters import matching, with_numbers
from camopt.scene.rest import state_at_rest
from camopt.scene.units import DEG, MM
from experiments import chords, drawing_limits, modes, motori, sweep_scaling, table5
from experiments.linear_programs import decided, programs
from experiments.near_limit import scene_of
from experiments.support.dormand_prince import dormand_prince, right_hand_side
from experiments.support.near_limit_cams import band, from_rest, truth
from experiments.work_precision import Case
from tests.experiments import small_cams


def test_a_table_of_one_line_is_the_linear_spring():
    scene = load_scene("kodama")
    train, lift, speed = build_train(scene), polydyne(scene), scene.cam_speed(5000)
    tables = chords.by_tables(train)
    ends = [prepare(t, lift, speed).advance(state_at_rest(t)) for t in (train, tables)]
    assert np.abs(ends[0] - ends[1]).max() < 1e-9


def test_a_program_that_free_columns_leave_undecided_is_decided():
    """A program of a random scene on which HiGHS gave up; SciPy computes its least violation."""
    *_, posed = programs(29)
    assert decided(posed, posed.rows) == "infeasible"
    assert least_violation(posed) > FEASIBILITY


def least_violation(posed) -> float:
    """The smallest s >= 0 by which all scaled rows must be relaxed, by SciPy."""
    matrix, level = posed.rows.scaled, posed.bound / posed.rows.norm
    count = matrix.shape[1]
    give = np.column_stack([matrix, -np.ones(len(matrix))])
    bounds = [(None, None)] * count + [(0, None)]
    return float(linprog(np.append(np.zeros(count), 1.0), A_ub=give, b_ub=level, bounds=bounds, method="highs").fun)


def test_a_continued_motion_is_the_one_from_rest():
    scene = scene_of(4, 20.0)
    lift = kinematic_optimum(scene.design, free_cam(scene.design, 4.0)).lift
    continued, rest = truth(scene, lift, band(scene)), from_rest(scene, lift, band(scene)[[3, 15]])
    # settled to 0.01 um by plain revolutions, whose slowest motion loses 5 % a revolution
    assert continued.figures[[3, 15]] == pytest.approx(rest.figures, abs=5e-4)
    assert np.ptp(continued.figures[:, 2]) > 0


def test_a_step_past_the_stability_limit_is_no_number():
    scene = load_scene("kodama")
    train, lift = build_train(scene), table5.cams(scene)["polydyne"]
    blown = table5.METHODS["tmm"](train, lift, scene.cam_speed(5000), 360)
    assert np.all(np.isnan(table5.bounces(train, blown, lift)))


@pytest.mark.long
@pytest.mark.timeout(3600)
def test_a_million_tasks_by_two_processes_keep_memory_flat(tmp_path):
    small_cams.memory_is_flat(sweep_scaling.memory(1_000_000, 2, tmp_path))


def test_dormand_prince_follows_scipy_where_nothing_switches():
    """The opening ramp: dense output and steps compared with DOP853 at a tolerance of 1e-12."""
    case = Case("small")
    times = np.linspace(0.0, 0.3 * case.times[-1] / 2, 50)
    ours, tried = dormand_prince(case.rest, times, 1e-9, 1e-12, case.arrays)

    def slope(t, y):
        dy = np.empty(20)
        right_hand_side(t, y, dy, case.arrays)
        return dy

    theirs = solve_ivp(slope, times[[0, -1]], case.rest, "DOP853", times, rtol=1e-12, atol=1e-15, max_step=1e-5).y.T
    assert np.abs(ours - theirs)[:, :10].max() < 1e-10
    assert np.ptp(theirs[:, 1]) > 1e-4
    assert tried > 100


def test_the_values_of_limits_are_those_of_formulas_written_again():
    scene = load_scene("kodama").model_copy(update={"geometry": drawing_limits.GEOMETRY["kodama"]})
    lift = kinematic_optimum(scene.design, free_cam(scene.design, 4.0)).lift
    t = np.arange(-72.0, 72.0005, 0.001)
    s, v, a = (lift(t * DEG, k) / MM for k in range(3))
    phi = np.deg2rad(108.0 + 2.0 * t)
    piston = 43.0 * (1 - np.cos(phi)) + 143.0 - np.sqrt(143.0**2 - (43.0 * np.sin(phi)) ** 2)
    open_at = t[s >= 5.0]
    expected = {
        "lift_at": s[18_000],
        "duration_at": open_at[-1] - open_at[0],
        "piston": (4.0 + piston - s).min(),
        "nose_radius_min_mm": (22.0 + s + a).min(),
        "face_width_mm": 2 * np.abs(v).max(),
        "entrainment_min_m_per_s": 5000 * np.pi / 60 * ((22.0 + s) / 2 + a).min() * 1e-3,
    }
    jerk = np.diff(a)
    expected["snap_max_mm_per_deg4"] = np.abs(np.diff(jerk)[1:-1]).max() / 0.001**2 * DEG**2
    expected["waves_max"] = np.count_nonzero(np.diff(np.sign(jerk[np.abs(jerk) > 1e-5 * np.abs(jerk).max()])))
    found = {key: drawing_limits.value_of(key, lift, scene) for key in drawing_limits.LIMITS}
    assert found == pytest.approx(expected, rel=3e-5)


def test_surge_is_that_of_a_uniform_chain_between_fixed_ends():
    found = modes.surge_frequencies(load_scene("kodama"))
    # five masses between six springs: omega_n = 2 sqrt(k / m) sin(n pi / 12)
    expected = 2 * np.sqrt(152000.0 / 0.00833) * np.sin(np.arange(1, 6) * np.pi / 12) / (2 * np.pi)
    np.testing.assert_allclose(found, expected, rtol=1e-9)


@pytest.mark.parametrize("name", motori.ENGINES)
def test_extreme_conditions_do_what_they_must(name):
    scene = load_scene(name)

    def at(rpm=motori.SPEED, spring=1.0, **new):
        keys = "spring.preload_N", "spring.stiffness_N_per_m", "seat.preload_N"
        values = {number: spring * number.of(scene) for key in keys for number in matching(scene, key)}
        values |= {number: value for key, value in new.items() for number in matching(scene, f"train.{key}")}
        return motori.figures_of(with_numbers(scene, values), motori.cam_of(scene), rpm)

    fast, calm, wide = at(4000.0), at(300.0), at(gap_mm=0.4)
    assert min(fast["jump_mm"], fast["bounce_mm"]) > 1 and fast["clash_force_max_N"] > 1000
    assert calm["jump_mm"] == 0 and calm["ripple_N"] < 5 and wide["jump_mm"] > 0.1
    assert wide["contact_force_max_N"] > 1.3 * calm["contact_force_max_N"]
    soft, own, hard = (at(spring=factor)["contact_force_min_N"] for factor in (0.5, 1.0, 2.0))
    assert soft < own - 50 and own < hard - 200  # of a preload of 125, 250 and 500 N
