"""Numbers of a scene that a design may choose: what a name means, the best values, and what is refused."""

import json
from contextlib import nullcontext as nothing
from dataclasses import replace

import numpy as np
import pytest

from camopt.cli.parser import main
from camopt.optimizer.accuracy import ACCURACIES
from camopt.optimizer.free_numbers import STEP, Programs, free_numbers, with_best_values, with_values
from camopt.scene import InputError, build_train, load_scene

KODAMA, MOTORI = load_scene("kodama"), load_scene("motori-1")
COARSE = replace(ACCURACIES["draft"], knot_deg=8.0, program_speeds=2)


def programs_of(scene, free):
    """The programs at the listed speeds with other values of the free numbers."""
    return Programs(lambda x: with_values(scene, free, x), "nominal", COARSE, 20.0)


def test_a_tolerance_names_numbers_that_move_in_proportion():
    (free,) = free_numbers(KODAMA, {"preload": (180.0, 230.0)})
    changed = with_values(KODAMA, [free], [216.7])
    assert free.of(KODAMA) == 197.0 and free.of(changed) == pytest.approx(216.7)
    preloads = {e.name: e.preload_N for e in changed.element if e.preload_N}
    assert set(preloads) == {"seat", *(f"coil_{i}" for i in range(1, 7))}
    assert preloads == pytest.approx(dict.fromkeys(preloads, 216.7))
    others = [(e.stiffness_N_per_m, e.gap_mm) for e in changed.element]
    assert others == [(e.stiffness_N_per_m, e.gap_mm) for e in KODAMA.element]


def test_a_number_of_an_element_and_a_ramp_are_changed_where_they_stand():
    asked = {"spring.preload_N": (200.0, 320.0), "design.ramp_height_mm": (0.2, 0.3)}
    free = free_numbers(MOTORI, asked)
    changed = with_values(MOTORI, free, [300.0, 0.25])
    spring = next(i for i, e in enumerate(MOTORI.element) if e.name == "spring")
    assert changed.element[spring].preload_N == 300.0 and changed.design.ramp_height_mm == 0.25
    assert build_train(changed).preload[spring] == pytest.approx(300.0)
    assert [one.named(MOTORI) for one in free] == list(asked)


def test_the_best_values_are_no_worse_than_those_of_a_grid():
    asked = {"spring.stiffness_N_per_m": (25_000.0, 60_000.0), "design.ramp_height_mm": (0.15, 0.3)}
    free, start = free_numbers(MOTORI, asked), (40_000.0, 0.265)
    ranges = list(asked.values())

    programs = programs_of(MOTORI, free)
    best = programs.largest(start, ranges)
    assert best.area_ratio == pytest.approx(programs.value(np.array(best.values)), abs=1e-9)
    assert best.at_start == programs.value(np.array(start))
    grid = [
        programs.value(np.array((rate, height)))
        for rate in np.linspace(*ranges[0], 3)
        for height in np.linspace(*ranges[1], 3)
    ]
    assert best.area_ratio >= max(grid) - 1e-4 and best.area_ratio > best.at_start
    assert best.evaluations <= 30


FREE = {
    "kodama": {"preload": (150.0, 260.0), "spring rate": (120e3, 180e3), "design.ramp_height_mm": (0.2, 0.35)},
    "motori-1": {"spring.preload_N": (200.0, 320.0), "design.ramp_velocity_mm_per_deg": (0.005, 0.03)},
}


@pytest.mark.parametrize("scene", [KODAMA, MOTORI], ids=lambda scene: scene.name)
def test_the_area_has_the_slope_of_its_differences(scene):
    free = free_numbers(scene, FREE[scene.name])
    programs = programs_of(scene, free)
    at, width = np.array([one.of(scene) for one in free]), np.ptp([(one.low, one.high) for one in free], axis=1)
    area, slopes = programs.value_and_slopes(at, STEP * width)
    assert area > 0.4 and np.all(slopes > 0.0)
    for k, step in enumerate(np.diag(1e-5 * width)):  # with kodama's spring rate another row binds 1e-4 away
        difference = (programs.value(at + step) - programs.value(at - step)) / (2 * step[k])
        assert slopes[k] == pytest.approx(difference, rel=3e-5)


