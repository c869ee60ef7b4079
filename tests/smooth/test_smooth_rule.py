"""`jax.grad` through `camopt.simulate(method="smooth", parameters=...)` against central differences of event-exact."""

from dataclasses import replace
from functools import cache

import jax
import numpy as np
import pytest

import camopt
from camopt.cam.families.free import free_cam
from camopt.exact.adjoint.motion import TracedMotion
from camopt.scene import InputError, build_train, load_scene
from camopt.scene.rest import state_at_rest
from camopt.study.simulate.motion import motion_parameters

SCENE = load_scene("kodama")
CAM = camopt.polydyne(SCENE)
RPM = 5000.0
METRICS = ("seating_velocity_m_per_s", "contact_force_max_N")


def measured(parameters, speed_rpm=RPM):
    motion = camopt.simulate(SCENE, CAM, speed_rpm, method="smooth", step_deg=5.0, parameters=parameters)
    values = jax.numpy.stack([motion[name].data[0] for name in METRICS])
    return values, (values, motion["position_mm"].data)


@cache
def slopes():
    """Metrics, motion and gradients by every parameter: one compilation."""
    gradient, (values, positions) = jax.jit(jax.jacrev(measured, has_aux=True))(PARAMETERS)
    return values, positions, gradient


PARAMETERS = motion_parameters(SCENE, CAM)


def exact(name: str, values: np.ndarray) -> np.ndarray:
    """The metrics by event-exact with one parameter replaced."""
    train, lift = build_train(SCENE), CAM
    if name == "lift":
        lift = replace(CAM, coefficients=values)
    else:
        train = replace(train, **{name: values})
    return TracedMotion(train, lift, SCENE.cam_speed(RPM), state_at_rest(train), 2).values(METRICS)


@pytest.mark.long
def test_values_are_those_of_event_exact():
    values, positions, _ = slopes()
    truth = camopt.simulate(SCENE, CAM, RPM, step_deg=5.0)
    np.testing.assert_allclose(positions, truth["position_mm"], atol=1e-5)  # layers of 2e-9 m
    np.testing.assert_allclose(values, exact("gap", PARAMETERS["gap"]), rtol=1e-3)


@pytest.mark.parametrize("name", ["mass", "stiffness", "damping", "preload", "gap", "lift"])
def test_gradients_are_those_of_event_exact(name):
    """Along a random change of all numbers of a kind, in proportion to each; a lift is scaled."""
    value, gradient = PARAMETERS[name], slopes()[2][name]
    share = np.random.default_rng(7).uniform(-1.0, 1.0, value.shape)
    share = 1.0 if name == "lift" else share
    differences = []
    for step in (1e-5, 1e-6):
        pair = [exact(name, value * (1 + sign * step * share)) for sign in (1.0, -1.0)]
        differences.append((pair[0] - pair[1]) / (2 * step))
    found = np.tensordot(gradient, value * share, value.ndim)
    error = np.min(np.abs(found - np.array(differences)), axis=0) / np.abs(differences[0])
    assert np.all(error < 1e-2), (found, differences)


def test_pieces_of_a_free_cam_are_affine_in_its_coefficients():
    from camopt.smooth.simulate import lift_samples, samples_of_pieces

    cam = free_cam(SCENE.design, 12.0)
    z = np.random.default_rng(1).normal(size=cam.Z.shape[1]) * 1e-3
    matrix, offset = cam.piece_basis()
    lift = cam.lift(z)
    np.testing.assert_allclose(matrix @ z + offset, lift.coefficients, rtol=1e-9, atol=1e-15)
    found = samples_of_pieces(lift.borders, jax.numpy.asarray(lift.coefficients))
    np.testing.assert_allclose(found, lift_samples(lift), atol=1e-14)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"parameters": {"lash": 0.0}}, "'lash': expected one of mass"),
        ({"parameters": {"gap": np.zeros(3)}}, r"\(3,\): \(12,\) is needed"),
        ({"parameters": {}, "method": "rkg"}, "'rkg' with parameters"),
    ],
)
def test_unusable_parameters(options, says):
    with pytest.raises(InputError, match=says):
        camopt.simulate(SCENE, CAM, RPM, **({"method": "smooth"} | options))


@pytest.mark.long
def test_a_traced_speed_of_a_stiff_train():
    """At the highest mode of this train a revolution takes 9000 steps, more than are offered to a soft one."""
    scene = load_scene("motori-1")
    light = scene.mass[0].model_copy(update={"mass_kg": scene.mass[0].mass_kg / 60})
    scene = scene.model_copy(update={"mass": (light,)})
    lift, gap = camopt.exponent(scene), np.array(build_train(scene).gap)

    def area(speed):
        motion = camopt.simulate(scene, lift, speed, method="smooth", step_deg=5.0, parameters={"gap": gap})
        return motion["dynamic_area_mm_deg"].data[0]

    def exact_area(speed):
        train = build_train(scene)
        return TracedMotion(train, lift, scene.cam_speed(speed), state_at_rest(train), 2).values(
            ["dynamic_area_mm_deg"]
        )[0]

    value, slope = jax.jit(jax.value_and_grad(area))(5000.0)
    assert float(value) == pytest.approx(exact_area(5000.0), rel=1e-6)
    difference = (exact_area(5001.0) - exact_area(4999.0)) / 2
    assert float(slope) == pytest.approx(difference, rel=1e-2)  # what the smooth path's layer leaves
