"""The search for the best Polydyne at its small size."""

import json

from experiments import best_polydyne


def test_small_search_keeps_the_acceleration_limits(tmp_path):
    best_polydyne.main("small", tmp_path)
    found = json.loads((tmp_path / "best_polydyne.json").read_text())
    assert found["provenance"]["command"] == "python -m experiments.best_polydyne small"
    least = found["least_bounce"]
    assert 0 < least["area_ratio"] < 0.618 and least["bounce_mm"] >= 0
    largest = found["largest_area_within_limit"]
    assert largest is None or (largest["bounce_mm"] <= 0.05 and largest["area_ratio"] >= 0.5)


def test_a_member_over_the_acceleration_limit_is_barred():
    scene = best_polydyne.load_scene("kodama")
    assert best_polydyne.figures(scene, (2, 10, 18, 26, 34), 7000.0)["barred"]  # 0.0153 mm/deg2, just over
    assert not best_polydyne.figures(scene, (2, 4, 26, 30, 36), 5000.0)["barred"]
