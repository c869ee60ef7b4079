"""Linear programs in JAX: SciPy's answers, slopes as differences have them, and what happens where there are none."""

import re
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import linprog

import camopt
from camopt.optimizer.program import differentiable
from camopt.optimizer.program.kinematic import kinematic_optimum
from camopt.scene import InputError, load_scene

SQUARE = jnp.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])


def random_program(seed: int, rows: int = 40, columns: int = 5):
    """Directions all round a point: bounded, and with probability one no vertex is degenerate."""
    random = np.random.default_rng(seed)
    matrix = random.normal(size=(rows, columns))
    bound = matrix @ random.normal(size=columns) + np.linalg.norm(matrix, axis=1) * random.uniform(0.5, 2.0, rows)
    return (random.normal(size=columns), matrix, bound), random


@pytest.mark.parametrize("seed", range(3))
def test_answers_are_those_of_scipy(seed):
    (cost, matrix, bound), _ = random_program(seed, rows=1000)
    found = camopt.linear_program(cost, matrix, bound)
    expected = linprog(-cost, matrix, bound, bounds=(None, None))
    assert float(found.value) == pytest.approx(-expected.fun, abs=1e-8)
    np.testing.assert_allclose(found.z, expected.x, atol=1e-7)
    np.testing.assert_allclose(found.duals, -expected.ineqlin.marginals, atol=1e-7)


@pytest.mark.parametrize("part", ["z", "value", "duals"])
@pytest.mark.parametrize("seed", range(3))
def test_slopes_are_those_of_differences(part, seed):
    arguments, random = random_program(seed)
    size = random.uniform(0.1, 10.0, len(arguments[0]))  # scales the solver, changes nothing
    weights = random.normal(size=getattr(camopt.linear_program(*arguments), part).shape)

    @jax.jit
    def number(*given):
        return jnp.sum(weights * getattr(camopt.linear_program(*given, size=size), part))

    slopes = jax.grad(number, argnums=(0, 1, 2))(*arguments)
    for i, slope in enumerate(slopes):
        way, h = random.normal(size=slope.shape), 1e-5
        high, low = (number(*arguments[:i], arguments[i] + s * h * way, *arguments[i + 1 :]) for s in (1, -1))
        assert float(jnp.sum(slope * way)) == pytest.approx(float(high - low) / (2 * h), rel=1e-5, abs=1e-7)


def test_several_programs_at_once():
    bounds = jnp.array([[1.0, 1.0, 1.0, 1.0], [2.0, 3.0, 0.0, 0.0]])
    found = jax.vmap(lambda bound: camopt.linear_program(jnp.ones(2), SQUARE, bound).z)(bounds)
    np.testing.assert_allclose(found, [[1.0, 1.0], [2.0, 3.0]])


def test_a_matrix_that_was_solved_goes_on_from_its_basis():
    (cost, matrix, bound), _ = random_program(5, rows=2000, columns=12)
    camopt.linear_program(cost, matrix, bound)
    model = differentiable._rows(matrix.tobytes(), np.ones(12).tobytes()).model
    cold = model.solver.pivots
    found = camopt.linear_program(cost, matrix, 1.001 * bound)
    assert 0 < cold and model.solver.pivots - cold < cold / 4
    assert float(found.value) == pytest.approx(-linprog(-cost, matrix, 1.001 * bound, bounds=(None, None)).fun)


def test_few_models_stay_in_memory():
    for seed in range(differentiable.MOST_MODELS + 3):
        camopt.linear_program(*random_program(seed)[0])
    assert differentiable._rows.cache_info().currsize == differentiable.MOST_MODELS


class TestDegenerate:
    def test_of_two_rows_that_both_hold_one_has_the_slope(self):
        """max z under z <= a and z <= b: at a = b the value has slopes to one side only, and one of them is found."""

        def value(bound):
            return camopt.linear_program(jnp.ones(1), jnp.ones((2, 1)), bound).value

        slope = jax.grad(value)(jnp.ones(2))
        assert sorted(np.asarray(slope).tolist()) == [0.0, 1.0]
        h = 1e-3
        row = int(np.argmax(slope))
        down, up = (float(value(jnp.ones(2).at[row].add(s * h))) - 1.0 for s in (-1, 1))
        assert down == pytest.approx(-h) and up == pytest.approx(0.0, abs=1e-12)

    def test_a_direction_that_nothing_asks_for_stays_where_it_is(self):
        def z(bound):
            return camopt.linear_program(jnp.array([1.0, 0.0]), SQUARE[:1], bound).z

        slope = jax.jacrev(z)(jnp.ones(1))
        np.testing.assert_allclose(slope, [[1.0], [0.0]], atol=1e-12)


@pytest.mark.parametrize(
    ("matrix", "bound", "value"),
    [(SQUARE, [1.0, 1.0, -2.0, 1.0], -np.inf), (SQUARE[2:], [1.0, 1.0], np.inf)],
    ids=["infeasible", "unbounded"],
)
def test_without_a_maximiser_there_are_no_slopes(matrix, bound, value):
    found = camopt.linear_program(jnp.ones(2), matrix, bound)
    assert float(found.value) == value and np.isnan(found.z).all() and np.isnan(found.duals).all()
    slope = jax.grad(lambda b: camopt.linear_program(jnp.ones(2), matrix, b).value)(jnp.array(bound))
    assert np.isnan(slope).all()


def test_shapes_that_do_not_fit_are_sentences():
    with pytest.raises(InputError, match=r"expected \(m\), \(r, m\) and \(r\)"):
        camopt.linear_program(jnp.ones(3), SQUARE, jnp.ones(4))
    with pytest.raises(InputError, match="size has the shape"):
        camopt.linear_program(jnp.ones(2), SQUARE, jnp.ones(4), size=jnp.ones(3))


def test_slopes_of_the_area_by_a_limit_are_what_the_program_says_it_is_worth():
    design = load_scene("motori-1").design
    assert design is not None
    free = camopt.free_cam(design, 6.0)
    limits, (row, constant) = free.limits(design), free.area()
    jerk = limits.rows("jerk_max_mm_per_deg3")

    def area(factor):
        looser = limits.bound + limits.slope * jnp.zeros(len(limits.bound)).at[jerk].set(1.0) * (
            (factor - 1.0) * limits.size[limits.group]
        )
        return camopt.linear_program(row, limits.matrix, looser, size=np.full(len(row), 0.01)).value + constant

    value, slope = jax.value_and_grad(area)(1.0)
    worth = kinematic_optimum(design, free).sensitivities["jerk_max_mm_per_deg3"]
    assert worth > 0 and float(slope / value) == pytest.approx(worth, rel=1e-6)


def test_the_lines_of_the_page_run_as_printed(capsys):
    page = (Path(__file__).parents[2] / "docs" / "ascent.md").read_text(encoding="utf-8")
    (program,) = (p for p in re.findall(r"```python\n(.*?)```", page, re.DOTALL) if "jax.jacrev" in p)
    exec(program, {})
    assert 0.0 < float(capsys.readouterr().out.split()[0]) < 1.0
