"""The kinematic program and its certificate: known bounds, weak duality, shadow prices, contradictory limits, and words
on area ratios beyond what is possible."""

from dataclasses import replace

import numpy as np
import pytest

from camopt.cam.design_file import write_design
from camopt.cam.families.free import free_cam
from camopt.cam.families.polydyne import polydyne
from camopt.cli.parser import main
from camopt.optimizer.bound.certificate import Certificate, _constant, _switching_function, area_ratio_bound, area_words
from camopt.optimizer.program.kinematic import first_working, kinematic_optimum, spline_rows
from camopt.optimizer.program.linear_program import maximise
from camopt.scene import InputError, load_scene
from camopt.scene.units import DEG, MM, MM_PER_DEG2

SCENE = load_scene("kodama")
KODAMA = SCENE.design


def changed(**limits):
    return KODAMA.model_copy(update=limits)


FREE_NOSE = changed(nose_deg=None)
SKEW = changed(closing_ramp_height_mm=0.35, closing_ramp_velocity_mm_per_deg=0.02)


@pytest.mark.parametrize(
    ("jerk", "feasible", "coarse_bound"),
    [(0.0008, 0.52166, 0.52176), (0.0015, 0.58374, 0.58410), (0.003, 0.61798, 0.61890), (0.01, 0.64111, 0.64463)],
)
def test_bound_lies_between_the_known_feasible_cam_and_the_known_bound(jerk, feasible, coarse_bound):
    """Feasible C2 cams and bounds of an earlier computation (point masses on the acceleration, twice as coarse)."""
    bound = area_ratio_bound(changed(jerk_max_mm_per_deg3=jerk, nose_deg=None)).bound
    assert feasible - 5e-6 <= bound <= coarse_bound
    assert bound - feasible < 5e-5


def bang_bang_area_ratio() -> float:
    """Largest area without a jerk limit: full acceleration, full deceleration, dwell at the maximum lift."""
    a, d, v, y, top, half = 0.015, 0.008, 0.011, 0.265, 9.4, 72.0
    # a t1 + v = d t2 and the rise v t1 + a t1^2/2 + d t2^2/2 = top - y
    quadratic = [a / 2 + a**2 / (2 * d), v + a * v / d, v**2 / (2 * d) - (top - y)]
    t1 = np.max(np.roots(quadratic))
    t2 = (a * t1 + v) / d
    area = y * t1 + v * t1**2 / 2 + a * t1**3 / 6 + top * t2 - d * t2**3 / 6 + top * (half - t1 - t2)
    return area / (top * half)


@pytest.mark.parametrize("nose", [None, 40.0])
def test_without_a_jerk_limit_the_bound_is_bang_bang(nose):
    bound = area_ratio_bound(changed(jerk_max_mm_per_deg3=None, nose_deg=nose)).bound
    assert bang_bang_area_ratio() == pytest.approx(0.650821, abs=1e-6)
    assert bang_bang_area_ratio() <= bound < bang_bang_area_ratio() + 3e-6


@pytest.mark.parametrize(("jerk", "spline"), [(0.0015, 0.5813), (0.003, 0.6131), (0.01, 0.6337)])
def test_kinematic_optimum_of_three_degree_knots(jerk, spline):
    design = changed(jerk_max_mm_per_deg3=jerk, nose_deg=None)
    found = kinematic_optimum(design, free_cam(design, 3.0))
    assert found.area_ratio == pytest.approx(spline, abs=6e-5)  # four digits are known
    assert found.lift.area_ratio(9.4 * MM) == pytest.approx(found.area_ratio, abs=1e-13)
    assert found.lift.max_lift / MM <= 9.4


@pytest.mark.parametrize("design", [KODAMA, SKEW, changed(jerk_max_mm_per_deg3=None)], ids=["nose", "skew", "no-jerk"])
def test_finer_knots_approach_the_bound_from_below(design):
    bound = area_ratio_bound(design).bound
    areas = [kinematic_optimum(design, free_cam(design, knot)).area_ratio for knot in (3.0, 2.0, 1.0)]
    assert areas[0] < areas[1] < areas[2] < bound
    assert bound - areas[2] < (1e-3 if design.jerk_max_mm_per_deg3 else 7e-3)


