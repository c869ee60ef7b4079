"""The work-precision experiment at its small size, and its Dormand-Prince against SciPy's."""

import json

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from experiments.support.dormand_prince import DENSE, ERROR, A, dormand_prince, right_hand_side
from experiments.support.work_precision_parts import fastest_rows, ratios
from experiments.work_precision import Case, main


def test_small_size_writes_every_method_and_the_ratios(tmp_path):
    content = main("small", tmp_path)
    rows = {row["method"]: row for row in reversed(content["methods"])}
    assert {"event-exact", "Runge-Kutta-Gill", "Houbolt", "Dormand-Prince, compiled", "SciPy DOP853"} <= set(rows)
    assert rows["event-exact"]["error_mm"][0] < 1e-8 < 1e-3 < rows["Runge-Kutta-Gill"]["error_mm"][0]
    assert all(row["ms"] > 0 for row in rows.values())
    assert content["parts"]["switchings"] > 50
    stored = json.loads((tmp_path / "work_precision.json").read_text())
    assert stored["provenance"]["command"] == "python -m experiments.work_precision small"
    assert (tmp_path / "work_precision-error.png").stat().st_size > 10_000


def test_dormand_prince_follows_scipy_where_nothing_switches():
    """The opening ramp: dense output and steps against DOP853 at 1e-12."""
    case = Case("small")
    times = np.linspace(0.0, 0.3 * case.times[-1] / 2, 50)
    ours, tried = dormand_prince(case.rest, times, 1e-9, 1e-12, case.arrays)

    def slope(t, y):
        dy = np.empty(20)
        right_hand_side(t, y, dy, case.arrays)
        return dy

    theirs = solve_ivp(slope, times[[0, -1]], case.rest, "DOP853", times, rtol=1e-12, atol=1e-15, max_step=1e-5).y.T
    assert np.abs(ours - theirs)[:, :10].max() < 1e-10
    assert np.ptp(theirs[:, 1]) > 1e-4
    assert tried > 100


def test_dormand_prince_coefficients_have_order_five():
    """Order conditions on the bushy and tall trees, and the error estimate's order four."""
    b, c = A[6], A.sum(axis=1)[:6]
    for k in range(1, 6):
        assert b @ c ** (k - 1) == pytest.approx(1 / k, abs=1e-14)
    assert b @ (A[:6] @ (A[:6] @ (A[:6] @ c))) == pytest.approx(1 / 120, abs=1e-14)
    for k in range(4):
        assert ERROR @ A.sum(axis=1) ** k == pytest.approx(0.0, abs=1e-14)
    assert abs(DENSE.sum()) < 1e-12


def test_ratios_are_those_at_the_target():
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


def test_a_row_has_the_least_time_of_its_rounds():
    fast, slow = {"method": "a", "ms": 1.0, "first_call_ms": 3.0}, {"method": "a", "ms": 2.0, "first_call_ms": 9.0}
    never = {"method": "b", "ms": None, "first_call_ms": None}
    assert fastest_rows([[slow, never], [fast, never]]) == [{**slow, "ms": 1.0}, never]
