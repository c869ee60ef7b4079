"""Margins drawn apart: more area than one common margin, confirmed, and the same cam for the same seed."""

from dataclasses import replace

import numpy as np

from camopt.optimize.accuracy import ACCURACIES
from camopt.optimize.search import find_cam
from camopt.scene import load_scene

SCENE = load_scene("kodama")
EFFORT = replace(ACCURACIES["draft"], knot_deg=12.0, margin_draws=24)


def test_margins_apart_add_confirmed_area_and_repeat():
    stages = []
    first, second = (find_cam(SCENE, "nominal", EFFORT, show=lambda line: stages.append(line["stage"])) for _ in "ab")
    common, _ = find_cam(SCENE, "nominal", replace(EFFORT, margin_draws=0))
    best = first[0].best
    assert "margins apart" in stages
    assert best.area_ratio > common.best.area_ratio + 1e-3
    assert first[0].best_judged.holds
    assert np.ptp(best.margins[:, 0]) > 1.0  # no longer one margin for all
    np.testing.assert_array_equal(best.z, second[0].best.z)
