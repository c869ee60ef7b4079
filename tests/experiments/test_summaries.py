"""Counts and statements of the experiments for rows that are written by hand."""

import numpy as np
import pytest

from camopt.optimizer.program.linear_program import maximise
from experiments import (
    accuracy_promise,
    architectures,
    gradient_bias,
    linear_programs,
    near_limit,
    never_nothing,
    outside_judges,
    starts,
)
from experiments.work_precision import ratios, ratios_to


@pytest.mark.parametrize(
    ("estimate", "true", "unknown", "outcome"),
    [
        (0.9, 0.5, 0.0, "good, promised"),
        (1.1, 0.5, 0.0, "good, flagged"),
        (0.9, 1.1, 0.0, "off, promised"),
        (np.inf, 2.0, 0.0, "off, flagged"),
        (0.9, 0.5, 0.4, "good, promised"),
        (0.9, 0.5, 0.6, "no truth, promised"),
        (0.9, 1.1, 0.2, "no truth, promised"),
        (2.0, 0.5, np.nan, "no truth, flagged"),
    ],
)
def test_outcomes_of_a_promise(estimate, true, unknown, outcome):
    assert accuracy_promise.row("lift", 1.0, estimate, true, unknown, 0.1)["outcome"] == outcome


def test_a_promise_without_truth_is_not_kept():
    outcomes = {"good, promised": 6, "good, flagged": 2, "off, promised": 1, "no truth, promised": 1, "off, flagged": 3}
    rows = [{"quantity": "q", "outcome": outcome} for outcome, n in outcomes.items() for _ in range(n)]
    found = accuracy_promise.counts(rows)["q"]
    assert found["promises_kept_percent"] == 75.0
    assert found["good_ones_flagged_percent"] == 25.0


def near_limit_row(verdict, warm, cold):
    return {"verdict": verdict, "truth": {"share": warm}, "cold": {"share": cold}, "rest": {"share": 0.6}}


def test_outcomes_of_a_cam_near_its_limit():
    rows = [
        near_limit_row("confirmed", 0.9, 0.8),
        near_limit_row("confirmed", 0.9, 1.1),
        near_limit_row("rejected", 1.2, 0.5),
        near_limit_row("rejected", 0.7, 0.7),
        near_limit_row("sensitive", 0.99, 0.9),
        near_limit_row("not converged", 3.0, 0.9),
    ]
    assert [near_limit.outcome(r) for r in rows] == list(near_limit.OUTCOMES)
    counts = near_limit.table(rows)
    assert counts["good"] == 3 and counts["good ones refused"] == 2 and counts["good among the undecided"] == 1
    assert counts["bad from rest only"] == 1


def never_nothing_row(**told):
    usual = {"best_family": "kurz", "family_area_ratio": 0.5, "verdict": "confirmed", "area_ratio": 0.5,
             "delivered_family": "kurz", "exit_code": 0}  # fmt: skip
    return usual | told


def test_a_loss_is_what_a_family_holds_and_the_command_does_not():
    row = never_nothing_row
    lost = [row(verdict="rejected", exit_code=3), row(area_ratio=0.49), row(verdict=None, area_ratio=None, exit_code=3)]
    none = [row(), row(area_ratio=0.6, delivered_family="free"), row(best_family=None, verdict=None, exit_code=3)]
    assert all(map(never_nothing.is_loss, lost)) and not any(map(never_nothing.is_loss, none))
    found = never_nothing.counted(lost + none)
    assert found["losses"] == lost and found["exit_codes"] == {"0": 3, "3": 3}
    assert (found["a_family_holds"], found["confirmed"], found["neither"]) == (5, 3, 1)
    assert (found["by_the_search"], found["by_a_family"]) == (1, 2)


