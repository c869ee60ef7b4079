"""The train's arrays in SI units, and its rest: forces balance on every mass, contacts only push, and Newton's method
finds what the enumeration of contact sets does, in polynomial time."""

import gc
import time
from dataclasses import replace
from itertools import pairwise, product
from weakref import ref

import numpy as np
import pytest

from camopt.scene import InputError, build_train, load_scene, parse_scene, rest_position, scene_text
from camopt.scene.rest import static_matrices
from camopt.scene.train import Train, kept_with_train
from camopt.study.modes import modes

KODAMA = build_train(load_scene("kodama"))
GROUND = -1


def test_arrays_of_kodama():
    t = KODAMA
    assert (len(t.mass), len(t.a)) == (10, 12)
    assert t.mass_names[:5] == ("camshaft", "follower", "valve_tip", "valve_stem", "valve_head")
    np.testing.assert_allclose(t.mass[:6], [0.303, 0.0509, 0.0312, 0.0229, 0.037, 0.00833])
    np.testing.assert_allclose(t.mass_damping[[1, 3]], [20.5, 23.3])
    np.testing.assert_allclose(t.mass_force, [0, -19.1, 0, 0, 0, 0, 0, 0, 0, 0])
    ends = {t.element_names[e]: (t.a[e], t.b[e]) for e in range(12)}
    assert ends["bearing"] == (0, GROUND)
    assert ends["cam_follower"] == (0, 1)
    assert ends["follower_valve"] == (1, 2)
    assert ends["seat"] == (GROUND, 4)
    assert ends["coil_1"] == (2, 5)
    assert ends["coil_6"] == (9, GROUND)
    assert [t.element_names[e] for e in np.flatnonzero(t.contact)] == ["cam_follower", "follower_valve", "seat"]
    assert [t.element_names[e] for e in np.flatnonzero(t.cam_driven)] == ["cam_follower"]
    assert [t.element_names[e] for e in t.cam_side] == ["cam_follower", "follower_valve"]
    assert (t.mass_names[t.valve], t.element_names[t.seat]) == ("valve_head", "seat")
    assert t.lash == pytest.approx(0.169e-3)
    assert t.stiffness[t.seat] == 72.3e6
    assert t.damping[t.seat] == 857.0
    assert t.touch_compression[t.seat] == pytest.approx(-197.0 / 72.3e6)


def test_cam_speed_is_half_the_crankshafts():
    assert load_scene("kodama").cam_speed(6000.0) == pytest.approx(50 * 2 * np.pi)


def test_compression_by_hand():
    x = np.zeros((2, 10))
    x[:, 0], x[:, 1], x[:, 2] = 1e-3, 3e-3, 0.5e-3
    x[:, 4] = 2e-3
    d = KODAMA.compression(x, np.array([0.0, 4e-3]))
    names = KODAMA.element_names
    assert d.shape == (2, 12)
    np.testing.assert_allclose(d[:, names.index("bearing")], 1e-3)
    np.testing.assert_allclose(d[:, names.index("cam_follower")], [-2e-3, 2e-3])
    np.testing.assert_allclose(d[:, names.index("follower_valve")], 2.5e-3 - 0.169e-3)
    np.testing.assert_allclose(d[:, names.index("seat")], -2e-3)


@pytest.mark.parametrize("name", ["kodama", "kodama-hertz", "motori-1", "motori-2"])
def test_rest_is_an_equilibrium(name):
    scene = load_scene(name)
    train = build_train(scene)
    x = dict(zip(train.mass_names, rest_position(train), strict=True)) | {"ground": 0.0}
    balance = {m.name: m.force_N for m in scene.mass} | {"ground": 0.0}
    for e in scene.element:
        upper, lower = e.between
        d = x[upper] - x[lower] - 1e-3 * e.gap_mm
        force = e.stiffness_N_per_m * max(0.0, d) ** 1.5 if e.law == "hertz" else e.preload_N + e.stiffness_N_per_m * d
        if e.kind == "contact":
            force = max(0.0, force)
        balance[upper] -= force
        balance[lower] += force
    balance.pop("ground")
    # forces of some 200 N through stiffnesses of 1e8 N/m leave round-off near 1e-9 N
    assert max(abs(v) for v in balance.values()) < 1e-6


def test_rest_of_motori_by_hand():
    """Seat and spring carry the same 250 N: the valve stays where it was installed, the lash is open."""
    train = build_train(load_scene("motori-1"))
    assert rest_position(train) == pytest.approx(0.0, abs=1e-12)


def test_rest_follows_a_changed_preload():
    """With 100 N more in the seat than in the spring the valve moves until both carry the same."""
    text = scene_text("motori-1")
    head, tail = text.split('name = "seat"\nkind', 1)
    scene = parse_scene(head + 'name = "seat"\nkind' + tail.replace("preload_N = 250.0", "preload_N = 350.0"), "m")
    expected = 100.0 / (1.8e8 + 38200.0)
    assert rest_position(build_train(scene)) == pytest.approx(expected, rel=1e-9)


def test_too_many_contacts_are_refused():
    extra = "\n".join(
        f'[[element]]\nname = "stop_{i}"\nkind = "contact"\nbetween = ["valve", "ground"]\n'
        f"stiffness_N_per_m = 1e6\ngap_mm = {20 + i}.0"
        for i in range(37)
    )
    with pytest.raises(InputError, match="at most 39"):
        parse_scene(scene_text("motori-1") + "\n" + extra, "stops.toml")


def test_what_is_computed_of_a_train_is_kept_with_it_and_goes_with_it():
    computed = []

    @kept_with_train
    def masses(train: Train) -> np.ndarray:
        computed.append(train.mass)
        return train.mass.copy()

    first, second = (replace(build_train(load_scene("motori-1"))) for _ in range(2))
    assert masses(first) is masses(first) and len(computed) == 1
    assert masses(second) is not masses(first) and len(computed) == 2
    gone = ref(masses(first))
    del first
    gc.collect()
    assert gone() is None and masses(second) is not None


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
