"""diffrax's solvers and adjoints on the same motion as the scan, with either ramp."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from camopt.scene import InputError
from camopt.scene.units import RPM
from camopt.smooth.adaptive import adaptive_states
from camopt.smooth.contact import Layer
from camopt.smooth.rest import rest_state
from camopt.smooth.scan import DrivenSystem
from camopt.smooth.simulate import compiled_response, equal_grid, lift_samples
from camopt.smooth.system import build_system
from tests.smooth.trains import motori

SCENE, TRAIN, LIFT = motori()
SYSTEM, SAMPLES = build_system(TRAIN), jnp.asarray(lift_samples(LIFT))
SPEED, EPS, TOLERANCE = 2000 * RPM, 1e-6, 1e-10
ANGLE = jnp.asarray(equal_grid(90))


def end(scale, solver: str, adjoint: str, ramp: str = "compact"):
    """Valve position at 60 deg [m] under a lift scaled by `scale`."""
    driven = DrivenSystem(SYSTEM, SAMPLES * scale, SPEED)
    motion = adaptive_states(
        driven, rest_state(TRAIN), ANGLE, Layer(EPS, ramp), TOLERANCE, solver=solver, adjoint=adjoint
    )
    return motion.x[60, 0]


def scanned(ramp: str) -> float:
    driven = DrivenSystem(SYSTEM, SAMPLES, SPEED)
    motion = compiled_response(driven, rest_state(TRAIN), Layer(EPS, ramp), TOLERANCE)
    angle, first = np.unique(motion.angle, return_index=True)
    return float(CubicHermiteSpline(angle, motion.x[first, 0], motion.v[first, 0] / SPEED)(np.pi / 3))


@pytest.mark.long
def test_reverse_and_forward_mode_agree_across_solvers():
    value, forward = jax.jit(
        lambda s: jax.jvp(lambda q: end(q, "dopri8", "forward"), (s,), (jnp.ones_like(s),))
    )(jnp.asarray(1.0))  # fmt: skip
    reverse = jax.jit(jax.grad(lambda s: end(s, "tsit5", "reverse")))(jnp.asarray(1.0))
    assert float(value) == pytest.approx(scanned("compact"), abs=1e-8)
    assert float(forward) == pytest.approx(float(reverse), rel=1e-4)
    assert float(forward) == pytest.approx(float(value) + TRAIN.gap[TRAIN.cam_side[0]], rel=0.01)  # it follows the cam


@pytest.mark.long
@pytest.mark.parametrize("solver", ["tsit5", "dopri8", "kvaerno5"])
@pytest.mark.parametrize("ramp", ["compact", "softplus"])
def test_every_solver_meets_the_scan_with_either_ramp(solver, ramp):
    assert float(end(jnp.asarray(1.0), solver, "reverse", ramp)) == pytest.approx(scanned(ramp), abs=1e-7)


def test_unknown_solvers_and_adjoints_are_named():
    with pytest.raises(InputError, match="'euler'"):
        end(jnp.asarray(1.0), "euler", "reverse")
    with pytest.raises(InputError, match="'backward'"):
        end(jnp.asarray(1.0), "tsit5", "backward")
