"""How a verdict shows itself, of verdicts whose figures are written by hand."""

import numpy as np
import pytest

from camopt.measure.sweep import Band
from camopt.scene import QUANTITIES, load_scene
from camopt.verifier.at_speed import SpeedVerdict
from camopt.verifier.convergence import Converged
from camopt.verifier.display import MOST_LINES
from camopt.verifier.verdict import Verdict

SCENE = load_scene("kodama")


def verdict(speeds, band=None):
    """Confirmed at speeds [r/min], every figure a millionth of the speed."""
    found = []
    for rpm in speeds:
        values = dict.fromkeys(QUANTITIES, rpm * 1e-6)
        ranges, error = {name: (value, value) for name, value in values.items()}, dict.fromkeys(QUANTITIES, 1e-6)
        one = Converged(1440, True, values, ranges, error, 5, True, np.zeros(2))
        found.append(SpeedVerdict(rpm, "confirmed", (), (), ranges, {"event": one, "rkg": one}))
    return Verdict("confirmed", (), tuple(found), band, (), None, None, 2.0, scene=SCENE)


def swept():
    speeds = np.array([5000.0, 6000.0, 7000.0])
    return Band(5000.0, 7000.0, 1000.0, speeds, dict.fromkeys(QUANTITIES, speeds * 1e-6), ("event",) * 3)


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
