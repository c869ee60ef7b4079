"""Where the gradient stage ends, what path "auto" is, and the steps of Adam."""

from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import optax
import pytest

from camopt.optimizer.search import gradient_stage as module
from camopt.optimizer.search import margins
from camopt.optimizer.search.gradient_stage import LEAST_TRUST_N, free_stage
from camopt.optimizer.search.margins import FIRST_STEP_N, Adam, margin_stage
from camopt.optimizer.search.no_jump_stage import RESOLUTION
from camopt.optimizer.search.sensitivity import path_of


@pytest.fixture
def search(monkeypatch):
    """A search whose judge refuses every cam; the linear model promises `search.promise` at each step."""
    found = SimpleNamespace(best=SimpleNamespace(z=np.zeros(2), area_ratio=0.5, margins=np.zeros((3, 2))), judged=0)
    found.best_judged = object()

    def consider(*_, **__):
        found.judged += 1
        return object()

    model = SimpleNamespace(corrected=lambda *_: model)
    found.consider = consider
    monkeypatch.setattr(module, "linearised", lambda *_: model)
    monkeypatch.setattr(module, "step", lambda *_: SimpleNamespace(z=np.zeros(2), area_ratio=0.5 + found.promise))
    monkeypatch.setattr(margins, "loss_slope", lambda *_: np.full((3, 2), -found.promise / (6 * FIRST_STEP_N)))
    return found


def test_free_steps_end_where_the_model_promises_less_than_the_search_resolves(search):
    search.promise = 0.9 * RESOLUTION
    ended = free_stage(search, None, None, 9)
    assert ended == "after 0 of 9 free steps, where the model promised 4.5e-05 of area ratio"
    assert search.judged == 0
    search.promise = 1.1 * RESOLUTION
    words = free_stage(search, None, None, 9)
    assert words == f"after {search.judged} of 9 free steps, as its trust region vanished"
    assert 40.0 * 0.4**search.judged < LEAST_TRUST_N < 40.0 * 0.4 ** (search.judged - 1)


def test_steps_on_the_margins_end_where_all_that_are_left_promise_less(search):
    program = SimpleNamespace(solve=lambda margins: SimpleNamespace())
    search.promise = 0.2 * RESOLUTION
    assert margin_stage(search, program, None, 4).startswith("after 0 of 4 steps on the margins")
    assert search.judged == 0
    search.promise = 1.1 * RESOLUTION  # halved after each refused cam
    assert margin_stage(search, program, None, 4).startswith("after 2 of 4 steps on the margins")
    assert search.judged == 2


def test_adam_takes_the_steps_of_optax():
    slopes = np.random.default_rng(0).normal(size=(6, 3, 4))
    ours, theirs = Adam(FIRST_STEP_N), optax.adam(FIRST_STEP_N, b1=0.5, b2=0.9)
    state = theirs.init(jnp.zeros((3, 4)))
    for slope in slopes:
        update, state = theirs.update(jnp.asarray(slope), state)
        np.testing.assert_allclose(ours(slope), update, rtol=1e-5)  # optax may count in single precision


def test_auto_is_the_exact_path():
    assert [path_of(word) for word in ("auto", "smooth", "exact", "none")] == ["exact", "smooth", "exact", "none"]
