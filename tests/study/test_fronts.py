"""Area against a limit, stored as it is found; spring and cam together."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from camopt.optimizer.accuracy import ACCURACIES
from camopt.scene import InputError, load_scene
from camopt.study import fronts as module
from camopt.study.fronts import joint_spring, pareto

KODAMA = load_scene("kodama")


@pytest.fixture(autouse=True)
def coarse(monkeypatch):
    monkeypatch.setitem(ACCURACIES, "draft", replace(ACCURACIES["draft"], knot_deg=8.0, program_speeds=2))


def test_a_looser_jerk_limit_never_costs_area_and_points_are_kept(tmp_path, monkeypatch):
    out = tmp_path / "front.json"
    asked = {"against": "jerk_max_mm_per_deg3", "values": (0.002, 0.004), "speeds": "nominal", "out": out}
    front = pareto(KODAMA, **asked)
    area = front.table["area_ratio"].values
    assert 0.3 < area[0] < area[1] < 0.6
    assert len(out.read_text().splitlines()) == 1 + 2
    monkeypatch.setattr(module, "find_cam", None)  # everything is stored: nothing is searched again
    assert np.array_equal(pareto(KODAMA, **asked).table["area_ratio"].values, area)
    with pytest.raises(InputError, match="belongs to other work"):
        pareto(KODAMA, **(asked | {"speeds": "band"}))
    labels = {front.against: "jerk max [mm/deg³]", "jump_max_deg": "jump max [deg]", "yield": "yield [-]"}
    assert {key: replace(front, against=key).plot().axes[0].get_xlabel() for key in labels} == labels
    assert "area_ratio" in front._repr_html_()


def test_an_unknown_limit_is_named():
    with pytest.raises(InputError, match="'bounce'"):
        pareto(KODAMA, "bounce")


def test_more_preload_within_limits_carries_more_area():
    found = joint_spring(KODAMA, rate=(1.0, 1.0), preload=(0.95, 1.05), speeds="nominal", evaluations=8)
    assert found.area_ratio > found.area_ratio_as_given + 1e-4
    assert 1.0 < found.preload <= 1.05 and found.rate == 1.0
    seat = next(e for e in found.scene.element if e.name == KODAMA.seat)
    assert seat.preload_N == pytest.approx(197.0 * found.preload)


def test_area_against_yield_never_rises_with_the_share(tmp_path, monkeypatch):
    areas, asked = {0.99: 0.45, 0.9: 0.44, 0.5: 0.5}, []  # the search found less at 0.9 than what holds at 0.99 already

    def searched(scene, wanted, effort, **more):
        asked.append(wanted)
        cam = SimpleNamespace(area_ratio=areas[wanted])
        return SimpleNamespace(held=[cam], trains_drawn=100, steps=3)

    monkeypatch.setattr("camopt.optimizer.as_built.search.yield_search", searched)
    front = pareto(KODAMA, "yield", (0.5, 0.9, 0.99), out=tmp_path / "front.json")
    assert asked == [0.99, 0.9, 0.5]
    assert front.table["area_ratio"].values.tolist() == [0.45, 0.45, 0.5]
    assert front.table["limit"].values.tolist() == asked
    with pytest.raises(InputError, match=r"a share from 0\.5"):
        pareto(KODAMA, "yield", (1.0,))
