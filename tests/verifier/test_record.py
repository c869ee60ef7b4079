"""What is stated about a verification: its worst metrics, its text and its figure, of records written by hand."""

from dataclasses import replace

import numpy as np
import pytest

from camopt.measure.sweep import Band
from camopt.scene import QUANTITIES, load_scene
from camopt.verifier.at_speed import SpeedVerdict
from camopt.verifier.display import MOST_LINES
from camopt.verifier.record import VerificationRecord, Worst, outside_entry, outside_sentence, worst_case_value
from camopt.verifier.verdict import Verdict
from tests.verifier.answers import answer

SCENE = load_scene("kodama")


def record(**listed):
    """Two listed speeds with a figure each, by metric."""
    rows = ({name: values[i] for name, values in listed.items()} for i in range(2))
    speeds = [{"speed_rpm": rpm} | row for rpm, row in zip((5000.0, 6000.0), rows, strict=True)]
    return VerificationRecord(speeds=speeds)


def test_the_worst_figure_is_the_largest_and_of_the_least_force_the_smallest():
    found = record(jump_mm=(0.3, 0.2), contact_force_min_N=(40.0, 30.0), contact_force_max_N=(900.0, 950.0))
    assert found.worst("jump_mm") == Worst(0.3, 5000.0, "speeds[0].jump_mm")
    assert found.worst("contact_force_min_N") == Worst(30.0, 6000.0, "speeds[1].contact_force_min_N")
    assert found.worst("contact_force_max_N") == Worst(950.0, 6000.0, "speeds[1].contact_force_max_N")
    found["band"] = {"worst": {"jump_mm": {"value": 0.4, "speed_rpm": 5500.0}}}
    assert found.worst("jump_mm") == Worst(0.4, 5500.0, "band.worst.jump_mm.value")
    assert record(jump_mm=(0.3, None)).worst("jump_mm") == Worst(None, 6000.0, "speeds[1].jump_mm")
    assert VerificationRecord().worst("jump_mm") is None


def test_the_end_of_the_range_is_read_before_the_error_and_the_figure_itself():
    speed = {"bounce_mm": 0.1, "bounce_error_mm": 0.02, "bounce_range_mm": [0.05, 0.2], "contact_force_min_N": 40.0}
    assert worst_case_value(speed, "bounce_mm") == (0.2, "bounce_range_mm[1]")
    assert worst_case_value(speed, "contact_force_min_N") == (40.0, "contact_force_min_N")
    ranged = speed | {"ranges": {"contact_force_min_N": [35.0, 45.0]}}
    assert worst_case_value(ranged, "contact_force_min_N") == (35.0, "ranges.contact_force_min_N[0]")
    del speed["bounce_range_mm"]
    assert worst_case_value(speed, "bounce_mm") == (pytest.approx(0.12), "bounce_mm + bounce_error_mm")
    assert worst_case_value({"jump_mm": "much"}, "jump_mm") == (None, "jump_mm")


@pytest.mark.parametrize(
    ("rpm", "words"),
    [(987.65, "987.6"), (6000.0, "6000"), (9999.0, "9999"), (10_000.0, "10000"), (12_345.0, "12345"), (None, "–")],
)
def test_a_speed_is_told_to_the_revolution_with_as_many_digits_as_it_has(rpm, words):
    assert Worst(0.1, rpm, "").where == f"at {words} r/min"


def verdict(speeds, band=None):
    """Confirmed at speeds [r/min], every figure a millionth of the speed."""
    answers = {rpm: answer(rpm * 1e-6, error=1e-6) for rpm in speeds}
    found = (SpeedVerdict(rpm, "confirmed", (), (), a.range, {"event": a, "rkg": a}) for rpm, a in answers.items())
    return Verdict("confirmed", (), tuple(found), band, (), None, None, 2.0, scene=SCENE)


def swept():
    metrics = {rpm: dict.fromkeys(QUANTITIES, rpm * 1e-6) for rpm in (5000.0, 6000.0, 7000.0)}
    return Band(5000.0, 7000.0, 1000.0, metrics, dict.fromkeys(metrics, "event"))


@pytest.mark.parametrize("difference_nm", [0.5, 1.2])
def test_what_another_engine_says_stands_once_whether_it_agrees_or_is_the_reason(difference_nm):
    said = outside_entry(5000.0, "Exudyn 1", 2, difference_nm, 1.1)
    assert str(replace(verdict([5000.0]), outside=(said,))).count(outside_sentence([said])) == 1


@pytest.mark.parametrize(("count", "more"), [(3, []), (MOST_LINES, []), (MOST_LINES + 5, ["and 5 more speeds"])])
def test_no_more_speeds_are_listed_than_a_screen_holds_and_the_others_are_counted(count, more):
    lines = str(verdict(np.linspace(5000.0, 7000.0, count).tolist())).splitlines()
    assert sum(line.endswith("  confirmed") for line in lines) == min(count, MOST_LINES)
    assert [line for line in lines if "more speeds" in line] == more


def test_what_is_beyond_the_band_is_said_where_a_band_was_swept_and_only_there():
    said = "below 1.5 times the band's top"
    assert said not in str(verdict([5000.0]))
    assert str(verdict([5000.0], swept())).count(said) == 2  # of jump and of bounce


@pytest.mark.parametrize("band", [None, swept()])
def test_the_figure_draws_bounce_and_jump_in_the_order_of_the_speeds(band):
    drawn = verdict([7000.0, 5000.0, 6000.0], band).plot()
    for axes in drawn.axes:
        curves = [np.transpose(line.get_data()) for line in axes.lines if len(line.get_xdata()) == 3]
        expected = [[rpm, rpm * 1e-6] for rpm in (5000.0, 6000.0, 7000.0)]
        assert any(np.allclose(np.array(curve, dtype=float), expected) for curve in curves)
