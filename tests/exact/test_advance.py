"""Any instant within a span against the matrix exponential, with a memory and two forces by the cam angle."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from camopt.exact.kernel.advance import advance, carry_back
from camopt.exact.kernel.arrays import train_arrays
from camopt.exact.kernel.building import fill, linear_system, per_step
from camopt.exact.kernel.propagators import Propagators
from tests.exact.interpreted import interpret
from tests.exact.small_trains import friction, one_mass, spring
from tests.exact.test_inputs import FORCES

STEP = 4e-3
"""Seconds, in which the mode of the stuck friction, of 317 rad/s, turns by 1.3 rad."""


@pytest.fixture(autouse=True)
def _by_python(monkeypatch):
    interpret(monkeypatch, __name__, "camopt.exact.")


@pytest.mark.parametrize("stiff", [(friction(1.0e5, 10.0),), (spring(1.0e5),)], ids=["memory", "none"])
@pytest.mark.parametrize("length", [0.013, 0.031, 0.4, 1.0, 1.73])
def test_an_instant_is_the_exponential_of_the_equations_of_motion(length, stiff):
    train = replace(one_mass(spring(400.0), *stiff), forcing=tuple(replace(force, on=0) for force in FORCES))
    tables, arrays = Propagators(train, STEP, 3, 2).tables, train_arrays(train)
    fill(arrays, STEP, tables, 0, np.zeros(2, dtype=int))
    sizes = tables.sizes
    system = per_step(linear_system(arrays, np.zeros(2, dtype=int)), STEP, sizes)
    y = np.random.default_rng(0).normal(size=len(system) - 1)
    assert sizes.forces == 2 and len(y) == sizes.state + 3 + 2 * 2
    exponential = expm(length * system)[: sizes.state]
    wanted = exponential @ np.append(y, 1.0)
    inputs, rates = tables.motion.shape[1:]
    bar, back = y[: sizes.state].copy(), np.empty(len(y))
    carry_back(tables, 0, STEP, length, bar, back, (np.empty(len(y)), np.empty(len(y)), np.empty(inputs - 1)))
    np.testing.assert_allclose(back, bar @ exponential[:, :-1], rtol=1e-11, atol=1e-12)
    advance(tables, 0, STEP, len(y), length, y, (np.empty(len(y)), np.empty(inputs - 1), np.empty(rates)))
    np.testing.assert_allclose(y[: sizes.state], wanted, rtol=1e-11, atol=1e-12)
