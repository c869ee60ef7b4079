"""Gradients of a motion by the parameters of a cam family, whose pieces' borders and duration move, on both paths.

Judged by central differences of event-exact with the cam built anew by its family's own constructor at p - h and p + h.
"""

from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import camopt
from camopt.exact.adjoint.motion import TracedMotion
from camopt.scene import InputError, build_train
from camopt.scene.rest import state_at_rest
from camopt.smooth.families import differentiable
from tests.smooth.test_families import KODAMA, compiled, moved, start

RPM = 6000.0
TRAIN = build_train(KODAMA)
STEPS = {
    "duration_deg": 1e-3,
    "max_lift_mm": 1e-4,
    "ramp_height_mm": 1e-5,
    "ramp_velocity_mm_per_deg": 1e-6,
    "exponents": 1e-3,
    "sections_deg": 1e-3,
    "speed_rpm": 1.0,
}
METRICS = (
    "dynamic_area_mm_deg",
    "seating_velocity_m_per_s",
    "contact_force_max_N",
    "contact_force_min_N",
    "jump_deg",
)


def true_metrics(lift, rpm):
    return TracedMotion(TRAIN, lift, KODAMA.cam_speed(rpm), state_at_rest(TRAIN), 2).values(METRICS)


@cache
def differences(family, name, rpm):
    """Central differences (2, l) at two steps, of the first entry of a parameter."""
    now = differentiable(KODAMA, start(family)).parameters[name]
    index, value = (0, float(now[0])) if now.ndim else (None, float(now))
    rows = []
    for h in (STEPS[name], STEPS[name] / 4):
        pair = [true_metrics(moved(family, name, index, value + sign * h), rpm) for sign in (1, -1)]
        rows.append((pair[0] - pair[1]) / (2 * h))
    return np.array(rows)


def simulated(lift, parameters, method, rpm):
    motion = camopt.simulate(KODAMA, lift, rpm, method=method, step_deg=5.0, parameters=parameters)
    return jnp.stack([motion[name].data[0] for name in METRICS])


@cache
def numbers_of(family):
    """(what a motion takes of a family's cam, its Jacobian) as a function of the parameters: one compilation."""
    cam = differentiable(KODAMA, start(family))
    one = compiled(jax.jacfwd(lambda p: (cam.motion_parameters(p),) * 2, has_aux=True))
    return cam, lambda p: one(p)[::-1]


@cache
def slopes(family, method, rpm, only_lift=False):
    """Jacobian of METRICS by the family's parameters: that of the motion, chained to that of the cam."""
    cam, numbers = numbers_of(family)
    at, by_parameters = numbers(cam.parameters)
    given = ("lift",) if only_lift else ("lift", "borders", "half_duration")
    motion = jax.jacrev(lambda n: simulated(start(family), n, method, rpm))
    motion = jax.jit(motion) if method == "smooth" else motion
    by_numbers = motion({name: at[name] for name in given})

    def chained(name):
        parts = [(by_numbers[n], by_parameters[n][name], np.ndim(at[n])) for n in given]
        return sum(np.tensordot(outer, inner, rank) for outer, inner, rank in parts)

    return {name: chained(name) for name in cam.parameters}


def compare(family, method, rpm, tolerance, names=None, only_lift=False, metrics=METRICS):
    found = slopes(family, method, rpm, only_lift)
    for name in names or [n for n in found if n in STEPS]:
        slope = np.asarray(found[name])
        slope = slope[:, 0] if slope.ndim > 1 else slope
        pair = differences(family, name, rpm)
        for i, metric in enumerate(METRICS):
            if metric in metrics:
                # what differences at two steps leave open counts as their error
                spread = abs(pair[0, i] - pair[1, i]) + 1e-7 * abs(pair[:, i]).max() + 1e-9
                error = np.abs(slope[i] - pair[:, i]).min()
                assert error <= tolerance * abs(pair[1, i]) + spread, (name, metric, slope[i], pair[:, i])


@pytest.mark.parametrize(
    "family", ["polydyne", *(pytest.param(f, marks=pytest.mark.long) for f in ("multi-pol", "trapezoid"))]
)
def test_event_exact(family):
    compare(family, "event", RPM, 1e-5)


def test_event_exact_where_the_window_of_the_duration_bounds_a_metric():
    """At 2000 r/min the least force is that at the end of the duration, which moves with it."""
    compare("polydyne", "event", 2000.0, 1e-5, ("duration_deg", "ramp_height_mm", "max_lift_mm"))


def test_the_lift_alone_carries_what_its_borders_do():
    """A user who gives the pieces' coefficients and no borders: 0.58 for 5.84 by duration, 81 for 96 by ramp height."""
    compare("polydyne", "event", RPM, 1e-5, ("duration_deg", "ramp_height_mm"), True, METRICS[:2])


@pytest.mark.long
def test_the_smooth_path():
    """Its default layer leaves gradients within one percent (camopt.smooth.simulate)."""
    compare("polydyne", "smooth", 5000.0, 1e-2, ("duration_deg", "ramp_height_mm", "max_lift_mm"))


def test_values_follow_the_parameters():
    lift = start("polydyne")
    cam, numbers = numbers_of("polydyne")
    p = cam.parameters | {"duration_deg": cam.parameters["duration_deg"] + 3.0}
    truth = true_metrics(moved("polydyne", "duration_deg", None, float(p["duration_deg"])), RPM)
    np.testing.assert_allclose(simulated(lift, numbers(p)[0], "event", RPM), truth, rtol=1e-9)


@pytest.mark.parametrize("method", ["event", "smooth"])
def test_pieces_that_do_not_join_are_refused(method):
    """The coefficients of a longer cam between the borders of a shorter one are no cam."""
    lift = start("polydyne")
    cam, numbers = numbers_of("polydyne")
    longer = numbers(cam.parameters | {"duration_deg": cam.parameters["duration_deg"] + 3.0})[0]["lift"]
    with pytest.raises(InputError, match="do not join at the borders"):
        camopt.simulate(KODAMA, lift, RPM, method=method, parameters={"lift": longer})
    if method == "event":  # the smooth path's program takes long to compile
        traced = jax.jit(lambda c: simulated(lift, {"lift": c}, method, RPM))(longer)
        assert np.all(np.isnan(traced))


def test_a_ramp_without_a_foot_is_refused():
    assert KODAMA.design is not None
    scene = KODAMA.model_copy(update={"design": KODAMA.design.model_copy(update={"ramp_foot_deg": 0.0})})
    cam = differentiable(scene, camopt.polydyne(scene))
    with pytest.raises(InputError, match="ramp_foot_deg"):
        cam.motion_parameters(cam.parameters)
