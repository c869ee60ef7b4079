"""The programs of drawn scenes: the draw covers what it says, and the small size decides all of them."""

import numpy as np
from scipy.optimize import linprog

from camopt.highs import FEASIBILITY
from camopt.optimizer.program.linear_program import maximise
from camopt.scene import InputError
from experiments import linear_programs
from experiments.linear_programs import KINDS, UNDECIDED, counted, decided, drawn, programs


def test_the_draw_covers_what_it_says():
    designs = [scene.design for scene in map(loaded, range(60)) if scene is not None]
    lifts = [design.max_lift_mm for design in designs]
    assert min(lifts) < 3 and max(lifts) > 40 and drawn(3) == drawn(3)
    assert 0 < sum(design.reach_max_lift for design in designs) < len(designs)
    assert any(design.lift_at for design in designs) and any(design.duration_at for design in designs)
    assert {posed.kind for posed in programs(2)} == set(KINDS)


def loaded(number: int):
    try:
        return drawn(number)
    except InputError:
        return None


def test_no_program_of_the_small_size_is_left_undecided(tmp_path):
    content = linear_programs.main("small", tmp_path)
    assert content["all"]["programs"] == 20 and content["all"]["boxed_undecided"] == 0
    assert sum(row["programs"] for row in content["kinds"].values()) == 20


def test_a_program_that_free_columns_leave_undecided_is_decided():
    """Of a drawn scene on which HiGHS gave up; by how much its rows contradict says SciPy."""
    *_, posed = programs(29)
    assert decided(posed, posed.rows) == "infeasible"
    assert least_violation(posed) > FEASIBILITY


def least_violation(posed) -> float:
    """The smallest s >= 0 by which all scaled rows would have to give, by SciPy."""
    matrix, level = posed.rows.scaled, posed.bound / posed.rows.norm
    count = matrix.shape[1]
    give = np.column_stack([matrix, -np.ones(len(matrix))])
    bounds = [(None, None)] * count + [(0, None)]
    return float(linprog(np.append(np.zeros(count), 1.0), A_ub=give, b_ub=level, bounds=bounds, method="highs").fun)


def test_a_program_that_the_solver_gives_up_counts_as_undecided(monkeypatch):
    def gives_up(*_):
        raise ArithmeticError("no answer")

    posed = next(programs(2))
    ended = decided(posed, posed.rows)
    assert ended == "optimal" and np.isfinite(maximise(posed.objective, posed.rows, posed.bound, posed.working).value)
    monkeypatch.setattr(linear_programs, "maximise", gives_up)
    assert decided(posed, posed.rows) == UNDECIDED
    rows = [{"kind": KINDS[0], "free": UNDECIDED, "boxed": ended, "free_seconds": 2.0, "boxed_seconds": 1.0}]
    assert counted(rows)["free_undecided"] == 1 and counted(rows)["boxed_undecided"] == 0
