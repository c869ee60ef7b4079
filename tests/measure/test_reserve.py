"""How far beyond its band a cam keeps its limits is said with the scene's own limits."""

import pytest

from camopt.measure.reserve import reserve_sentences

BAND = (4000.0, 7600.0)


@pytest.mark.parametrize(
    ("starts", "design", "says"),
    [
        (
            {"first_jump_rpm": 7620.0},
            {"jump_max_mm": 0.02},
            ["Jump exceeds 0.02 mm from 7620 r/min on, 0.3 % above the band."],
        ),
        ({"first_bounce_rpm": 3990.0}, {}, ["Bounce exceeds 0.05 mm from 3990 r/min on, below the band."]),
        (
            {"first_bounce_rpm": 5000.0},
            {"bounce_max_mm": None},
            ["Bounce exceeds 0.05 mm from 5000 r/min on, within the band."],
        ),
        ({"first_jump_rpm": None}, {}, ["Jump does not exceed 0.05 mm below 1.5 times the band's top."]),
        ({}, {}, []),
    ],
)
def test_sentences(starts, design, says):
    assert reserve_sentences(starts, design, BAND) == says
