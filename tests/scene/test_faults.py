"""Faults of scene files: no kind hides another, each names what was probably meant, and no text breaks the reader."""

import re
import time

import pytest

from camopt.scene import InputError, builtin_scenes, parse_scene, scene_text
from tests.scene.test_load import AS_GIVEN, EXAMPLE, changed, faults


def keys(text: str, need: tuple[str, ...] = ()) -> set[str]:
    return {line.split(":")[0] for line in faults(text, need)}


class TestNothingHidesAnother:
    def test_schema_and_names(self):
        text = changed(
            EXAMPLE,
            ("duration_deg = 144", 'duration_deg = "long"'),
            ('between = ["valve", "ground"]', 'between = ["poppet", "ground"]'),
            ('name = "spring"', 'name = "train"'),
            ('valve = "valve" ', 'valve = "piston" '),
            ('seat = "seat"', 'seat = "cushion"'),
            ('assumed = ["mass_kg"]', 'assumed = ["mass_kilo"]'),
        )
        expected = {"design.duration_deg", "element.2.between", "element", "valve", "seat", "mass.1.assumed"}
        assert keys(text) == expected

    def test_a_row_is_named_and_counted(self):
        text = changed(EXAMPLE, "stiffness_N_per_m = 38200.0", "stiffness_N_per_m = 0.0")
        (fault,) = faults(text)
        assert fault.startswith("element.2.stiffness_N_per_m: ") and fault.endswith(" (element 'spring')")

    def test_schema_in_a_row_and_names_in_others(self):
        wrong = ("mass_kg = 0.24", "mass_kg = -1.0"), ('seat = "seat"', 'seat = "cushion"')
        text = changed(EXAMPLE, *wrong, ("stiffness_N_per_m = 38200.0", "stiffness = 38200.0"))
        assert keys(text) == {"mass.1.mass_kg", "element.2.stiffness_N_per_m", "element.2.stiffness", "seat"}

    def test_schema_and_a_train_that_nothing_holds_at_rest(self):
        """The paper's own placement: lash at the cam and no hold-down force leave the follower floating."""
        loose = changed(
            AS_GIVEN,
            ("force_N = -19.1\n", ""),
            (', "force_N"]', "]"),
            ("gap_mm = 0.169\n", ""),
            (', "gap_mm"]', "]"),
            ("cam_driven = true\n", "cam_driven = true\ngap_mm = 0.169\n"),
        )
        (alone,) = faults(loose)
        assert "follower" in alone and "force_N" in alone
        assert faults(changed(loose, "duration_deg = 144", "duration_deg = -1")) == [
            "design.duration_deg: must be greater than 0 (given: -1)",
            alone,
        ]
        held = changed(loose, "damping_N_s_per_m = 20.5\n", "damping_N_s_per_m = 20.5\nforce_N = -19.1\n")
        assert parse_scene(held, "held.toml").mass[1].force_N == -19.1

    def test_schema_and_a_mass_that_no_element_names(self):
        text = changed(EXAMPLE, "gap_mm = 0.1 ", "gap = 0.1 ") + '\n[[mass]]\nname = "loose"\nmass_kg = 0.1\n'
        assert keys(text) == {"element.1.gap", "mass.2"}

    def test_schema_and_parts_that_the_command_needs(self):
        found = keys(scene_text("ohv-3dof").replace("0.47", "-1"), ("valve", "design"))
        assert found == {"mass.1.mass_kg", "valve", "design"}

    def test_checks_of_a_whole_table_and_of_its_keys(self):
        text = changed(
            EXAMPLE,
            ("bounce_max_mm = 0.05", 'bounce_max_mm = "none"'),
            ("nose_deg = 40 ", "nose_deg = 80 "),
            ("ramp_height_mm = 0.265 ", "ramp_height_mm = 0.05 "),
            ("band_rpm = [5000, 7000]", "band_rpm = [7000, 5000]"),
            ("speeds_rpm = [5000, 6000,", "speeds_rpm = [6000, 5000,"),
            ('follower = "flat" ', 'follower = "roller" '),
            ("face_width_mm = 12", "face_width_mm = -12"),
        )
        assert keys(text) == {
            "design.bounce_max_mm",
            "design.nose_deg",
            "design",
            "operation.band_rpm",
            "operation.speeds_rpm",
            "geometry.roller_radius_mm",
            "geometry.face_width_mm",
        }

    def test_a_mass_without_a_usable_name_makes_no_false_dangling_ones(self):
        assert keys(changed(EXAMPLE, 'name = "valve"', 'nam = "valve"')) == {"mass.1.name", "mass.1.nam"}

    def test_many_faults_are_counted(self):
        rows = "".join(f'[[mass]]\nname = "m{i}"\nmass_kg = -1.0\n' for i in range(190))
        lines = faults(EXAMPLE + rows)
        assert len(lines) == 101
        assert lines[-1] == "and 280 more faults"


