"""The figures of trains as built: what is drawn, also where a train never seats."""

import numpy as np
import pytest

from camopt.plots.yields import SHOWN, blame_bars, used_against_speed

SPEEDS = np.array([5000.0, 6000.0, 7000.0])


def test_median_ranges_and_worst_train_stand_in_a_panel_for_each_limit():
    used = np.linspace(0.0, 1.0, 21)[:, None] * np.array([0.5, 1.0, 1.5])
    used[-1, 2] = np.inf
    figure = used_against_speed(SPEEDS, {"bounce_max_mm": used, "jump_max_mm": 0.5 * used[:-1]}, "kodama")
    bounce, jump = figure.axes
    median, worst = bounce.lines[:2]
    np.testing.assert_allclose(median.get_ydata(), [0.25, 0.5, 0.75])
    assert worst.get_ydata()[:2] == pytest.approx([0.5, 1.0]) and worst.get_ydata()[2] > SHOWN == bounce.get_ylim()[1]
    assert bounce.get_title(loc="left") == "kodama\nbounce_max_mm" and "r/min" in jump.get_xlabel()
    assert [text.get_text() for text in figure.legends[0].get_texts()][-2:] == ["median", "worst train"]


def test_bars_of_blame_and_of_what_half_buys():
    figure = blame_bars({"lash": 0.4, "preload": 0.1}, {"lash": 0.05, "preload": -0.01})
    blame, bought = figure.axes
    assert [bar.get_width() for bar in blame.patches] == pytest.approx([10.0, 40.0])
    assert [bar.get_width() for bar in bought.patches] == pytest.approx([-1.0, 5.0])
    assert [label.get_text() for label in blame.get_yticklabels()] == ["preload", "lash"]
    assert len(blame_bars({"lash": 0.4}, {}).axes) == 1
