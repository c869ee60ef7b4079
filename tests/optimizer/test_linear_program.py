"""Warm-started programs give the answers of SciPy's `linprog`, which starts cold on all rows at once."""

import numpy as np
import pytest
from highspy import HighsModelStatus
from scipy.optimize import linprog

from camopt.cam.families.free import free_cam
from camopt.highs import OPTIONS, Infeasible, minimise
from camopt.optimizer.program import linear_program
from camopt.optimizer.program.kinematic import area_ratio_row
from camopt.optimizer.program.linear_program import Rows, maximise
from camopt.optimizer.program.no_jump import NoCamHoldsContact, no_jump_program
from camopt.scene import build_train, load_scene

FEW = np.arange(3)


def cold(objective, rows: Rows, bound):
    tight = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-9}
    cost = objective * rows.column
    return linprog(-cost, A_ub=rows.scaled, b_ub=bound / rows.norm, bounds=(None, None), method="highs", options=tight)


def random_program(seed: int, rows: int = 900, columns: int = 7):
    """Directions all round, so that it is bounded on the whole, and right sides about a point that is not zero."""
    random = np.random.default_rng(seed)
    matrix = random.normal(size=(rows, columns)) * random.uniform(0.1, 10.0, (rows, 1))
    inside = random.normal(size=columns)
    bound = matrix @ inside + np.linalg.norm(matrix, axis=1) * random.uniform(0.5, 2.0, rows)
    return random.normal(size=columns), Rows(matrix, random.uniform(0.5, 2.0, columns)), bound, random


@pytest.mark.parametrize("seed", range(5))
def test_answers_of_a_row_of_programs_are_the_cold_ones(seed, monkeypatch):
    monkeypatch.setattr(linear_program, "ADDED_PER_ROUND", 20)  # several rounds
    objective, rows, bound, random = random_program(seed)
    for _ in range(6):
        found, expected = maximise(objective, rows, bound, FEW), cold(objective, rows, bound)
        assert found.value == pytest.approx(-expected.fun, abs=1e-9)
        np.testing.assert_allclose(found.z, expected.x * rows.column, atol=1e-9)
        np.testing.assert_allclose(found.duals * rows.norm, -expected.ineqlin.marginals, atol=1e-8)
        np.testing.assert_allclose(found.duals @ rows.matrix, objective, atol=1e-8)
        assert len(rows.model.indices) <= 8 * len(found.z) + 20
        bound = bound + 0.2 * np.linalg.norm(rows.matrix, axis=1) * random.uniform(-1, 1, len(bound))
        objective = objective + 0.1 * random.normal(size=len(objective))


def test_infeasible_right_sides_leave_the_rows_usable():
    objective, rows, bound, _ = random_program(7)
    first = maximise(objective, rows, bound, FEW)
    apart = bound - 3.0 * np.linalg.norm(rows.matrix, axis=1)
    assert cold(objective, rows, apart).status == 2
    with pytest.raises(Infeasible):
        maximise(objective, rows, apart, FEW)
    assert maximise(objective, rows, bound, FEW).value == pytest.approx(first.value, abs=1e-9)
    with pytest.raises(Infeasible):
        maximise(objective, Rows(rows.matrix, rows.column), apart, FEW)  # and from the start


def test_a_simplex_method_that_goes_round_is_left_for_another_one(monkeypatch):
    objective, rows, bound, _ = random_program(3)
    expected = maximise(objective, rows, bound, FEW)
    assert rows.model.solver.pivots > 20
    monkeypatch.setitem(OPTIONS, "simplex_iteration_limit", 10)
    found = maximise(objective, Rows(rows.matrix, rows.column), bound, FEW)
    assert found.value == pytest.approx(expected.value, abs=1e-8)


def test_unbounded_on_the_working_set_is_no_answer_unbounded_on_all_rows_an_error():
    objective, rows, bound, _ = random_program(8)
    assert maximise(objective, rows, bound, np.zeros(0, int)).value == pytest.approx(-cold(objective, rows, bound).fun)
    open_side = rows.matrix @ objective < 0
    cone = Rows(rows.matrix[open_side], rows.column)
    assert cold(objective, cone, bound[open_side]).status == 3
    with pytest.raises(ArithmeticError, match="unbounded"):
        maximise(objective, cone, bound[open_side], FEW)


def test_rows_remain_usable_after_a_direction_without_bound():
    """The row that bounds the second program comes in only where that begins within the box again."""
    rows, bound = Rows(np.eye(2), np.ones(2)), np.ones(2)
    with pytest.raises(ArithmeticError, match="unbounded"):
        maximise(np.array([-1.0, 0.0]), rows, bound, np.arange(1))
    assert maximise(np.array([0.0, 1.0]), rows, bound, np.arange(1)).value == pytest.approx(1.0)


