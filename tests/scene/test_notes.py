"""Notes on what runs but is unusual: what, where, the usual range, the unit that was probably meant."""

import pytest

from camopt.scene import builtin_scenes, parse_scene
from camopt.scene.faults import tables
from camopt.scene.notes import USUAL, scene_notes, speed_notes
from tests.scene.test_load import EXAMPLE, changed


@pytest.mark.parametrize("text", [EXAMPLE, *builtin_scenes().values()], ids=["example", *builtin_scenes()])
def test_built_in_scenes_and_the_example_of_the_contract_are_usual(text):
    assert scene_notes(parse_scene(text, "mine.toml")) == ()


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("mass_kg = 0.24", "mass_kg = 125", ["mass.mass_kg: 125 of 'valve'", "0.0001 to 3", "in g", "0.125"]),
        ("= 38200.0", "= 28", ["element.stiffness_N_per_m: 28 of 'spring'", "in N/mm", "28000"]),
        ("= 1.5e8", "= 1.5e5", ["element.stiffness_N_per_m: 150000 of 'train'", "in N/mm", "1.5e+08"]),
        ("= 1.8e8", "= 180", ["180 of 'seat'", "in kN/mm", "1.8e+08"]),
        ("gap_mm = 0.1 ", "gap_mm = 0.3 ", ["lash of 0.3 mm", "opening ramp's 0.265 mm", "raise the ramp"]),
        ("gap_mm = 0.1 ", "gap_mm = 0.0001 ", ["element.gap_mm: 0.0001 of 'train'", "in m,", "0.1 here"]),
        ("6500, 7000]", "6500, 60000]", ["operation.speeds_rpm: 60000", "100 to 20000"]),
        ("[5000, 7000]", "[50, 117]", ["operation.band_rpm: 50", "in 1/s, which would be 3000"]),
        ("duration_deg = 144", "duration_deg = 260", ["design.duration_deg: 260", "in crank degrees", "130"]),
        ("max_lift_mm = 9.4", "max_lift_mm = 0.37", ["design.max_lift_mm: 0.37", "in inch", "9.398"]),
        ("per_deg2 = 0.015", "per_deg2 = 50", ["acceleration_max_mm_per_deg2: 50", "in mm/rad^2", "0.0152309"]),
        ("min_mm_per_deg2 = -0.008", "min_mm_per_deg2 = -23", ["-23 is", "in mm/rad^2, which would be -0.00700"]),
        ("m_per_s = 0.5", "m_per_s = 500", ["seating_velocity_max_m_per_s: 500", "in mm/s", "0.5 here"]),
        ("base_radius_mm = 16", "base_radius_mm = 0.016", ["geometry.base_radius_mm: 0.016", "in m,", "16 here"]),
    ],
)  # fmt: skip
def test_unusual_numbers_are_noted_with_the_unit_that_was_probably_meant(old, new, says):
    (note,) = scene_notes(parse_scene(changed(EXAMPLE, old, new), "mine.toml"))
    assert all(words in note for words in [*says, "if this is intended, ignore the note"])


@pytest.mark.parametrize(
    ("preload", "says"),
    [
        ("0.0", "at rest the valve is pressed on its seat with only 0.0"),
        ("0.25", "0.25 of 'spring' looks like kN, which would be 250 here"),
        ("150.0", "its seat with 150 N, and the preload of the seat 'seat' is 250 N: both should be the same"),
        ("240.0", None),
    ],
)
def test_a_valve_that_its_spring_does_not_close_as_its_seat_says_is_noted(preload, says):
    start = EXAMPLE.index('name = "spring"')
    text = EXAMPLE[:start] + changed(EXAMPLE[start:], "preload_N = 250.0", f"preload_N = {preload}")
    notes = scene_notes(parse_scene(text, "mine.toml"))
    assert notes == () if says is None else says in " ".join(notes)


def test_stiffness_of_every_law_is_read():
    hertz = changed(EXAMPLE, 'kind = "contact"                  #', 'kind = "contact"\nlaw = "hertz" #')
    (note,) = scene_notes(parse_scene(hertz, "mine.toml"))  # 1.5 * 1.5e8 * sqrt(1e-5) = 712 kN/m at 10 um
    assert "711512 of 'train'" in note
    table = 'law = "progressive"\nstiffness_table = [[0, 30], [10, 40000]]'
    start = EXAMPLE.index('name = "spring"')
    bent = EXAMPLE[:start] + changed(EXAMPLE[start:], "stiffness_N_per_m = 38200.0", table)
    (note,) = scene_notes(parse_scene(bent, "mine.toml"))
    assert "30 of 'spring'" in note


def test_one_note_for_many_rows_names_the_worst():
    more = '\n[[mass]]\nname = "tip"\nmass_kg = 240\n\n[[element]]\nname = "stem"\nkind = "spring"\n'
    more += 'between = ["valve", "tip"]\nstiffness_N_per_m = 1e8\n'
    (note,) = scene_notes(parse_scene(changed(EXAMPLE, "mass_kg = 0.24", "mass_kg = 24") + more, "mine.toml"))
    assert note.startswith("mass.mass_kg: 240 of 'tip', and 1 more, is outside")


def test_speeds_from_the_command_line():
    assert speed_notes("--speed", [6000.0]) == []
    (note,) = speed_notes("--speed", [600_000.0])
    assert note.startswith("--speed: 600000 is outside the usual 100 to 20000")


def test_every_entry_names_a_key_and_a_range():
    for path, usual in USUAL.items():
        table, key = path.split(".")
        assert key in tables()[table].model_fields, path
        assert usual.low < usual.high and usual.reason, path
        for unit, factor in usual.slips.items():
            assert factor not in (0, 1), f"{path}: {unit} is the key's own unit"


def test_every_number_of_a_scene_has_its_usual_range():
    """A key without an entry is left out on purpose, with the reason here."""
    without = {
        "element.exponent": "the schema itself holds it between 1 and 3",
        "design.ramp_foot_deg": "any foot that fits the ramp is usual; the schema holds it to that",
        "design.nose_deg": "the schema holds it below half the duration",
        "geometry.valve_arm_deg": "the schema holds it between -80 and 80",
        "design.lift_at": "its rows mix angles and lifts; the schema holds both to the event",
        "design.duration_at": "its rows mix lifts and angles; the schema holds both to the event",
        "geometry.cam_poisson_ratio": "the schema holds it between 0 and 0.5",
        "geometry.follower_poisson_ratio": "the schema holds it between 0 and 0.5",
        "tolerance.relative": "the schema holds it below 1",
        "tolerance.plus_minus": "it is held against the number that it is of",
    }
    numbers = {
        f"{table}.{key}"
        for table, model in tables().items()
        for key, field in model.model_fields.items()
        if "float" in str(field.annotation) and (not key.endswith("table") or key == "force_table")
    }
    assert numbers - without.keys() == USUAL.keys()
