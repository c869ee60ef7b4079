"""The train's arrays in SI units, and its rest: forces balance on every mass, contacts only push."""

import numpy as np
import pytest

from camopt.scene import InputError, build_train, load_scene, parse_scene, rest_position, scene_text

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
