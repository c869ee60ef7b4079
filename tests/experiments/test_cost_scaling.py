"""The cost experiment at its small size: what it counts is there, and what it compares is the same train."""

import numpy as np
import pytest

from camopt.cam.families.polydyne import polydyne
from camopt.scene import build_train, load_scene, rest_position
from camopt.study.modes import modes
from experiments import cost_scaling


def test_a_finer_spring_is_the_same_spring():
    """Mass, rate and rest stay; the first surge is that of twenty masses between fixed ends."""
    scene = load_scene("kodama")
    finer = cost_scaling.with_coils(scene, 20)
    assert len(finer.mass) == 25
    assert sum(m.mass_kg for m in finer.mass) == pytest.approx(sum(m.mass_kg for m in scene.mass))
    assert rest_position(build_train(finer))[2] == pytest.approx(rest_position(build_train(scene))[2], rel=1e-9)
    rate, mass = 152000.0 / 6, 5 * 0.00833
    chain = np.sqrt(rate * 21 / (mass / 20)) * np.sin(np.pi / 42) / np.pi  # both ends held
    assert modes(finer).frequency_Hz[0] == pytest.approx(chain, rel=1e-3)  # the train at its end is not quite still


def test_contacts_that_never_close_are_added_between_coils():
    scene = cost_scaling.with_clashes(load_scene("kodama"), 8)
    assert sum(e.kind == "contact" for e in scene.element) == 11
    motori = cost_scaling.with_clashes(load_scene("motori-1"), 1)
    assert motori.element[-1].between == ("valve", "ground")


def test_the_exponent_is_a_slope():
    assert cost_scaling.exponent([(n, 0.1 * n**1.5) for n in (1, 10, 20, 40)]) == pytest.approx(1.5)


@pytest.mark.long
def test_small_size(tmp_path):
    content = cost_scaling.main("small", tmp_path)
    assert (tmp_path / "cost_scaling.json").exists()
    assert [r["masses"] for r in content["masses"]] == [15, *range(10, 0, -1)]
    one = content["one_against_ten"]
    for path in ("rkg", "tmm", "smooth", "batch"):
        assert one[path]["time"] < 0.25  # issue: at most a quarter in compiled fixed-step and batched paths
    for scene in content["never_closing"]:
        for row in scene["more_time"].values():
            assert row["left_out"]["same_digits"]
        assert all(scene["more_time"][path]["kept"]["same_digits"] for path in ("rkg", "tmm"))


def test_never_closing_leaves_every_digit():
    """Fixed-step methods do the same arithmetic on what acts; event-exact, left out, is the scene without it."""
    scene = load_scene("motori-1")
    rows = cost_scaling.never_closing(scene, polydyne(scene), repeats=1)["more_time"]
    assert all(row["left_out"]["same_digits"] for row in rows.values())
    assert rows["rkg"]["kept"]["same_digits"]
    assert rows["tmm"]["kept"]["same_digits"]
    assert rows["event"]["kept_largest_change_mm"] < 1e-9