def random_certificate(design, seed, count=41) -> Certificate:
    random = np.random.default_rng(seed)
    grid = np.linspace(-72, 72, count) * DEG
    masses = [random.exponential(size=count) * (random.random(count) < 0.3) for _ in range(4)]
    masses[3][np.abs(grid) > 40 * DEG] = 0.0
    return Certificate(
        design, grid, masses[0], masses[1] * 0.1, masses[2] * 0.1, masses[3] * 0.1, random.normal(size=3)
    )


@pytest.mark.parametrize("by_jerk", [True, False], ids=["jerk", "acceleration"])
@pytest.mark.parametrize("seed", range(3))
def test_lagrangian_identity(by_jerk, seed):
    """constant + integral p u = area + multipliers times slack, for a cam that need not respect any limit."""
    design = SKEW.model_copy(update={} if by_jerk else {"jerk_max_mm_per_deg3": None})
    c = random_certificate(design, seed)
    cam = free_cam(design, 3.0)
    lift = cam.lift(np.random.default_rng(seed + 10).normal(size=cam.Z.shape[1]) * 0.01)
    p = _switching_function(c, by_jerk)
    edges = np.union1d(p.x, cam.breaks)
    node, weight = np.polynomial.legendre.leggauss(6)  # exact: degree 3 + 2 on every piece
    theta = (0.5 * (edges[1:] + edges[:-1])[:, None] + 0.5 * np.diff(edges)[:, None] * node).ravel()
    w = (0.5 * np.diff(edges)[:, None] * weight).ravel()
    left = _constant(c, by_jerk) + np.sum(w * p(theta) * lift(theta, 3 if by_jerk else 2))
    right = lift.area + np.sum(c.lift_cap * (9.4 * MM - lift(c.grid)))
    if by_jerk:
        step = c.grid[1] - c.grid[0]
        for masses, level, sign, low, high in (
            (c.acceleration_max, 0.015, 1, -72, 72),
            (c.acceleration_min, 0.008, -1, -72, 72),
            (c.nose, 0.0, 1, -40, 40),
        ):
            ends = np.clip([c.grid - step / 2, c.grid + step / 2], low * DEG, high * DEG)
            mean = np.diff(lift(ends, 1), axis=0)[0] / np.where(ends[1] > ends[0], ends[1] - ends[0], 1.0)
            right += np.sum(masses * (level * MM_PER_DEG2 - sign * mean))
    assert left == pytest.approx(right, rel=1e-11)


@pytest.mark.parametrize("seed", range(4))
def test_weak_duality_on_random_cams_and_random_multipliers(seed):
    cam = free_cam(SKEW, 3.0)
    limits = cam.limits(SKEW)
    direction = np.random.default_rng(seed).normal(size=cam.Z.shape[1]) + 3 * cam.area()[0]
    z = maximise(direction, spline_rows(limits.matrix), limits.bound, first_working(limits)).z
    area_ratio = cam.lift(z).area_ratio(9.4 * MM)
    best = area_ratio_bound(SKEW, 144)
    random = np.random.default_rng(seed)
    spoiled = {
        name: getattr(best, name) * random.uniform(0.9, 1.1, len(best.grid))
        for name in ("lift_cap", "acceleration_max", "acceleration_min", "nose")
    }
    spoiled = replace(best, **spoiled, closing=best.closing * random.uniform(0.95, 1.05, 3))
    assert area_ratio < best.bound < spoiled.bound


def test_certificate_refuses_wrong_signs_and_foreign_multipliers():
    c = area_ratio_bound(KODAMA, 144)
    assert c.bound == c.evaluate()
    with pytest.raises(ValueError, match="lift_cap of a certificate must be >= 0"):
        replace(c, lift_cap=c.lift_cap - 1e-6).evaluate()
    with pytest.raises(ValueError, match="outside the nose"):
        replace(c, nose=c.nose + 1.0).evaluate()
    with pytest.raises(ValueError, match="limit that the design does not set"):
        replace(c, design=FREE_NOSE, nose=c.nose + 1.0).evaluate()


