"""Tolerances and grinding errors of a scene: what is refused, what a draw moves, and that draws are common."""

import numpy as np
import pytest

from camopt.scene import builtin_scenes, load_scene, parse_scene
from camopt.scene.as_built import REACH, deviates, moved_together, scene_as_built
from camopt.scene.element import Element
from camopt.scene.parameters import KEYS
from camopt.scene.schema import AS_BUILT
from camopt.scene.text_file import scene_toml
from camopt.storage import run_identity
from tests.scene.test_load import EXAMPLE, assert_one_fault, faults


def row(of: str, rest: str = "relative = 0.02") -> str:
    return f"\n[[tolerance]]\nof = {of}\n{rest}\n"


SPRING = '"spring.stiffness_N_per_m"'
GROUND = "\n[grinding]\nerror_um = 2.0\nharmonics = [2, 40]\n"
CONTRACT = row(SPRING, 'relative = 0.02\ndistribution = "normal"') + GROUND


def test_the_tables_of_the_contract_parse_and_come_back():
    scene = parse_scene(EXAMPLE + CONTRACT, "mine.toml")
    assert scene.tolerance[0].relative == 0.02 and scene.grinding.harmonics == (2, 40)
    assert parse_scene(scene_toml(scene), "again.toml") == scene


@pytest.mark.parametrize("name", builtin_scenes())
def test_built_in_scenes_have_assumed_tolerances(name):
    scene = load_scene(name)
    assert scene.tolerance and all(tolerance.assumed for tolerance in scene.tolerance)
    assert parse_scene(scene_toml(scene), name) == scene


@pytest.mark.parametrize(
    ("added", "key", "says"),
    [
        (row('"spring.stifness_N_per_m"'), "tolerance.1.of", "did you mean 'stiffness_N_per_m'"),
        (row('"sprong.stiffness_N_per_m"'), "tolerance.1.of", "no mass or element is named 'sprong'"),
        (row('"spring"'), "tolerance.1.of", "is not NAME.KEY"),
        (row('"spring.mass_kg"'), "tolerance.1.of", "the element 'spring' has no number 'mass_kg'"),
        (row('"*.exponent"'), "tolerance.1.of", "no mass or element '*' has a number 'exponent'"),
        (row("3"), "tolerance.1.of", "must be a text NAME.KEY"),
        (row("[]"), "tolerance.1.of", "must be a text NAME.KEY"),
        (row('"spring.gap_mm"'), "tolerance.1.of", "is 0, and a share of 0 is 0: give plus_minus"),
        (row('["train.gap_mm", "spring.preload_N"]', "plus_minus = 0.01"), "tolerance.1.of", "one unit"),
        (row(SPRING, "relative = 1.0"), "tolerance.1.relative", "must be below 1"),
        (row(SPRING, "relative = -0.1"), "tolerance.1.relative", "greater than 0"),
        (row(SPRING, ""), "tolerance.1.plus_minus", "give either relative or plus_minus"),
        (row(SPRING, "relative = 0.1\nplus_minus = 1.0"), "tolerance.1.plus_minus", "give either"),
        (row(SPRING, 'plus_minus = 1.0\ndistribution = "lognormal"'), "tolerance.1.distribution", "give relative"),
        (row(SPRING, 'relative = 0.1\ndistribution = "gauss"'), "tolerance.1.distribution", "'normal', 'lognormal'"),
        (row(SPRING, "plus_minus = 1.0\nrelativ = 0.1"), "tolerance.1.relativ", "unknown key"),
        (row(SPRING, 'relative = 0.1\nassumed = ["relativ"]'), "tolerance.1.assumed", "did you mean 'relative'"),
        (row('"valve.mass_kg"', "relative = 0.25"), "tolerance.1", "could be drawn as low as 0 "),
        (row('"valve.mass_kg"', "plus_minus = 0.1"), "tolerance.1", "= 0.24 could be drawn as low as -0.16"),
        (row('"train.gap_mm"', "plus_minus = 0.2"), "tolerance.1.plus_minus", "is more than train.gap_mm = 0.1 itself"),
        (row('"spring.gap_mm"', "plus_minus = 0.02"), "tolerance.1", "spring.gap_mm = 0 could be drawn"),
        (row(SPRING) + row(SPRING), "tolerance.2", "another name"),
        (row(SPRING, 'name = "grinding"\nrelative = 0.1'), "tolerance.1", "another name"),
        ("\n[grinding]\nerror_um = 0.0\n", "grinding.error_um", "greater than 0"),
        ("\n[grinding]\nerror_um = 2.0\nharmonics = [9, 3]\n", "grinding.harmonics", "[lowest, highest]"),
        ("\n[grinding]\nharmonics = [2, 40]\n", "grinding.error_um", "missing"),
    ],
)
def test_a_fault_is_one_sentence(added, key, says):
    fault = faults(EXAMPLE + added)[0]
    assert fault.startswith(f"{key}:") and says in fault


