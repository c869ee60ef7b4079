"""Rest on the base circle: Newton's method finds what the enumeration of contact sets does, in polynomial time."""

import time
from dataclasses import replace
from itertools import pairwise, product

import numpy as np
import pytest

from camopt.scene import InputError, build_train, load_scene, parse_scene, rest_position, scene_text
from camopt.scene.rest import static_matrices
from camopt.study.modes import modes

NAMES = ("kodama", "motori-1", "motori-2", "pushrod-5mass")
TRAINS = {name: build_train(load_scene(name)) for name in NAMES}


def enumerated(train):
    """Rest by trying every set of closed contacts; None where a set that holds every mass is in no equilibrium."""
    contacts = np.flatnonzero(train.contact)
    for states in product([True, False], repeat=len(contacts)):
        closed = ~train.contact
        closed[contacts] = states
        stiffness, load = static_matrices(train, closed)
        scale = np.sqrt(np.maximum(np.diag(stiffness), train.stiffness.max() * 1e-12))
        scaled = stiffness / np.outer(scale, scale)
        if np.linalg.eigvalsh(scaled)[0] < 1e-11:
            continue
        x = np.linalg.solve(scaled, load / scale) / scale
        force = train.preload + train.stiffness * train.compression(x, 0.0)
        slack = 1e-9 * max(np.abs(force).max(), 1.0)
        if np.all(force[closed & train.contact] > slack) and np.all(force[~closed] <= slack):
            return x
    return None


def drawn(name, seed):
    """A built-in train with its preloads, gaps, stiffnesses and forces drawn anew, contacts among them that open."""
    rng, train = np.random.default_rng(seed), TRAINS[name]
    n, e = len(train.mass), len(train.a)
    return replace(
        train,
        stiffness=train.stiffness * 10.0 ** rng.uniform(-2, 2, e),
        preload=train.preload * rng.uniform(0.0, 2.0, e) + rng.choice([0.0, 50.0], e) * rng.uniform(-1, 1, e),
        gap=train.gap + rng.choice([0.0, 1e-3], e) * rng.uniform(-1, 1, e),
        mass_force=train.mass_force + rng.choice([0.0, 100.0], n) * rng.uniform(-1, 1, n),
    )


@pytest.mark.parametrize("name", NAMES)
def test_rest_is_the_one_that_enumeration_finds(name):
    found = refused = 0
    for seed in range(60):
        train = drawn(name, seed)
        expected = enumerated(train)
        if expected is None:
            refused += 1
            with pytest.raises(InputError, match="nothing holds"):
                rest_position(train)
            continue
        found += 1
        x = rest_position(train)
        # the same linear system is solved in both, so only its rounding differs
        np.testing.assert_allclose(x, expected, rtol=1e-7, atol=1e-9 * np.abs(expected).max())
    assert found >= 20, (found, refused)


def stack(masses, contacts):
    """`motori-1` with a long chain of coils on its valve, every so many of them stopped by a contact of its own."""
    chain = ["valve", *(f"coil_{i}" for i in range(masses)), "ground"]
    parts = [f'[[mass]]\nname = "{name}"\nmass_kg = 0.01' for name in chain[1:-1]]

    def element(name, kind, ends, rest):
        parts.append(f'[[element]]\nname = "{name}"\nkind = "{kind}"\nbetween = ["{ends[0]}", "{ends[1]}"]\n{rest}')

    for i, ends in enumerate(pairwise(chain)):
        element(f"wire_{i}", "spring", ends, "stiffness_N_per_m = 1e6")
    for k in range(contacts):
        ends = f"coil_{k * masses // contacts}", "ground"
        element(f"stop_{k}", "contact", ends, f"stiffness_N_per_m = 1e7\ngap_mm = {0.1 * k + 0.1}")
    return parse_scene("\n".join([scene_text("motori-1"), *parts]), "stack.toml")


def test_many_contacts_are_no_matter_of_hours():
    """150 masses with 15 contacts: over all sets of contacts 32 768 eigenvalue problems of that size."""
    begin = time.process_time()
    scene = stack(150, 11)
    assert len(scene.mass) == 151 and np.sum(build_train(scene).contact) == 15
    found = modes(scene)
    assert len(found.frequency_Hz) > 100
    assert time.process_time() - begin < 20  # a second or two; the enumeration took more than a thousand times that


def test_a_mass_that_floats_is_named():
    text = scene_text("kodama").replace("force_N = -19.1", "force_N = 0.0")
    with pytest.raises(InputError, match=r"mass: follower\)"):
        parse_scene(text, "floating.toml")
