"""A linear program as a function that JAX can differentiate, solved by HiGHS on the host.

The largest value v = c z under A z <= b has dv = dc z + y (db - dA z) with the duals y (the envelope theorem; Gal 1995,
Postoptimal Analyses, Parametric Programming and Related Topics). At a vertex the rows B of the basis are active. As
long as the basis does not change, dz = B^-1 (db_B - dB z) and dy_B = B^-T (dc - dB^T y_B).
"""

from functools import lru_cache
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

import camopt.smooth  # noqa: F401  (64-bit floats)
from camopt.highs import Infeasible, Unbounded
from camopt.optimizer.program.linear_program import ADDED_PER_ROUND, Rows, maximise
from camopt.scene.errors import InputError

MOST_MODELS = 8
"""Number of programs that are kept with their last basis, of which one with thousands of rows takes megabytes."""


class LinearOptimum(NamedTuple):
    """The maximiser z (m) of a linear program, its value, and the duals (r) >= 0 of its rows."""

    z: jax.Array
    value: jax.Array
    duals: jax.Array


def linear_program(
    objective: ArrayLike, matrix: ArrayLike, bound: ArrayLike, *, size: ArrayLike | None = None
) -> LinearOptimum:
    """The z (m), free in sign, with the largest objective (m) @ z under matrix (r, m) @ z <= bound (r), in JAX.

    `size` (m) are typical magnitudes of z, for the solver's scaling (1 by default). The function works under `jax.jit`,
    `jax.vmap` and `jax.grad` (once, in reverse mode) with respect to all three arguments. A program whose matrix was
    solved before starts from its last basis.

    The derivatives are those of the solution's vertex, with its basis fixed. They are the true ones if the vertex is
    not degenerate. If more than m rows are active, the derivative of the value holds to one side only, and z may move
    in another direction on the other side. If a dual of the basis is zero, the maximiser is not unique. The derivative
    is zero along a direction that the rows leave free and on which the objective does not depend.

    An infeasible program has the value -inf, an unbounded one inf; z, duals and derivatives are NaN then. Everything is
    NaN where the solver fails. Raises InputError for arguments whose shapes do not fit.
    """
    cost, left, right = (jnp.asarray(argument, dtype=float) for argument in (objective, matrix, bound))
    columns = jnp.ones(cost.shape) if size is None else jnp.asarray(size, dtype=float)
    shapes = cost.shape, left.shape, right.shape
    if len(left.shape) != 2 or cost.shape != left.shape[1:] or right.shape != left.shape[:1] or not right.size:
        raise InputError(f"linear_program: shapes {shapes}: expected (m), (r, m) and (r), with one row at least")
    if columns.shape != cost.shape:
        raise InputError(f"linear_program: size has the shape {columns.shape}, expected that of the objective")
    return LinearOptimum(*_program(cost, left, right, columns))


@jax.custom_vjp
def _program(cost, matrix, bound, size):
    return _solved(cost, matrix, bound, size)[:3]


def _solved(cost, matrix, bound, size) -> tuple[jax.Array, ...]:
    """Maximiser (m), value, duals (r), the basis' rows (m), and the derivative (m, m) of z by their bounds."""
    r, m = matrix.shape
    shapes = [jax.ShapeDtypeStruct(shape, float) for shape in ((m,), (), (r,))]
    shapes += [jax.ShapeDtypeStruct((m,), np.int32), jax.ShapeDtypeStruct((m, m), float)]
    return jax.pure_callback(_solve, tuple(shapes), cost, matrix, bound, size, vmap_method="sequential")


def _forward(cost, matrix, bound, size):
    z, value, duals, basis, inverse = _solved(cost, matrix, bound, size)
    return (z, value, duals), (z, duals, basis, inverse, size)


def _backward(residuals, bars):
    z, duals, basis, inverse, size = residuals
    z_bar, value_bar, duals_bar = bars
    by_bound = jnp.zeros_like(duals).at[basis].add(inverse.T @ z_bar) + value_bar * duals
    by_cost = inverse @ duals_bar[basis] + value_bar * z
    by_matrix = -jnp.outer(by_bound, z) - jnp.outer(duals, inverse @ duals_bar[basis])
    return by_cost, by_matrix, by_bound, jnp.zeros_like(size)


_program.defvjp(_forward, _backward)


def _solve(cost: Any, matrix: Any, bound: Any, size: Any) -> tuple[np.ndarray, ...]:
    """The solution on the host, called back from `_solved`."""
    cost, matrix, bound, size = (np.asarray(argument, dtype=float) for argument in (cost, matrix, bound, size))
    rows = _rows(matrix.tobytes(), size.tobytes())
    try:
        optimum = maximise(cost, rows, bound, np.arange(0, len(bound), max(1, len(bound) // ADDED_PER_ROUND)))
    except (Infeasible, ArithmeticError) as none:  # there is no maximiser
        value = {Infeasible: -np.inf, Unbounded: np.inf}.get(type(none), np.nan)
        z, duals, inverse = (np.full(shape, np.nan) for shape in (len(size), len(bound), (len(size), len(size))))
        return z, np.array(value), duals, np.zeros(len(size), dtype=np.int32), inverse
    basis = rows.model.basis()
    inverse = np.zeros((len(size), len(size)))
    inverse[:, : len(basis)] = np.linalg.pinv(rows.scaled[basis]) * size[:, None] / rows.norm[basis]
    padded = np.zeros(len(size), dtype=np.int32)  # the row numbers beyond the basis do not matter: their columns are 0
    padded[: len(basis)] = basis
    return optimum.z, np.array(optimum.value), optimum.duals, padded, inverse


@lru_cache(maxsize=MOST_MODELS)
def _rows(matrix: bytes, size: bytes) -> Rows:
    """The rows of a matrix; the same object, with its solver, for a matrix that was solved recently."""
    column = np.frombuffer(size)
    return Rows(np.frombuffer(matrix).reshape(-1, len(column)), column)
