"""What is said where no cam is confirmed: the limit at fault, the nearest cam, and what the program holds at most."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from camopt.optimizer.program.no_jump import NoCamHoldsContact
from camopt.optimizer.search.judge import Judged
from camopt.optimizer.search.margins import FIRST_MARGINS_N, FORCE_RESERVE, first_margins
from camopt.optimizer.search.search import why_none_holds
from camopt.scene import load_scene

DESIGN = load_scene("motori-1").design.model_copy(update={"contact_force_min_N": None})
SPEEDS = np.array([4000.0, 6000.0, 7600.0])


def judged(bounce):
    share = np.array([bounce]) / 0.05
    return Judged(
        SPEEDS, {"bounce_mm": np.array(bounce)}, ("bounce_mm",), np.array([0.05]), share, np.zeros((3, 2)), np.ones(3)
    )


def program(holds_N, **limits):
    def solve(margins):
        if margins[0] > holds_N:
            raise NoCamHoldsContact("no cam", margins[0] - holds_N)

    return SimpleNamespace(design=DESIGN.model_copy(update=limits), solve=solve)


def test_the_limit_at_fault_the_nearest_cam_and_the_speed_up_to_which_it_holds():
    said = why_none_holds([judged([0.01, 0.2, 0.3]), judged([0.01, 0.02, 0.07])], program(np.inf))
    assert "bounce_mm of 0.07 at 7600 r/min against bounce_max_mm = 0.05" in said
    assert "holds every limit up to 6000 r/min" in said and "while closed" not in said


def test_the_value_is_that_of_the_speed_beside_it_which_breaks_the_limit():
    beside = replace(judged([0.01, 0.02, 0.03]), share=np.array([[0.2, 1.8, 0.6]]))
    said = why_none_holds([beside], program(np.inf))
    assert "bounce_mm of 0.09 at 6000 r/min against bounce_max_mm = 0.05" in said


@pytest.mark.parametrize(("holds_N", "says"), [(120.0, True), (np.inf, False)])
def test_the_largest_least_force_that_a_cam_of_the_program_holds(holds_N, says):
    said = why_none_holds([judged([0.1, 0.2, 0.3])], program(holds_N, contact_force_min_N=300.0))
    assert ("no cam of the program keeps more than 120 N on its contacts" in said) == says
    assert "up to" not in said


def test_margins_begin_with_what_the_design_asks_for():
    assert first_margins(DESIGN, 2, 1.0).tolist() == [[first, first] for first in FIRST_MARGINS_N]
    asked = DESIGN.model_copy(update={"contact_force_min_N": 100.0})
    force = 100.0 * FORCE_RESERVE
    assert first_margins(asked, 1, 1.0)[:, 0].tolist() == [force, force, FIRST_MARGINS_N[2]]
