"""Reading scenes: the contract's example, and every input fault with file and key; all at once: test_faults.py."""

from pathlib import Path

import pytest

from camopt.scene import InputError, builtin_scenes, load_scene, parse_scene, scene_text
from camopt.scene.schema import SIMULATED

EXAMPLE = (Path(__file__).parent / "example.toml").read_text()
KODAMA = scene_text("kodama")
AS_GIVEN = KODAMA.partition("\n# Trains as built")[0]
"""The scene without its tolerances, which a lash that moves would leave without a number."""


def changed(text: str, *changes: tuple[str, str] | str) -> str:
    """The text with the first place of each old piece, in pairs with the new one, changed."""
    pairs = [changes] if isinstance(changes[0], str) else changes
    for old, new in pairs:
        assert old in text, f"{old!r} is not in the scene"
        text = text.replace(old, new, 1)
    return text


def faults(text: str, need: tuple[str, ...] = ()) -> list[str]:
    with pytest.raises(InputError) as error:
        parse_scene(text, "mine.toml", need)
    lines = str(error.value).splitlines()
    assert all(line.startswith("mine.toml: ") for line in lines)
    return [line.removeprefix("mine.toml: ") for line in lines]


def assert_one_fault(text: str, key: str, says: str) -> None:
    (line,) = faults(text)
    assert line.startswith(key) and says in line, line


def test_example_of_the_contract_parses():
    scene = parse_scene(EXAMPLE, "example.toml", (*SIMULATED, "geometry"))
    assert (scene.name, scene.valve, scene.seat) == ("example", "valve", "seat")
    assert scene.operation.speeds_rpm == (5000, 6000, 6500, 7000)
    assert scene.operation.band_rpm == (5000, 7000)
    assert (scene.design.nose_deg, scene.design.contact_force_max_N, scene.design.reach_max_lift) == (40, 5000, False)
    assert (scene.geometry.follower, scene.geometry.base_radius_mm) == ("flat", 16)
    assert scene.mass[0].assumed == ("mass_kg",)
    assert [e.name for e in scene.element] == ["train", "spring", "seat"]
    assert (scene.element[0].gap_mm, scene.element[0].cam_driven, scene.element[1].preload_N) == (0.1, True, 250)


def test_left_out_keys_take_the_defaults_of_the_contract():
    left_out = ("damping_N_s_per_m = 0.0           #", "#"), ("force_N = 0.0                     #", "#")
    scene = parse_scene(changed(EXAMPLE, *left_out), "mine.toml")
    assert (scene.mass[0].damping_N_s_per_m, scene.mass[0].force_N) == (0.0, 0.0)
    assert (scene.element[2].gap_mm, scene.element[2].cam_driven) == (0.0, False)


@pytest.mark.parametrize("name", builtin_scenes())
def test_built_in_scenes_load(name):
    scene = load_scene(name, need=() if name == "ohv-3dof" else SIMULATED)
    assert scene.name == name
    assert scene.title


def test_a_part_that_a_scene_lacks_is_a_sentence_where_it_is_needed():
    scene, bare = load_scene("kodama"), load_scene("ohv-3dof")
    assert scene.required_design is scene.design and scene.required_operation is scene.operation
    assert scene.required_geometry is scene.geometry
    with pytest.raises(InputError, match=r"^scene 'ohv-3dof': this needs its \[operation\], which is missing$"):
        bare.cam_speed(1000)


