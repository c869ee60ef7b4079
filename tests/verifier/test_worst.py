"""The worst verified figure and its place, read from records of verification.json that are written by hand."""

import pytest

from camopt.verifier.record import VerificationRecord, Worst, worst_case_value


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


def test_one_missing_figure_leaves_nothing_to_say_and_no_record_says_nothing():
    assert record(jump_mm=(0.3, None)).worst("jump_mm") == Worst(None, 6000.0, "speeds[1].jump_mm")
    assert VerificationRecord().worst("jump_mm") is None


def test_the_end_of_the_range_is_read_before_the_error_and_the_figure_itself():
    speed = {"bounce_mm": 0.1, "bounce_error_mm": 0.02, "bounce_range_mm": [0.05, 0.2], "contact_force_min_N": 40.0}
    assert worst_case_value(speed, "bounce_mm") == (0.2, "bounce_range_mm[1]")
    assert worst_case_value(speed, "contact_force_min_N") == (40.0, "contact_force_min_N")
    assert worst_case_value(speed | {"ranges": {"contact_force_min_N": [35.0, 45.0]}}, "contact_force_min_N") == (
        35.0,
        "ranges.contact_force_min_N[0]",
    )
    del speed["bounce_range_mm"]
    assert worst_case_value(speed, "bounce_mm") == (pytest.approx(0.12), "bounce_mm + bounce_error_mm")
    assert worst_case_value({"jump_mm": "much"}, "jump_mm") == (None, "jump_mm")


@pytest.mark.parametrize(
    ("rpm", "words"),
    [(987.65, "987.6"), (6000.0, "6000"), (9999.0, "9999"), (10_000.0, "10000"), (12_345.0, "12345"), (None, "–")],
)
def test_a_speed_is_told_to_the_revolution_with_as_many_digits_as_it_has(rpm, words):
    assert Worst(0.1, rpm, "").where == f"at {words} r/min"
