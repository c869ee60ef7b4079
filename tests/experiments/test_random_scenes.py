"""Random scenes: the draw covers what it says, and the small size finds nothing wrong."""

import json

import numpy as np

from camopt.scene import build_train
from camopt.study.extremes.step_methods import STEP_METHODS
from camopt.verifier.convergence import first_steps
from experiments import random_scenes
from experiments.support.drawn_scenes import LARGEST, SPEED_RPM, chain, drawn


def test_draws_load_reach_far_and_repeat():
    scenes = [drawn(np.random.default_rng([7, i])) for i in range(60)]
    again = drawn(np.random.default_rng([7, 3]))
    assert again[0] == scenes[3][0] and again[1] == scenes[3][1]
    assert all(SPEED_RPM[0] <= speed <= SPEED_RPM[1] for _, speed in scenes)
    assert all(first_steps(build_train(s), s.cam_speed(speed)) <= LARGEST for s, speed in scenes)
    rng = np.random.default_rng(0)
    assert {len(chain(rng)["mass"]) for _ in range(40)} == {1, 2, 3, 4, 5, 6}
    assert len({s.name for s, _ in scenes if s.name.endswith("-moved")}) == 4
    stiffness = [e.stiffness_N_per_m for s, _ in scenes for e in s.element]
    assert max(stiffness) > 1e9 and any(e.damping_N_s_per_m == 0 for s, _ in scenes for e in s.element)
    ratios = [max(m.mass_kg for m in s.mass) / min(m.mass_kg for m in s.mass) for s, _ in scenes]
    assert max(ratios) > 1e2


def test_nothing_is_wrong_without_a_warning(tmp_path):
    content = random_scenes.main("small", tmp_path)
    for kind, least in ((content, len(STEP_METHODS)), (content["real"], 1)):
        assert kind["wrong_without_warning"] == []
        counted = sum(sum(by_verdict.values()) for by_verdict in kind["methods"].values())
        assert counted == kind["scenes"] >= least
        assert kind["decided_by_dop853"]["within tolerance"] == 1
    assert json.loads((tmp_path / "random_scenes.json").read_text())["provenance"]["command"].endswith("small")