@pytest.mark.parametrize(
    ("old", "new", "key", "says"),
    [
        ("mass_kg = 0.24", "mass_kg = -0.24", "mass.1.mass_kg", "greater than 0"),
        ("mass_kg = 0.24", "mass_kg = nan", "mass.1.mass_kg", "finite"),
        ("mass_kg = 0.24", "mass_kg = inf", "mass.1.mass_kg", "finite"),
        ("mass_kg = 0.24", 'mass_kg = "0.24"', "mass.1.mass_kg", "number"),
        ("assumed = [\"mass_kg\"]", "asumed = []", "mass.1.asumed", "unknown key; did you mean 'assumed'?"),
        ("format = 1", "format = 1\nmass_kg = 1", "mass_kg", "it belongs in [[mass]]"),
        ("stiffness_N_per_m = 38200.0", "", "element.2.stiffness_N_per_m", "missing"),
        ("stiffness_N_per_m = 38200.0", "stiffness_N_per_m = 0.0", "element.2.stiffness_N_per_m", "greater than 0"),
        ("damping_N_s_per_m = 4000.0", "damping_N_s_per_m = -1.0", "element.3.damping_N_s_per_m", "equal to 0"),
        ("gap_mm = 0.1 ", "gap_mm = -0.1 ", "element.1.gap_mm", "equal to 0"),
        ('kind = "contact"                  #', 'kind = "contct" #', "element.1.kind",
         "'adjuster' or 'friction' (given: 'contct'); did you mean 'contact'?"),
        ("cam_driven = true ", 'cam_driven = "yes" ', "element.1.cam_driven", "boolean"),
        ("format = 1", "format = 2", "format", "1"),
        ("[operation]", "[operations]", "operations", "unknown key; did you mean 'operation'?"),
        ("band_rpm = [5000, 7000]", "band_rpm = [5000, 7000]\nnose_deg = 40", "operation.nose_deg", "in [design]"),
        ("cam_per_crank = 0.5", "cam_per_crank = 0", "operation.cam_per_crank", "greater than 0"),
        ("band_rpm = [5000, 7000]", "band_rpm = [7000, 5000]", "operation", "lower < upper"),
        ("speeds_rpm = [5000, 6000,", "speeds_rpm = [6000, 5000,", "operation", "ascending"),
        ("speeds_rpm = [5000, 6000, 6500, 7000]", "speeds_rpm = []", "operation.speeds_rpm", "at least 1"),
        ("duration_deg = 144", "duration_deg = 320", "design.duration_deg", "less than 300"),
        ("nose_deg = 40 ", "nose_deg = 80 ", "design", "half of duration_deg"),
        ("ramp_height_mm = 0.265 ", "ramp_height_mm = 0.05 ", "design", "too low for its foot"),
        ("acceleration_min_mm_per_deg2 = -0.008", "acceleration_min_mm_per_deg2 = 0.008", "design.acceleration_min",
         "less than 0"),
        ("ramp_foot_deg = 10", "ramp_foot_deg = 1e-300", "design.ramp_foot_deg", "smaller than any quantity"),
        ('follower = "flat" ', 'follower = "roller" ', "geometry", "roller_radius_mm"),
        ('between = ["valve", "ground"]', 'between = ["vavle", "ground"]', "element.2.between",
         "'vavle'; did you mean 'valve'?"),
        ('between = ["valve", "ground"]', 'between = ["valve", "valve"]', "element.2.between", "both ends"),
        ('name = "spring"', 'name = "train"', "element", "'train' is used more than once"),
        ('name = "spring"', 'name = "two words"', "element.2.name", "pattern"),
        ('valve = "valve" ', 'valve = "Valve" ', "valve", "'Valve'; did you mean 'valve'?"),
        ('seat = "seat"', 'seat = "seet"', "seat", "'seet'; did you mean 'seat'?"),
        ('seat = "seat"', "", "valve and seat", "both or neither"),
        ('assumed = ["mass_kg"]', 'assumed = ["mass_kgs"]', "mass.1.assumed", "did you mean 'mass_kg'?"),
        ('seat = "seat"', 'seat = "spring"', "seat", "pushes the valve open"),
        ("cam_driven = true ", "cam_driven = false ", "element", "exactly one"),
    ],
)  # fmt: skip
def test_one_fault_is_one_sentence_with_its_key(old, new, key, says):
    assert_one_fault(changed(EXAMPLE, old, new), key, says)


def test_seat_that_pulls_the_valve_shut_is_refused():
    start = EXAMPLE.index('name = "seat"')
    text = EXAMPLE[:start] + changed(EXAMPLE[start:], '["ground", "valve"]', '["valve", "ground"]')
    assert_one_fault(text, "seat: ", "element 'seat' must be a contact between")


def test_duplicate_masses_and_a_mass_named_ground():
    text = changed(KODAMA, 'name = "spring_2"', 'name = "spring_1"')
    assert any("the name 'spring_1' is used more than once" in line for line in faults(text))
    assert any("'ground' is the name of the ground" in f for f in faults(changed(KODAMA, '"camshaft"', '"ground"')))


@pytest.mark.parametrize("text", ["format = ", "format = 1\nformat = 1", "mass = [", "\x00"])
def test_malformed_toml(text):
    assert_one_fault(text, "", "not valid TOML")


def test_missing_parts_are_named_by_the_command_that_needs_them():
    assert faults(scene_text("ohv-3dof"), ("valve", "design")) == [
        "valve: missing; this command needs it",
        "design: missing; this command needs it",
    ]


def test_empty_file_names_what_is_missing():
    assert {line.split(":")[0] for line in faults("")} == {"format", "name", "mass", "element"}


def test_missing_unreadable_and_huge_files(tmp_path):
    for name, content in (("scene", KODAMA.encode()), ("binary", b"\xff\xfe\x00"), ("huge", b"#" * 1_000_001)):
        (tmp_path / f"{name}.toml").write_bytes(content)
    for path in (tmp_path, tmp_path / "scene.toml"):  # a run folder stands for its scene
        assert load_scene(path) == load_scene("kodama")
    (tmp_path / "empty").mkdir()
    for source, says in (
        (tmp_path / "none.toml", "there is no such file"),
        (tmp_path / "empty", "there is no such file"),
        ("kodam", "neither a built-in scene"),
        (tmp_path / "binary.toml", "UTF-8"),
        (tmp_path / "huge.toml", "larger than"),
    ):
        with pytest.raises(InputError, match=says):
            load_scene(source)


def test_a_missing_kind_hides_no_missing_stiffness():
    text = scene_text("motori-1") + '\n[[element]]\nname = "more"\nbetween = ["valve", "ground"]\n'
    assert [line.split(":")[0] for line in faults(text)] == ["element.5.kind", "element.5.stiffness_N_per_m"]
