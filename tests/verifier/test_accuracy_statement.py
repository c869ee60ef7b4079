"""`verify --accuracy`: settings from the stored curves, and what was asked beside what was delivered."""

import numpy as np
import pytest

from camopt.cam.families.polydyne import polydyne
from camopt.exact import prepare as event_exact
from camopt.scene import InputError, build_train, load_scene
from camopt.scene.units import UM
from camopt.verifier import accuracy as module
from camopt.verifier.accuracy import EFFORTS, effort_of, stored_curves, verify
from camopt.verifier.convergence import StepRefinement, Tolerances, first_steps
from camopt.verifier.methods import rkg
from camopt.verifier.record import HALVED, accuracy_record, bounce_error_um, method_record
from camopt.verifier.verdict import Verdict
from tests.verifier.answers import answer
from tests.verifier.scenes import from_rest


def at(speed: float, error_mm: float, low: float = 0.1, high: float = 0.1, periodic: bool = True) -> dict:
    """The record of a speed of a verdict with one method."""
    record = method_record(answer(low, high, error=error_mm, periodic=periodic))
    return {"speed_rpm": speed, "decided_after": HALVED, **record}


class TestEstimate:
    def test_it_is_what_halved_steps_moved_and_the_range_of_a_motion_that_does_not_repeat(self):
        assert bounce_error_um(at(5000, 2e-3)) == pytest.approx(2.0)
        assert bounce_error_um(at(5000, 2e-3, 0.1, 0.3)) == pytest.approx(2.0)  # a period of several revolutions
        assert bounce_error_um(at(5000, 2e-3, 0.1, 0.3, periodic=False)) == pytest.approx(202.0)
        assert bounce_error_um(at(5000, np.nan)) is None
        for periodic in (False, True):
            assert bounce_error_um(at(5000, 0.0, np.nan, np.nan, periodic=periodic)) is None


class TestWords:
    def test_reached(self):
        found = accuracy_record([at(5000, 2e-4), at(6000, 5e-4)], 1.0, "fine")
        assert found["statement"] == "requested accuracy: 1 um (fine); estimated error of bounce: 0.5 um"
        assert (found["asked"], found["asked_um"], found["reached"]) == ("fine", 1.0, True)
        assert found["delivered_um"] == pytest.approx(0.5)

    def test_not_reached_is_a_range_at_the_speeds_concerned(self):
        found = accuracy_record([at(5000, 2e-4), at(7000, 0.0, 0.12, 0.34, periodic=False)], 1.0, None)
        assert found["statement"] == (
            "requested accuracy: 1 um; not reached: only a range of the bounce is known, 0.1200 to 0.3400 mm at 7000 "
            "r/min"
        )
        assert (found["asked"], found["reached"]) == (1.0, False)
        assert found["delivered_um"] == pytest.approx(220.0)

    def test_not_reached_by_a_motion_that_repeats_is_the_best_figure_with_its_error(self):
        found = accuracy_record([at(7000, 3e-3, 0.12, 0.12)], 1.0, None)
        assert found["statement"].endswith("only a range of the bounce is known, 0.1200 mm +- 3 um at 7000 r/min")

    def test_one_step_alone_has_no_error(self):
        found = accuracy_record([at(7000, np.inf, 0.12, 0.12)], 1.0, None)
        assert found["statement"].endswith("only a range of the bounce is known, 0.1200 mm +- inf um at 7000 r/min")

    def test_a_valve_that_does_not_seat_has_no_figure(self):
        found = accuracy_record([at(7000, np.nan, np.nan, np.nan)], 1.0, None)
        assert found["delivered_um"] is None and not found["reached"]
        assert found["statement"] == (
            "requested accuracy: 1 um; there is no bounce at 7000 r/min, where the valve does not seat"
        )
        both = accuracy_record([at(6000, 0.0, 0.12, 0.34, periodic=False), at(7000, np.nan, np.nan, np.nan)], 1.0, None)
        assert both["statement"].endswith(
            "0.1200 to 0.3400 mm at 6000 r/min; there is no bounce at 7000 r/min, where the valve does not seat"
        )


class TestEffort:
    def test_a_number_picks_from_the_stored_curves(self):
        fine, coarse = effort_of(2.0), effort_of(50.0)
        assert (fine.tolerances.tolerance_um, coarse.tolerances.tolerance_um) == (2.0, 50.0)
        assert fine.band_step_rpm == round(stored_curves()["band_step"].coarsest(2.0)) < coarse.band_step_rpm
        assert fine.tolerances.position <= coarse.tolerances.position <= EFFORTS["draft"].tolerances.position
        assert effort_of(1e6).band_step_rpm == EFFORTS["draft"].band_step_rpm
        assert effort_of(0.01).tolerances.position == pytest.approx(0.01 * UM)

    def test_no_method_is_asked_for_less_than_the_least_error_that_is_accuracy_record(self):
        tolerances = effort_of(1e-5).tolerances
        assert tolerances.tolerance_um == 0.01 and tolerances.position == pytest.approx(0.01 * UM)

    def test_a_number_below_it_ends_with_the_best_that_was_reached(self):
        scene = load_scene("motori-1")
        found = verify(scene, polydyne(scene), (3000.0,), "event", 1e-5)
        assert found.accuracy["asked_um"] == 1e-5 and not found.accuracy["reached"]
        first = first_steps(build_train(scene), scene.cam_speed(3000.0))
        assert found.speeds[0].first.steps_per_revolution == 4 * first + 2  # two halvings changed nothing
        said = found.accuracy["statement"]
        assert said.startswith("requested accuracy: 1e-05 um; not reached: only a range of the bounce is known, ")
        assert "0.0000 mm +- 0.01 um at 3000 r/min" in said

    @pytest.mark.parametrize("accuracy", ["rough", 0.0, -1.0, np.nan, np.inf])
    def test_refusals(self, accuracy):
        with pytest.raises(InputError, match=r"accuracy .*(micrometres|draft)"):
            effort_of(accuracy)

    def test_verify_is_asked_for_it(self, monkeypatch):
        given = []
        nothing = Verdict("confirmed", (), (), None, (), None, None, 1.0)
        monkeypatch.setattr(module, "verdict_on", lambda *arguments, progress: given.append(arguments) or nothing)
        scene, effort = load_scene("motori-1"), effort_of(50.0)
        assert verify(scene, polydyne(scene), (5000.0,), "event", 50.0).asked == 50.0
        assert given[0][2:] == ((5000.0,), ("event",), effort.band_step_rpm, effort.tolerances)
        assert effort.tolerances.tolerance_um == 50.0
        verify(scene, polydyne(scene), accuracy="draft")
        assert given[1][3] == EFFORTS["draft"].methods


def test_the_bounce_delivered_is_within_what_was_asked():
    case, rest = from_rest("motori-1", 6500)
    found, true = (
        StepRefinement(prepare, *case, rest, Tolerances(wanted_um, halvings, reported=True)).answer()
        for prepare, wanted_um, halvings in ((rkg.prepare, 20.0, 6), (event_exact, 0.01, 3))
    )
    delivered_um = bounce_error_um(method_record(found))
    assert true.worst["bounce_mm"] > 0.01
    assert 1e3 * abs(found.worst["bounce_mm"] - true.worst["bounce_mm"]) <= delivered_um <= 20.0
