"""Margins drawn apart: more area than one common margin, confirmed, and the same cam for the same seed."""

from dataclasses import replace

import numpy as np

from camopt.optimizer.accuracy import ACCURACIES
from camopt.optimizer.search.search import Logbook, find_cam
from camopt.scene import load_scene

SCENE = load_scene("kodama")
EFFORT = replace(ACCURACIES["draft"], knot_deg=12.0, margin_draws=48)


def test_margins_apart_add_confirmed_area_and_repeat():
    lines = []
    (first, _), (second, _) = (find_cam(SCENE, "nominal", EFFORT, log=Logbook(show=lines.append)) for _ in "ab")
    common = max(line["best_area_ratio"] for line in lines if line["stage"] == "margin")
    assert first.best.area_ratio > common + 1e-3
    assert first.best_judged.holds
    assert np.ptp(first.best.margins[:, 0]) > 1.0  # no longer one margin for all
    np.testing.assert_array_equal(first.best.z, second.best.z)