def test_widths_that_add_up_are_refused_together():
    wide = 'name = "{}"\nrelative = 0.2'
    parse_scene(EXAMPLE + row('"valve.mass_kg"', wide.format("a")), "mine.toml")
    plus = 'name = "b"\nplus_minus = 0.02'
    both = row('"valve.mass_kg"', wide.format("a")) + row('"valve.mass_kg"', plus)
    assert_one_fault(EXAMPLE + both, "tolerance.", "could be drawn as low as -0.032")


def test_one_draw_of_an_array_and_one_each_of_a_star():
    text = row('["spring.preload_N", "seat.preload_N"]', 'name = "together"\nrelative = 0.03')
    text += row('"*.damping_N_s_per_m"', 'name = "each"\nrelative = 0.2\ndistribution = "lognormal"')
    scene = parse_scene(EXAMPLE + text, "mine.toml")
    together, each = scene.tolerance
    assert [len(n) for n in moved_together(scene, together)] == [2]
    assert [number.named(scene) for (number,) in moved_together(scene, each)] == [
        "train.damping_N_s_per_m", "spring.damping_N_s_per_m", "seat.damping_N_s_per_m",
    ]  # fmt: skip
    draws = deviates(scene, 1, 0)
    built = scene_as_built(scene, draws)
    assert built.element[1].preload_N == built.element[2].preload_N == 250 * (1 + 0.03 * draws["together"][0])
    factors = [b.damping_N_s_per_m / e.damping_N_s_per_m for b, e in zip(built.element, scene.element, strict=True)]
    np.testing.assert_allclose(np.log(factors), 0.2 * draws["each"], atol=1e-12)
    assert built.mass == scene.mass and built.element[0].stiffness_N_per_m == 1.5e8


def test_draws_belong_to_the_train_and_to_the_name():
    scene = parse_scene(EXAMPLE + row(SPRING) + row('"valve.mass_kg"'), "mine.toml")
    other = parse_scene(EXAMPLE + row('"valve.mass_kg"', "relative = 0.01"), "mine.toml")
    assert deviates(scene, 5, 3)["valve.mass_kg"] == deviates(other, 5, 3)["valve.mass_kg"]
    drawn = [deviates(scene, seed, i) for seed in (5, 6) for i in (3, 4)]
    assert len({float(draw[0]) for draws in drawn for draw in draws.values()}) == 8


def test_draws_have_the_stated_spread():
    text = row('"valve.mass_kg"') + row('"train.gap_mm"', 'plus_minus = 0.02\ndistribution = "uniform"')
    scene = parse_scene(EXAMPLE + text, "mine.toml")
    draws = [deviates(scene, 0, i) for i in range(4000)]
    normal = np.array([d["valve.mass_kg"][0] for d in draws])
    width = np.array([d["train.gap_mm"][0] for d in draws])
    assert abs(normal.mean()) < 0.06 and normal.std() == pytest.approx(1.0, abs=0.04) and np.abs(normal).max() <= REACH
    assert np.abs(width).max() <= 1.0 and width.std() == pytest.approx(3**-0.5, abs=0.02)


def test_no_draw_of_a_built_in_scene_turns_a_number_negative():
    scene = load_scene("kodama")
    extreme = {label: -np.full(len(d), REACH) for label, d in deviates(scene, 0, 0).items()}
    built = scene_as_built(scene, extreme)
    assert all(m.mass_kg > 0 for m in built.mass)
    assert all(e.stiffness_N_per_m > 0 and e.damping_N_s_per_m >= 0 and e.gap_mm >= 0 for e in built.element)


def test_what_a_run_is_does_not_hang_on_the_tolerances():
    scene = parse_scene(EXAMPLE + CONTRACT, "mine.toml")
    assert run_identity("optimize", scene) == run_identity("optimize", parse_scene(EXAMPLE, "mine.toml"))
    assert not AS_BUILT & run_identity("optimize", scene)["scene"]["example"].keys()


def test_every_number_of_an_element_may_scatter_except_its_exponent_and_its_stroke():
    numbers = {name for name, field in Element.model_fields.items() if "float" in str(field.annotation)}
    tables = {name for name in numbers if name.endswith("_table")}
    assert numbers - tables - {"exponent", "stroke_mm"} == set(KEYS["element"])
