"""Rest from a system's numbers alone: that of the NumPy side for every scene, any contact set, with its derivative."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from camopt.scene import build_train, load_scene, rest_position
from camopt.smooth.rest import rest_of, rest_positions
from camopt.smooth.system import build_system
from tests.smooth.trains import ball


@pytest.mark.parametrize(
    "name",
    ["kodama-hertz", "motori-1", *(pytest.param(n, marks=pytest.mark.long) for n in ("kodama", "pushrod-5mass"))],
)
def test_rest_is_that_of_the_scene(name):
    train = build_train(load_scene(name))
    expected = rest_position(train)
    np.testing.assert_allclose(rest_positions(build_system(train)), expected, rtol=1e-9, atol=1e-15)


@pytest.mark.long
def test_rest_over_gaps_changes_its_contacts_and_stays_finite():
    """Lash from -0.1 to 0.1 mm, zero among them: where it is negative the valve hangs on the cam's side."""
    train = build_train(load_scene("kodama"))
    system, tip = build_system(train), train.cam_side[1]
    gaps = jnp.asarray([-1e-4, -1e-6, -1e-9, 0.0, 1e-9, 1e-6, 1e-4])

    def rest(gap):
        return rest_positions(eqx.tree_at(lambda s: s.gap, system, system.gap.at[tip].set(gap)))

    found, slope = jax.jit(jax.vmap(lambda g: jax.jvp(rest, (g,), (jnp.ones_like(g),))))(gaps)
    assert np.all(np.isfinite(found)) and np.all(np.isfinite(slope))
    for i, gap in enumerate(np.asarray(gaps)):
        values = train.gap.copy()
        values[tip] = gap
        expected = rest_position(dataclasses.replace(train, gap=values))
        np.testing.assert_allclose(found[i], expected, rtol=1e-6, atol=1e-12)
    assert np.abs(slope[0]).max() > 0.1 and np.abs(slope[-1]).max() == 0.0  # pressed on, and free


def test_the_derivative_is_that_of_central_differences():
    train = build_train(load_scene("kodama"))
    slope = jax.jacrev(rest_positions)(build_system(train))
    for name, i in (("stiffness", 3), ("stiffness", 6), ("preload", 7), ("mass_force", 1)):
        pair, step = [], 1e-6 * getattr(train, name)[i]
        for sign in (1.0, -1.0):
            values = getattr(train, name).copy()
            values[i] += sign * step
            pair.append(rest_position(dataclasses.replace(train, **{name: values})))
        expected = (pair[0] - pair[1]) / (2 * step)
        found = np.asarray(getattr(slope, name))[:, i]
        np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-4 * np.abs(expected).max())


def test_a_mass_that_nothing_holds_has_no_rest():
    train = dataclasses.replace(ball(0.05, 3e4, 0.0), mass_force=np.array([1.0]))  # pulled off its ground
    assert np.all(np.isnan(rest_of(build_system(train))[0]))
