"""Gradients over initial gaps, zero among them, and over random scenes: no NaN, and no zero that nobody announced."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from camopt.cam.families.kurz import kurz
from camopt.scene import build_train, load_scene
from camopt.scene.units import RPM
from camopt.smooth.metrics import revolution_metrics
from camopt.smooth.rest import rest_state
from camopt.smooth.simulate import EPS, lift_samples, response_arrays, touch_layer
from camopt.smooth.system import build_system

SCENE = load_scene("motori-1")
TRAIN, LIFT = build_train(SCENE), kurz(SCENE)
SAMPLES = jnp.asarray(lift_samples(LIFT))
CAM_SIDE = TRAIN.cam_side[0]
GAPS = np.array([0.0, 1e-9, -1e-9, 1e-6, 5e-5, 1e-4, 3e-4])
NUMBERS = ("mass", "stiffness", "damping", "preload")
METRICS = ("dynamic_area_mm_deg", "contact_force_max_N", "seating_velocity_m_per_s", "bounce_mm", "jump_mm")


def metrics(system, speed):
    motion = response_arrays(system, SAMPLES, speed, rest_state(TRAIN, system), steps=4096)
    found = revolution_metrics(system, motion, speed, LIFT.half_duration, LIFT.opening_foot, layer=touch_layer(EPS))
    return jnp.stack([found[name] for name in METRICS])


many = jax.jit(jax.vmap(lambda system, speed: (metrics(system, speed), jax.jacrev(metrics)(system, speed))))


def random_scenes(count: int, seed: int):
    """Every mass, stiffness, damping and preload within a factor of about two, the gaps of the grid in turn."""
    rng = np.random.default_rng(seed)
    one = build_system(TRAIN)
    system = jax.tree.map(lambda q: jnp.repeat(q[None], count, 0), one)
    values = [getattr(system, n) * np.exp(rng.normal(0.0, 0.3, getattr(system, n).shape)) for n in NUMBERS]
    gap = system.gap.at[:, CAM_SIDE].set(np.resize(GAPS, count))
    system = eqx.tree_at(lambda s: [*(getattr(s, n) for n in NUMBERS), s.gap], system, [*values, gap])
    return system, jnp.asarray(rng.uniform(1000.0, 2500.0, count) * RPM)


@pytest.mark.parametrize("count", [8, pytest.param(1000, marks=pytest.mark.long)])
def test_gradients_are_finite_and_not_silently_zero(count):
    system, speeds = random_scenes(count, 11)
    values, gradient = many(system, speeds)
    assert np.all(np.isfinite(values))
    for name in (*NUMBERS, "gap"):
        assert np.all(np.isfinite(getattr(gradient, name))), name
    by_gap = np.asarray(gradient.gap[:, :, CAM_SIDE])
    area, force, seating, bounce, jump = range(len(METRICS))
    assert np.all(by_gap[:, area] < 0.0)  # more lash, less valve lift
    assert np.all(by_gap[:, force] != 0.0) and np.all(np.any(gradient.stiffness[:, force] != 0.0, axis=-1))
    moves = np.asarray(values) > 0.0
    for metric in (seating, bounce, jump):  # zero only with the value, and a valve that touches has a speed
        assert np.all((by_gap[:, metric] != 0.0) == moves[:, metric]), METRICS[metric]
    assert np.mean(moves[:, seating]) > 0.8
