"""A duration that a scene leaves to its duration_at: the shortest one with a cam, and what is chosen of it."""

import pytest

import camopt
from camopt.cam.families.free import free_cam
from camopt.highs import Infeasible
from camopt.optimizer.program.chosen_duration import ROOM, chosen_duration_deg
from camopt.optimizer.program.kinematic import (
    DURATION_STEP_DEG,
    TRIED_KNOT_DEG,
    kinematic_optimum,
    shortest_duration_deg,
)
from camopt.optimizer.program.program_cam import program_cam
from camopt.scene import InputError, load_scene, parse_scene, scene_text
from camopt.scene.notes import scene_notes
from camopt.scene.units import MM
from camopt.tasks.task import scene_of_text

TEXT = scene_text("motori-1")
GIVEN = "duration_deg = 144"
assert GIVEN in TEXT
ROWS = "duration_at = [[1.0, 118.0, 121.0]]"


def left_open(rows: str = ROWS, text: str = TEXT) -> str:
    return text.replace(GIVEN, f'duration_deg = "from duration_at"\n{rows}')


def test_a_tenth_of_a_degree_less_has_no_cam():
    design = parse_scene(left_open(), "left open", (), chosen_duration_deg).design
    shortest = shortest_duration_deg(design)
    assert shortest > 118.0
    for less, has_one in ((0.0, True), (DURATION_STEP_DEG, False)):
        tried = design.model_copy(update={"duration_deg": shortest - less})
        try:
            kinematic_optimum(tried, free_cam(tried, TRIED_KNOT_DEG), explain=False)
            assert has_one
        except Infeasible:
            assert not has_one


def test_the_chosen_duration_is_said_and_its_cam_is_open_so_long():
    scene = parse_scene(left_open(), "left open", (), chosen_duration_deg)
    design = scene.design
    assert design.duration_deg == pytest.approx((1 + ROOM) * shortest_duration_deg(design), abs=DURATION_STEP_DEG)
    said = scene_notes(scene)[0]
    assert f"{design.duration_deg:g} cam deg" in said and "open for 118 deg at 1 mm" in said
    found = kinematic_optimum(design, program_cam(design, 3.0)).lift
    first, last = found.roots(0, 1.0 * MM)
    assert 118.0 - 1e-6 <= (last - first) * 57.29577951308232 <= 121.0 + 2e-3


def test_a_duration_that_is_given_is_not_called_chosen():
    assert not load_scene("motori-1").design.duration_chosen


@pytest.mark.parametrize(
    ("rows", "says"),
    [
        ("", r"left open: design\.duration_deg: \"from duration_at\" needs duration_at with a least duration"),
        ("duration_at = [[1.0, 0.0, 121.0]]", "needs duration_at with a least duration"),
        ("duration_at = [[5.0, 285.0, 289.0]]", "no duration has a cam that is open so long"),
        ("duration_at = [[0.1, 118.0, 121.0]]", "its lift of 0.1 mm must be above both ramps"),
        ('duration_at = "long"', "must be an array"),
    ],
)
def test_a_scene_that_leaves_its_duration_open_in_vain_is_refused(rows, says):
    with pytest.raises(InputError, match=says) as error:
        parse_scene(left_open(rows), "left open", (), chosen_duration_deg)
    assert len(str(error.value).splitlines()) == 1


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (left_open(), r"left open: design\.duration_deg: .*needs the command line or camopt"),
        (TEXT.replace(GIVEN, 'duration_deg = "from the card"'), r"\.duration_deg: .*number \(given: 'from the card'\)"),
    ],
)
def test_what_reads_no_open_duration_says_where_it_is_read_and_what_a_duration_is(text, says):
    with pytest.raises(InputError, match=says):
        parse_scene(text, "left open")


def test_a_file_that_leaves_its_duration_open_is_read(tmp_path):
    (tmp_path / "open.toml").write_text(left_open(), encoding="utf-8")
    design = camopt.load_scene(tmp_path / "open.toml").design
    assert design.duration_chosen and scene_of_text(left_open()).design == design


def test_a_conflict_with_a_duration_names_the_one_that_is_long_enough():
    design = parse_scene(left_open(), "left open", (), chosen_duration_deg).design
    short = design.model_copy(update={"duration_deg": 119.0})
    with pytest.raises(InputError, match=f"lengthen duration_deg to at least {shortest_duration_deg(short):g}") as said:
        kinematic_optimum(short, program_cam(short, 3.0))
    assert "the lift at +-59 deg can reach only 0." in str(said.value) and "not 1 mm" in str(said.value)


def test_a_conflict_without_a_longer_remedy_asks_for_no_shorter_duration():
    design = parse_scene(left_open(), "left open", (), chosen_duration_deg).design
    few = design.model_copy(update={"waves_max": 1})
    with pytest.raises(InputError, match="contradict each other for") as said:
        kinematic_optimum(few, program_cam(few, 3.0))
    assert "lengthen" not in str(said.value)
