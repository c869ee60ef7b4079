"""The random and changed scenes, trains and cams of the experiments: their ranges, and reproducibility."""

from contextlib import suppress

import numpy as np
import pytest
import tomli_w

import camopt
from camopt.cam.read import read_cam
from camopt.exact import settled_metrics
from camopt.measure.as_built import trains_as_built
from camopt.measure.sweep import at_speeds
from camopt.scene import InputError, build_train, load_scene, parse_scene, rest_position
from camopt.scene.as_built import scatter_labels, with_scatter
from camopt.study.extremes.classification import REFUSED, WITHIN
from camopt.study.modes import modes
from camopt.verifier.convergence import first_steps
from experiments import architectures, cost_scaling, linear_programs, outside_judges
from experiments.never_nothing import drawn_design, scaled
from experiments.random_scenes import LARGEST, REAL, REAL_BASES, SPEED_RPM, chain, drawn, judged
from experiments.support.near_limit_scenes import KINDS, drawn_scene
from experiments.support.outside_changes import CHANGES


def test_draws_are_ordinary_trains_of_two_to_fourteen_masses_and_repeat():
    scenes = [architectures.drawn(i) for i in range(40)]
    assert architectures.drawn(3) == scenes[3]
    assert {s.name.rsplit("-", 1)[0] for s in scenes} == set(architectures.ARCHITECTURES)
    counts = {len(s.mass) for s in scenes}
    assert min(counts) == 2 and max(counts) == 14 and len(counts) > 8
    rods = [e for s in scenes if s.name.startswith("pushrod-elastic") for e in s.element if e.name == "rod_foot_rocker"]
    assert len(rods) == 10 and {e.kind for e in rods} == {"spring"}
    assert 0 < sum(s.design.closing_ramp_velocity_mm_per_deg is not None for s in scenes) < 30


def test_the_draw_of_programs_covers_what_it_says():
    designs = []
    for number in range(60):
        with suppress(InputError):
            designs.append(linear_programs.drawn(number).design)
    lifts = [design.max_lift_mm for design in designs]
    assert min(lifts) < 3 and max(lifts) > 40 and linear_programs.drawn(3) == linear_programs.drawn(3)
    assert 0 < sum(design.reach_max_lift for design in designs) < len(designs)
    assert any(design.lift_at for design in designs) and any(design.duration_at for design in designs)
    assert {posed.kind for posed in linear_programs.programs(2)} == set(linear_programs.KINDS)


def test_ten_scenes_of_the_kinds_that_were_asked_for():
    scenes = [drawn_scene(number) for number in range(10)]
    assert len({scene.name for scene in scenes}) == len(KINDS) == 10
    assert scenes[3] == drawn_scene(3)
    for scene, kind in zip(scenes, KINDS, strict=True):
        low, high = scene.operation.band_rpm
        assert 200 <= high - low + 1 and high - low <= 300
        assert (scene.design.closing_ramp_height_mm is not None) == kind.get("ramps", False)


@pytest.mark.parametrize("name", ["finger-hydraulic", "race-nested", "exhaust-gas"])
def test_a_scaled_train_moves_as_before_in_its_own_scale(name):
    """Scaling masses, lengths and speeds together changes only the scale of a motion."""
    before, data = load_scene(name), load_scene(name).model_dump(exclude_none=True, mode="json")
    for key in ("tolerance", "grinding", "geometry"):
        data.pop(key, None)
    after = scaled(data, np.random.default_rng(3))
    length = after["design"]["max_lift_mm"] / before.design.max_lift_mm
    grown = parse_scene(tomli_w.dumps(after), name, ("design",))
    assert abs(np.log(length)) > 0.5 and grown.operation.speeds_rpm != before.operation.speeds_rpm
    figures = []
    for scene in (before, grown):
        cam = read_cam("multi-pol", scene)
        assert cam.area_ratio_in(scene.design) == pytest.approx(0.6, abs=0.1)
        polydyne, speeds = read_cam("polydyne", scene), scene.operation.speeds_rpm[:1]
        figures += at_speeds(settled_metrics, scene, polydyne, speeds)
    speed = grown.operation.speeds_rpm[0] / before.operation.speeds_rpm[0]
    for key, factor in (("jump_mm", length), ("bounce_mm", length), ("seating_velocity_m_per_s", length * speed)):
        assert figures[1][key] == pytest.approx(factor * figures[0][key], rel=1e-3, abs=1e-4 * factor)


