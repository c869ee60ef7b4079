"""The batch of the experiments on equal steps, which tests of tied motions take for their reference."""

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

STEPS, EPS = 1440, 1e-5
SPEEDS = np.array([1500.0, 2000.0, 2500.0]) * RPM


@pytest.mark.parametrize("dtype", [jnp.float32, pytest.param(jnp.float64, marks=pytest.mark.long)])
def test_each_of_a_batch_is_what_it_is_alone(dtype):
    _, train, lift = motori()
    stages = jnp.asarray(np.repeat(stage_lifts(lift, STEPS)[..., None], 3, -1), dtype)
    system, y0 = build_system(train, dtype), rest_state(train)
    many = jax.jit(batch_motion)(system, stages, jnp.asarray(SPEEDS, dtype), y0.astype(dtype), EPS)
    assert many.x.dtype == dtype and many.force.dtype == dtype
    system, samples = build_system(train), jnp.asarray(lift_samples(lift))
    for i, speed in enumerate(SPEEDS):
        driven = DrivenSystem(system, samples, speed)
        alone = compiled_response(driven, y0, Layer(EPS), steps=STEPS, refine=False)
        # the single scan reads the lift from cubics between samples: 1e-10 m
        np.testing.assert_allclose(many.x[i], alone.x, atol=5e-6 if dtype == jnp.float32 else 1e-8)
        if dtype == jnp.float64:
            np.testing.assert_allclose(many.force[i], alone.force, atol=5.0)
    assert np.max(np.abs(many.x[0] - many.x[2])) > 1e-6


def test_the_taylor_remainder_falls_with_the_square_of_the_step():
    """The lift grows in height, and each step is half the one before."""
    _, train, lift = motori()
    system, y0, layer = build_system(train), rest_state(train), Layer(EPS)
    samples, speed = jnp.asarray(lift_samples(lift)), SPEEDS[1]
    names = "seating_velocity_m_per_s", "dynamic_area_mm_deg", "contact_force_max_N"

    def values(h):
        driven = DrivenSystem(system, (1 + h) * samples, speed)
        motion = compiled_response(driven, y0, layer, steps=STEPS, refine=False)
        event = lift.half_duration, lift.opening_foot
        found = revolution_metrics(system, motion, speed, *event, layer=layer.half_width)
        return jnp.stack([found[name] for name in names])

    (start, slope), steps = jax.jvp(values, (0.0,), (1.0,)), np.array([4e-4, 2e-4, 1e-4])
    change = np.array([values(h) - start for h in steps])
    rest = np.abs(change - np.outer(steps, slope))
    rate = np.log2(rest[:-1] / rest[1:]).mean(axis=0)
    assert np.all(slope != 0) and np.all(rate > 1.7)