def test_a_finer_grid_changes_the_bound_little():
    coarse, fine = (area_ratio_bound(KODAMA, n).bound for n in (360, 1440))
    assert fine < coarse < fine + 1e-4  # second order in the interval


def test_with_the_lift_cap_alone_the_bound_is_one():
    alone = changed(jerk_max_mm_per_deg3=None, acceleration_min_mm_per_deg2=None)
    assert area_ratio_bound(alone).bound == 1.0


@pytest.mark.parametrize("name", ["jerk_max_mm_per_deg3", "acceleration_max_mm_per_deg2", "max_lift_mm"])
def test_worth_of_a_limit_is_the_change_of_area_for_one_per_cent(name):
    cam = free_cam(KODAMA, 3.0)
    found = kinematic_optimum(KODAMA, cam)
    step = 1e-4
    more = changed(**{name: getattr(KODAMA, name) * (1 + step)})
    gain = kinematic_optimum(more, cam).lift.area / found.lift.area - 1
    assert found.sensitivities[name] == pytest.approx(gain / step, rel=0.02)


def test_contradictory_limits_name_the_limits_and_the_values_that_resolve_them():
    design = changed(reach_max_lift=True, jerk_max_mm_per_deg3=0.0007)
    with pytest.raises(InputError) as error:
        kinematic_optimum(design, free_cam(design))
    message = str(error.value)
    assert "duration_deg = 144 with max_lift_mm = 9.4 to be reached" in message
    assert "jerk_max_mm_per_deg3 would have to rise from 0.0007 to 0.000798" in message
    assert "max_lift_mm would have to fall from 9.4 to 8.62" in message
    resolved = design.model_copy(update={"jerk_max_mm_per_deg3": 0.000798})
    assert kinematic_optimum(resolved, free_cam(resolved)).lift.max_lift / MM == pytest.approx(9.4, abs=1e-4)
    lower = design.model_copy(update={"max_lift_mm": 8.62})
    assert kinematic_optimum(lower, free_cam(lower)).lift.max_lift / MM == pytest.approx(8.62, abs=1e-4)


def test_a_cap_below_what_the_ramps_need_is_refused_by_program_and_bound():
    design = changed(max_lift_mm=0.27)
    for refuse in (lambda: kinematic_optimum(design, free_cam(design)), lambda: area_ratio_bound(design)):
        with pytest.raises(InputError, match=r"max_lift_mm would have to rise from 0\.27 to 0\.\d+"):
            refuse()


def of_duration(degrees):
    """The Polydyne of another duration."""
    return polydyne(SCENE.model_copy(update={"design": changed(duration_deg=degrees)}))


def test_a_cam_of_the_scene_needs_no_word():
    assert area_words(polydyne(SCENE), KODAMA) == []


@pytest.mark.parametrize("claim", [144.0, 200.0])
def test_a_longer_cam_exceeds_the_certified_bound_and_it_is_said(claim):
    """An event of 200 deg had 0.739 where the bound is 0.618, and was confirmed."""
    longer = replace(of_duration(200.0), half_duration=claim * DEG / 2)
    first, second = area_words(longer, KODAMA)
    assert "longer than the 144 deg of the scene" in first
    assert "exceeds the certified bound of 0.61" in second and "breaks duration_deg" in second


def test_a_ratio_above_one_is_said():
    raised = replace(of_duration(200.0), coefficients=2 * of_duration(200.0).coefficients)
    assert any("exceeds one: the lift exceeds max_lift_mm = 9.4" in said for said in area_words(raised, KODAMA))


def test_the_command_says_it(tmp_path, capsys):
    write_design(tmp_path / "short.json", of_duration(118.0), 9.4 * MM)
    assert main(["cam", "kodama", "--cam", str(tmp_path / "short.json")]) == 0
    out = capsys.readouterr().out
    assert "note: the cam's duration of 118 deg is shorter than the 144 deg of the scene" in out
    assert f"area ratio {of_duration(118.0).area_ratio_in(KODAMA):.6f}" in out