def test_a_solver_that_ends_without_an_answer_begins_with_another_seed():
    class Fickle:
        """Decides nothing with the first two attempts, as HiGHS does now and then."""

        def __init__(self, solver):
            self.solver, self.seeds = solver, []

        def setOptionValue(self, name, value):
            self.seeds += [value] if name == "random_seed" else []
            return self.solver.setOptionValue(name, value)

        def getModelStatus(self):
            return self.solver.getModelStatus() if len(self.seeds) > 2 else HighsModelStatus.kNotset

        def __getattr__(self, name):
            return getattr(self.solver, name)

    objective, rows, bound, _ = random_program(3)
    expected = maximise(objective, rows, bound, FEW)
    again = Rows(rows.matrix, rows.column)
    again.model.solver.highs = fickle = Fickle(again.model.solver.highs)
    assert maximise(objective, again, bound, FEW).value == pytest.approx(expected.value, abs=1e-9)
    assert fickle.seeds[:3] == [0, 0, 1]


def test_a_solver_that_decides_nothing_says_so(monkeypatch):
    objective, rows, bound, _ = random_program(3)
    monkeypatch.setattr(rows.model.solver.highs, "getModelStatus", lambda: HighsModelStatus.kNotset, raising=False)
    with pytest.raises(ArithmeticError, match="was not solved"):
        maximise(objective, rows, bound, FEW)


def test_columns_free_in_sign_may_lie_anywhere():
    """The box in which a column is looked for at first ends neither the program nor a direction of no worth."""
    far = maximise(np.ones(1), Rows(np.ones((1, 1)), np.ones(1)), np.array([1e9]), np.arange(1))
    assert far.value == pytest.approx(1e9) and far.duals == pytest.approx(1.0)
    idle = maximise(np.array([1.0, 0.0]), Rows(np.array([[1.0, 0.0]]), np.ones(2)), np.ones(1), np.arange(1))
    np.testing.assert_array_equal(idle.z, [1.0, 0.0])


def test_a_program_with_equations_and_boxes_is_that_of_linprog():
    random = np.random.default_rng(5)
    cost, rows, box = random.normal(size=6), random.normal(size=(8, 6)), np.tile([-2.0, 3.0], (6, 1))
    high = rows @ random.uniform(-1, 2, 6)
    low = np.where(np.arange(8) < 2, high, -np.inf)
    for large in (False, True):
        found = minimise(cost, rows, low, high, box, large=large)
        expected = linprog(cost, A_ub=rows[2:], b_ub=high[2:], A_eq=rows[:2], b_eq=high[:2], bounds=box)
        assert found.value == pytest.approx(expected.fun, abs=1e-8)
        np.testing.assert_allclose(found.x, expected.x, atol=1e-7)
        marginals = np.append(expected.eqlin.marginals, expected.ineqlin.marginals)
        np.testing.assert_allclose(found.row_duals, marginals, atol=1e-7)
        np.testing.assert_allclose(found.column_duals, expected.lower.marginals + expected.upper.marginals, atol=1e-7)


def test_entries_too_small_for_the_solver_are_left_out():
    matrix = np.array([[1.0, 1e-14], [-1.0, 1e-11], [0.0, 1.0], [1e-15, -1.0]])
    found = maximise(np.array([1.0, 2.0]), Rows(matrix, np.ones(2)), np.array([1.0, 1.0, 3.0, 1.0]), FEW)
    np.testing.assert_allclose(found.z, [1.0, 3.0], atol=1e-9)


def test_kodama_solved_again_with_other_margins_gives_the_cold_answer():
    scene = load_scene("kodama")
    cam, speeds = free_cam(scene.design, 6.0), [scene.cam_speed(s) for s in (5000.0, 7000.0)]
    program = no_jump_program(build_train(scene), scene.design, cam, speeds)
    row, constant = area_ratio_row(scene.design, cam)
    for margins in (0.0, (-15.0, 4.0, 30.0), (5.0, -8.0, 0.0)):
        found = program.solve(margins)
        expected = cold(row, program.rows, program.bound(margins))
        assert found.area_ratio == pytest.approx(constant - expected.fun, abs=1e-9)
        np.testing.assert_allclose(found.z, expected.x * program.rows.column, atol=1e-8)
    impossible = 900.0
    assert cold(row, program.rows, program.bound(impossible)).status == 2
    with pytest.raises(NoCamHoldsContact):
        program.solve(impossible)
    again = program.solve((5.0, -8.0, 0.0))
    assert again.area_ratio == pytest.approx(found.area_ratio, abs=1e-12)
    before = program.rows.model.solver.pivots
    program.solve((6.0, -8.0, 1.0))
    assert 0 < program.rows.model.solver.pivots - before < 40  # goes on from its basis; the first program takes 138