def test_plain_words_instead_of_the_schemas():
    text = changed(EXAMPLE, "speeds_rpm = [5000, 6000, 6500, 7000]", "speeds_rpm = 5000")
    text = "operation_ = 1\ngeometry = 3\n" + text[: text.index("[geometry]")] + text[text.index("[[mass]]") :]
    text = changed(text, "speeds_rpm = 5000", "speeds_rpm = []")
    assert not re.search("[Tt]uple|dictionary|Input should|validation", "\n".join(faults(text)))


@pytest.mark.parametrize("name", [name for name in builtin_scenes() if "cam_driven" in scene_text(name)])
def test_a_contact_between_cam_and_valve_the_wrong_way_round_is_refused(name):
    """Without that it was no fault of the scene, and `bound` ended as a defect of its linear program."""
    parts = scene_text(name).partition("\n# Trains as built")[0].split("[[element]]")
    reversed_contacts = 0
    for i, part in enumerate(parts):
        if i == 0 or "contact" not in part or not re.search("cam_driven|rocker_valve|follower_valve|pushrod", part):
            continue
        turned = re.sub(r'between = \["(\w+)", "(\w+)"\]', r'between = ["\2", "\1"]', part)
        with pytest.raises(InputError, match="every contact on it must push that way"):
            parse_scene("[[element]]".join([*parts[:i], turned, *parts[i + 1 :]]), name)
        reversed_contacts += 1
    assert reversed_contacts >= 1


TEXTS = {
    "integer beyond floats": ("duration_deg = 144", f"duration_deg = 1{'0' * 400}"),
    "integer of 5,000 digits": ("duration_deg = 144", f"duration_deg = 1{'0' * 5000}"),
    "number that is nearly nothing": ("mass_kg = 0.24", "mass_kg = 5e-324"),
    "limit that is nearly nothing": ("jerk_max_mm_per_deg3 = 0.003", "jerk_max_mm_per_deg3 = 1e-100"),
    "speed beyond every engine": ("speeds_rpm = [5000,", "speeds_rpm = [1e300,"),
    "arrays within arrays": ("format = 1", f"x = {'[' * 100_000}"),
    "closed arrays within arrays": ("format = 1", f"x = {'[' * 400}{']' * 400}"),
    "tables within tables": ("format = 1", f"x = {'{a = ' * 400}1{'}' * 400}"),
    "key of 100,000 parts": ("format = 1", f"x{'.a' * 100_000} = 1"),
    "quoted key of 100,000 parts": ("format = 1", '"a".' * 100_000 + "b = 1"),
    "heading of 100,000 parts": ("format = 1", f"[x{'.a' * 100_000}]"),
    "key in a table in a line": ("format = 1", f"x = {{b{'.a' * 100_000} = 1}}"),
    "quotes without end": ("format = 1", 'x = """' + '\\"""' * 100_000),
    "long key": ("format = 1", f"{'k' * 100_000} = 1"),
    "long value": ('follower = "flat" ', f'follower = "{"f" * 100_000}" '),
    "100,000 masses": ("[[mass]]", "[[mass]]\n" * 100_000 + "[[mass]]"),
}


class TestHostileText:
    """What an attacker or a slip can write: a sentence, soon, and without the memory of the machine."""

    @pytest.mark.parametrize("case", TEXTS)
    def test_ends_in_a_sentence(self, case):
        begin = time.process_time()
        lines = faults(changed(EXAMPLE, *TEXTS[case]))
        assert time.process_time() - begin < 10  # seconds, a busy machine's; without its limit a dotted key takes 40 GB
        assert all(len(line) < 500 for line in lines)
        assert not any("Traceback" in line for line in lines)

    def test_dots_in_texts_and_comments_are_no_keys(self):
        text = changed(EXAMPLE, 'title = "one mass on its seat"', f'title = "see{" a.b.c." * 50}" # and{".x" * 50}')
        assert parse_scene(text, "mine.toml").title.startswith("see a.b.c.")
