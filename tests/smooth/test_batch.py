"""Motions side by side: what each gives alone, one compilation per shape of scene, gradients with the right slope."""

import dataclasses
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from camopt.scene.units import RPM
from camopt.smooth.laws import Layer
from camopt.smooth.metrics import revolution_metrics
from camopt.smooth.rest import rest_state
from camopt.smooth.scan import DrivenSystem
from camopt.smooth.simulate import compiled_response, lift_samples
from camopt.smooth.system import build_system
from experiments.support.smooth_batch import batch_motion, stage_lifts
from tests.smooth.trains import motori

SCENE, TRAIN, LIFT = motori()
SYSTEM = build_system(TRAIN)
STEPS, EPS = 1440, 1e-5
SPEEDS = np.array([1500.0, 2000.0, 2500.0]) * RPM
STAGES = np.repeat(stage_lifts(LIFT, STEPS)[..., None], 3, -1)
SCALED = stage_lifts(LIFT, STEPS)[..., None]
METRICS = ("seating_velocity_m_per_s", "dynamic_area_mm_deg", "contact_force_max_N")


@jax.jit
def batch(system, height, speeds, eps):
    motions = batch_motion(system, STAGES + SCALED * height[None, None, None], speeds, rest_state(TRAIN), eps)
    shape = LIFT.half_duration, LIFT.opening_foot
    found = jax.vmap(lambda one, at: revolution_metrics(system, one, at, *shape, layer=Layer(eps).half_width))(
        motions, speeds
    )
    return jnp.stack([found[name] for name in METRICS])


@pytest.mark.long
def test_each_of_a_batch_is_what_it_is_alone():
    system, samples, y0 = build_system(TRAIN), jnp.asarray(lift_samples(LIFT)), rest_state(TRAIN)
    many = jax.jit(batch_motion)(system, jnp.asarray(STAGES), jnp.asarray(SPEEDS), y0, EPS)
    alone = [
        compiled_response(DrivenSystem(system, samples, s), y0, Layer(EPS), steps=STEPS, refine=False) for s in SPEEDS
    ]
    for i, one in enumerate(alone):
        # the single scan reads the lift from cubics between samples: 1e-10 m
        np.testing.assert_allclose(many.x[i], one.x, atol=1e-8)
        np.testing.assert_allclose(many.force[i], one.force, atol=5.0)
    assert np.max(np.abs(many.x[0] - many.x[2])) > 1e-6


def test_one_compilation_serves_all_numbers_of_a_shape():
    batch.clear_cache()
    for stiffness, height, speed in ((1.0, 0.0, 1.0), (1.1, 1e-6, 0.9), (0.7, -2e-6, 1.2)):
        train = dataclasses.replace(TRAIN, stiffness=TRAIN.stiffness * stiffness)
        batch(build_system(train), jnp.full(3, height), jnp.asarray(SPEEDS * speed), EPS)
    assert batch._cache_size() == 1


@cache
def value_and_slope() -> tuple[np.ndarray, np.ndarray]:
    """The metrics (q, b) and their slopes by the scale of the lift, in forward mode."""
    program = jax.jit(lambda h: jax.jvp(lambda q: batch(SYSTEM, q, SPEEDS, EPS), (h,), (jnp.ones(3),)))
    value, slope = program(jnp.zeros(3))
    return np.asarray(value), np.asarray(slope)


@pytest.mark.parametrize("metric", METRICS)
def test_the_taylor_remainder_falls_with_the_square_of_the_step(metric):
    """|f(h) - f(0) - h f'| falls as h^2: a sign flip, a factor of two or a zero leaves it at h."""
    row = METRICS.index(metric)
    f0, slope = (q[row] for q in value_and_slope())
    steps = np.array([4e-4, 2e-4, 1e-4])
    change = np.array([np.asarray(batch(SYSTEM, jnp.full(3, h), SPEEDS, EPS)[row]) - f0 for h in steps])
    remainder = np.abs(change - steps[:, None] * slope)
    rate = np.log2(remainder[:-1] / remainder[1:]).mean(axis=0)
    assert np.all(slope != 0.0)
    assert np.all((rate > 1.7) | (remainder[-1] < 1e-4 * np.abs(change[-1])))  # or linear but for rounding


@pytest.mark.parametrize("dtype", [jnp.float32, pytest.param(jnp.float64, marks=pytest.mark.long)])
def test_precision_is_that_of_the_stages(dtype):
    system = build_system(TRAIN, dtype)
    motion = jax.jit(batch_motion)(
        system, jnp.asarray(STAGES, dtype), jnp.asarray(SPEEDS, dtype), rest_state(TRAIN).astype(dtype), EPS
    )
    assert motion.x.dtype == dtype and motion.force.dtype == dtype
    exact = jax.jit(batch_motion)(build_system(TRAIN), STAGES, SPEEDS, rest_state(TRAIN), EPS)
    assert np.max(np.abs(motion.x - exact.x)) < (5e-6 if dtype == jnp.float32 else 1e-12)
