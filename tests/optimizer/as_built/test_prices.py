"""What tolerances cost: the sign of every price, its noise, and that a price is what the search itself gains."""

import json
from functools import partial

import numpy as np
import pytest

from camopt.cli.parser import main
from camopt.optimizer.as_built import prices, search
from camopt.optimizer.as_built.prices import _level, _summary, price_list
from camopt.scene import InputError, load_scene, parse_scene
from camopt.scene.as_built import GRINDING, scatter_labels, with_scatter
from camopt.scene.text_file import scene_toml
from camopt.study import yields
from tests.scene.test_load import EXAMPLE

SCATTER = """
[[tolerance]]
of = "spring.preload_N"
relative = 0.05
[[tolerance]]
name = "mass"
of = "*.mass_kg"
relative = 0.02
[grinding]
error_um = 2.0
harmonics = [2, 40]
"""
SCENE = parse_scene(EXAMPLE + SCATTER, "mine.toml")


def test_a_narrower_tolerance_never_costs_area(monkeypatch):
    """One train of ten may be lost; coarse knots leave the signs what they are."""
    monkeypatch.setattr(search, "KNOT_DEG", 6.0)
    listed = price_list(SCENE, 0.9, trains=10)
    assert set(listed.left_out) == set(listed.halved) == {"spring.preload_N", "mass", GRINDING}
    for label, gained in listed.left_out.items():
        assert gained > -2 * listed.noise and listed.halved[label] > -2 * listed.noise
    assert max(listed.left_out.values()) > 0.0
    assert set(listed.worth) == {"spring.preload_N", "mass"}  # the grinding error has no number of the scene
    assert listed.worth["spring.preload_N"] > 0.0 > listed.worth["mass"]  # a heavier train needs a smaller cam
    assert "left out" in str(listed) and f"{listed.noise:.4f}" in str(listed)
    json.dumps(listed.as_dict(), allow_nan=False)
    assert listed.plot().axes


def test_noise_is_pooled_over_the_list():
    """Two sets whose prices differ by 0.02 and 0.0: their mean has a variance of 0.02**2 / 4 and of zero."""
    areas = {("as given", ""): [0.5, 0.5], ("left out", "a"): [0.51, 0.53], ("halved", "a"): [0.51, 0.51]}
    listed = _summary(0.9, {name: np.array(area) for name, area in areas.items()})
    assert listed.left_out["a"] == pytest.approx(0.02) and listed.halved["a"] == pytest.approx(0.01)
    assert listed.noise == pytest.approx(0.02 / 2 / np.sqrt(2)) and listed.worth_noise == 0.0


def test_the_level_gives_the_area_at_hand():
    assert _level(lambda level: 0.1 * level, 0.12) == pytest.approx(1.2, abs=0.01)
    assert _level(lambda level: 0.1 * level, 0.9) == _level(lambda level: 0.1 * level, None) == prices.FIRST_LEVEL


@pytest.mark.parametrize("label", ["mass", GRINDING])
def test_scatter_that_is_left_out_is_gone_and_the_rest_stays(label):
    without = with_scatter(SCENE, {label: 0.0})
    assert scatter_labels(without) == [one for one in scatter_labels(SCENE) if one != label]
    half = with_scatter(SCENE, {label: 0.5})
    assert scatter_labels(half) == scatter_labels(SCENE) and half != SCENE


def test_no_prices_without_scatter_or_with_curved_laws():
    with pytest.raises(InputError, match="needs \\[\\[tolerance\\]\\]"):
        price_list(parse_scene(EXAMPLE, "mine.toml"), 0.9)
    with pytest.raises(InputError, match="curved laws"):
        price_list(load_scene("finger-hydraulic"), 0.9)


def test_the_command_prints_and_draws_the_price_of_a_single_tolerance(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(yields, "price_list", partial(price_list, trains=3, sets=1))
    scene, out = tmp_path / "mine.toml", tmp_path / "out"
    scene.write_text(scene_toml(with_scatter(SCENE, {"mass": 0.0, GRINDING: 0.0})))
    drawn = ["--cam", "polydyne", "--trains", "3", "--speeds", "2000", "--quiet", "--out", str(out)]
    assert main(["yield", str(scene), *drawn, "--price", "--json", str(tmp_path / "yield.json")]) == 0
    printed = capsys.readouterr().out
    assert "1 % more of its numbers" in printed and "spring.preload_N" in printed
    summary = json.loads((out / "yield.json").read_text())
    assert summary == json.loads((tmp_path / "yield.json").read_text()) and summary["speeds_rpm"] == [2000]
    assert set(summary["prices"]["halved"]) == set(summary["prices"]["left_out"]) == {"spring.preload_N"}
    assert (out / "figures" / "prices.svg").is_file()
