"""The batch of the experiments on equal steps, which tests of tied motions take for their reference."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from camopt.scene.units import RPM
from camopt.smooth.laws import Layer
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