def test_the_best_preload_lies_between_too_weak_and_too_strong():
    limited = MOTORI.design.model_copy(update={"contact_force_max_N": 900.0})
    scene, ends = MOTORI.model_copy(update={"design": limited}), (100.0, 600.0)
    programs = programs_of(scene, free_numbers(scene, {"spring.preload_N": ends}))
    weak, strong = (programs.largest((start,), (ends,)) for start in ends)
    assert min(weak.at_start, strong.at_start) < weak.area_ratio - 1e-3
    assert 110.0 < weak.values[0] < 590.0 and strong.area_ratio == pytest.approx(weak.area_ratio, abs=1e-5)


def test_what_was_chosen_is_told_beside_what_was_given():
    free = free_numbers(MOTORI, {"spring.preload_N": (200.0, 320.0)})
    scene, told = with_best_values(MOTORI, free, "nominal", COARSE)
    (one,) = told.values()
    assert one == {"of": "spring.preload_N", "value": pytest.approx(320.0, abs=0.5), "as_given": 250.0,
                   "low": 200.0, "high": 320.0}  # fmt: skip
    assert free[0].of(scene) == one["value"]


@pytest.mark.parametrize(
    "scene, asked, words",
    [
        (KODAMA, {"preloat": (1.0, 2.0)}, "'preloat'.*preload"),
        (KODAMA, {"preload": (230.0, 180.0)}, "LOW below HIGH"),
        (KODAMA, {"coil_1.stroke_mm": (1.0, 2.0)}, "no such number"),
        (MOTORI, {"spring.stiffness_N_per_m": (-5.0, 2e5)}, "lowest free numbers"),
        (MOTORI, {"design.ramp_height_mm": (0.2, 20.0)}, "highest free numbers"),
        (MOTORI, {"*.gap_mm": (0.0, 0.2)}, "lowest free numbers: tolerance.3: train.gap_mm"),
    ],
)
def test_what_is_no_free_number_is_refused_by_a_sentence(scene, asked, words):
    with pytest.raises(InputError, match=words):
        free_numbers(scene, asked)


def test_the_command_designs_with_the_numbers_that_it_chose(undrawn, tmp_path, capsys):
    words = ["optimize", "motori-1", "--accuracy", "draft", "--speeds", "nominal", "--no-compare", "--gradient", "none"]
    folder = tmp_path / "run"
    assert main([*words, "--free", "spring.preload_N=200:320", "--out", str(folder)]) == 0
    assert "the design chose 320, an end of this range; the scene had 250." in capsys.readouterr().out
    chosen = json.loads((folder / "design.json").read_text())["free"]["spring.preload_N"]
    spring = next(e for e in load_scene(str(folder / "scene.toml")).element if e.name == "spring")
    assert spring.preload_N == chosen["value"]
    assert main(["verify", str(folder / "scene.toml"), "--cam", str(folder), "--speeds", "5000"]) == 0


@pytest.mark.parametrize(
    "free, words",
    [("spring.preload_N", "expected NAME=LOW:HIGH"), ("spring.preload_N=1:x", "expected NAME=LOW:HIGH"),
     ("spring.preload_N=300:200", "LOW below HIGH"), ("sprung.preload_N=200:300", "no such number"),
     ("spring.preload_N=1:2 spring.preload_N=1:3", "is given twice")],
)  # fmt: skip
def test_the_command_refuses_before_it_begins(free, words, tmp_path, capsys):
    asked = [word for one in free.split() for word in ("--free", one)]
    with pytest.raises(SystemExit) if "expected" in words else nothing():
        assert main(["optimize", "motori-1", *asked, "--out", str(tmp_path / "run")]) == 2
    assert words in capsys.readouterr().err and not (tmp_path / "run").exists()