def test_the_drawn_scenes_are_of_every_kind_and_repeat():
    scenes = [drawn_design(number) for number in range(40)]
    assert drawn_design(7) == scenes[7]
    lifts = [scene.design.max_lift_mm for scene in scenes]
    assert min(lifts) < 2 and max(lifts) > 40 and max(max(s.operation.band_rpm) for s in scenes) > 10_000
    assert any(s.design.closing_ramp_height_mm for s in scenes) and any(s.operation.cam_per_crank == 1 for s in scenes)
    forms = {e.form for scene in scenes for e in scene.element}
    assert forms == {"linear", "hertz", "progressive", "table", "adjuster", "friction"}
    assert any(scene.force for scene in scenes)


def test_draws_load_reach_far_and_repeat():
    scenes = [drawn(np.random.default_rng([7, i])) for i in range(60)]
    again = drawn(np.random.default_rng([7, 3]))
    assert again[0] == scenes[3][0] and again[1] == scenes[3][1]
    assert all(SPEED_RPM[0] <= speed <= SPEED_RPM[1] for _, speed in scenes)
    assert all(first_steps(build_train(s), s.cam_speed(speed)) <= LARGEST for s, speed in scenes)
    rng = np.random.default_rng(0)
    assert {len(chain(rng)["mass"]) for _ in range(40)} == {1, 2, 3, 4, 5, 6}
    assert len({s.name for s, _ in scenes if s.name.endswith("-moved")}) == 4
    stiffness = [e.stiffness_N_per_m for s, _ in scenes for e in s.element]
    assert max(stiffness) > 1e9 and any(e.damping_N_s_per_m == 0 for s, _ in scenes for e in s.element)
    ratios = [max(m.mass_kg for m in s.mass) / min(m.mass_kg for m in s.mass) for s, _ in scenes]
    assert max(ratios) > 1e2


def test_draws_of_real_trains_move_every_kind_of_number():
    scenes = [drawn(np.random.default_rng([7, i]), real=True)[0] for i in range(30)]
    assert {scene.name.removesuffix("-moved") for scene in scenes} == set(REAL_BASES)
    of = {key: {getattr(e, key) for s in scenes for e in s.element} - {None} for key in ("leak_N_s_per_m", "slip_N")}
    assert all(len(values) > 4 for values in of.values())
    assert len({s.force[0].table for s in scenes if s.force}) > 2
    assert len({e.force_table for s in scenes for e in s.element if e.force_table}) > 2


def test_nothing_of_real_trains_is_wrong_without_a_warning():
    assert [judged(REAL + i, cams=1)["verdict"] for i in (9, 10, 13)] == [WITHIN, WITHIN, REFUSED]


def test_every_change_changes_what_the_judge_is_given():
    scene = load_scene(outside_judges.CHANGED)
    lift = camopt.polydyne(scene)
    assert len(CHANGES) == 10
    for change in CHANGES:
        moved = np.abs(change.cam(lift).coefficients - lift.coefficients).max() > 0
        assert moved + (change.scene(scene) != scene) + (change.law != CHANGES[0].law) == 1, change.name


@pytest.mark.parametrize("width", [0.5, 2.0])
def test_twice_the_tolerance_scatters_twice_as_far(width):
    scene = load_scene("motori-1")
    wider_scene = with_scatter(scene, dict.fromkeys(scatter_labels(scene), width))
    plain, wider = (trains_as_built(made, 30, seed=3) for made in (scene, wider_scene))
    masses = [[one.train.mass[0] for one in trains] for trains in (plain, wider)]
    assert np.std(masses[1]) / np.std(masses[0]) == pytest.approx(width, rel=1e-6)


def test_a_finer_spring_is_the_same_spring():
    """Mass, rate and state of rest are unchanged; the first surge is that of twenty masses between fixed ends."""
    scene = load_scene("kodama")
    finer = cost_scaling.with_coils(scene, 20)
    assert len(finer.mass) == 25
    assert sum(m.mass_kg for m in finer.mass) == pytest.approx(sum(m.mass_kg for m in scene.mass))
    assert rest_position(build_train(finer))[2] == pytest.approx(rest_position(build_train(scene))[2], rel=1e-9)
    rate, mass = 152000.0 / 6, 5 * 0.00833
    chain = np.sqrt(rate * 21 / (mass / 20)) * np.sin(np.pi / 42) / np.pi  # both ends held
    assert modes(finer).frequency_Hz[0] == pytest.approx(chain, rel=1e-3)  # the train at its end is not quite fixed