def test_ratios_of_times_are_those_at_the_target():
    rows = [
        {"method": "event-exact", "error_mm": [1e-9, 1.0], "ms": 0.5},
        {"method": "event-exact, end state", "error_mm": [1e-9, 1.0], "ms": 0.25},
        {"method": "slow", "error_mm": [1e-5, 1.0], "ms": 10.0},
        {"method": "slow", "error_mm": [1e-7, 1.0], "ms": 1000.0},
        {"method": "never", "error_mm": [1e-5, 1.0], "ms": 10.0},
    ]
    assert ratios(rows) == {
        "slow": {"ms": pytest.approx(100.0), "sampled": pytest.approx(200.0), "end_state": pytest.approx(400.0)},
        "never": None,
    }


def test_a_start_without_a_cam_leaves_its_sentence(monkeypatch):
    def refused(scene):
        raise starts.InputError("no such cam")

    monkeypatch.setitem(starts.FAMILIES, "Polydyne", refused)
    row = starts.searched("motori-1", "Polydyne", "exact")
    assert row == {"area_ratio": None, "verdict": None, "why": "no such cam"}
    rows = [row | {"scene": "motori-1", "start": "Polydyne", "gradient": "exact"}]
    found = starts.summary("motori-1", rows)["exact"]
    assert (found["tried"], found["confirmed"], found["least"]) == (1, 0, None)


def test_figures_beside_each_other():
    theirs = [{"jump_mm": 0.10}, {"jump_mm": 0.1004}]
    assert outside_judges._beside("jump_mm", (0.1, 0.1), 0.0, theirs, True)["same"]
    assert not outside_judges._beside("jump_mm", (0.1, 0.102), 0.0, theirs, True)["same"]
    assert not outside_judges._beside("jump_mm", (0.2, 0.3), 0.0, theirs, False)["same"]
    assert not outside_judges._beside("jump_mm", (0.1, 0.1), 0.0, [{"jump_mm": None}], True)["same"]


def test_a_crash_is_a_defect_and_a_refusal_is_none(tmp_path, monkeypatch):
    def singular(*_, **__):
        raise ArithmeticError("Singular matrix")

    monkeypatch.setattr(architectures, "optimize", singular)
    row = architectures.job(architectures.drawn(0), tmp_path / "run")
    assert (row["ends"], row["sentence"]) == (architectures.DEFECT, "ArithmeticError: Singular matrix")


def test_the_error_of_a_gradient_sees_sign_and_size():
    differences = np.array([[1.0, 2.0], [1.1, 2.0]])
    assert gradient_bias.against(np.array([1.1, 2.0]), differences)["relative_error"] == 0.0
    flipped = gradient_bias.against(np.array([-1.0, -2.0]), differences)
    assert flipped["cosine"] == pytest.approx(-1.0, abs=1e-2) and flipped["relative_error"] > 1.9
    assert gradient_bias.against(np.array([2.0, 4.0]), differences)["relative_error"] > 0.9
    assert np.isnan(gradient_bias.against(np.full(2, np.nan), differences)["relative_error"])


def test_a_program_that_the_solver_gives_up_counts_as_undecided(monkeypatch):
    def gives_up(*_):
        raise ArithmeticError("no answer")

    posed = next(linear_programs.programs(2))
    ended = linear_programs.decided(posed, posed.rows)
    assert ended == "optimal" and np.isfinite(maximise(posed.objective, posed.rows, posed.bound, posed.working).value)
    monkeypatch.setattr(linear_programs, "maximise", gives_up)
    assert linear_programs.decided(posed, posed.rows) == linear_programs.UNDECIDED
    row = {"kind": linear_programs.KINDS[0], "free": linear_programs.UNDECIDED, "boxed": ended}
    counts = linear_programs.counted([row | {"free_seconds": 2.0, "boxed_seconds": 1.0}])
    assert counts["free_undecided"] == 1 and counts["boxed_undecided"] == 0


def test_times_are_compared_at_the_same_settings():
    def row(setting, ms):
        return {"method": "m", "setting": setting, "ms": ms}

    older = [row("a", 2.0), row("b", 4.0), row("c", None), row("d", 1.0)]
    newer = [row("a", 1.0), row("b", 6.0), row("c", 1.0), row("e", 1.0), row("d", None)]
    assert ratios_to(older, newer) == {"m": {"least": 0.5, "median": 1.0, "greatest": 1.5}}
