"""The near-limit campaign: scenes load and repeat, the truth is the settled motion, the table counts what it says."""

import json

import numpy as np
import pytest

from camopt.cam.families.free import free_cam
from camopt.optimizer.program.kinematic import kinematic_optimum
from camopt.scene import build_train
from experiments import near_limit
from experiments.near_limit import OUTCOMES, SMALL, outcome, scene_of, table
from experiments.support.near_limit_cams import AROUND, band
from experiments.support.near_limit_scenes import KINDS, LIGHT, drawn_scene
from experiments.support.near_limit_truth import from_rest, truth


def surge_damping(scene):
    """Smallest damping ratio of the coils alone, held at both ends."""
    train = build_train(scene)
    coils = [i for i, name in enumerate(train.mass_names) if name.startswith("coil")]
    n = len(train.mass)
    stiffness, damping = np.zeros((n, n)), np.zeros((n, n))
    for e in np.flatnonzero([name.startswith("spring") for name in train.element_names]):
        row = np.zeros(n)
        for end, sign in ((train.a[e], 1.0), (train.b[e], -1.0)):
            if end >= 0:
                row[end] = sign
        stiffness += train.stiffness[e] * np.outer(row, row)
        damping += train.damping[e] * np.outer(row, row)
    m = train.mass[coils]
    k, c = (part[np.ix_(coils, coils)] / m[:, None] for part in (stiffness, damping))
    system = np.block([[np.zeros_like(k), np.eye(len(m))], [-k, -c]])
    roots = np.linalg.eigvals(system)
    return float(np.min(-roots.real / np.abs(roots)))


def test_ten_scenes_of_the_kinds_that_were_asked_for():
    scenes = [drawn_scene(number) for number in range(10)]
    assert len({scene.name for scene in scenes}) == len(KINDS) == 10
    assert scenes[3] == drawn_scene(3)
    for scene, kind in zip(scenes, KINDS, strict=True):
        low, high = scene.operation.band_rpm
        assert 200 <= high - low + 1 and high - low <= 300
        if kind.get("ratio") == LIGHT:
            assert surge_damping(scene) == pytest.approx(LIGHT, rel=1e-3)
        assert (scene.design.closing_ramp_height_mm is not None) == kind.get("ramps", False)


def test_a_continued_motion_is_the_one_from_rest():
    scene = scene_of(4, 20.0)
    lift = kinematic_optimum(scene.design, free_cam(scene.design, 4.0)).lift
    continued, rest = truth(scene, lift, band(scene)), from_rest(scene, lift, band(scene)[[3, 15]])
    # settled to 0.01 um by plain revolutions, whose slowest motion loses 5 % a revolution
    assert continued.figures[[3, 15]] == pytest.approx(rest.figures, abs=5e-4)
    assert np.ptp(continued.figures[:, 2]) > 0


def test_small_campaign(tmp_path, monkeypatch):
    content = near_limit.main("small", tmp_path)
    counts = content["table"]
    assert counts["cams"] == SMALL["cams"] == sum(counts[name] for name in OUTCOMES)
    assert counts["confirmed-BAD"] == 0
    assert all(AROUND[0] <= row["truth"]["share"] <= AROUND[1] for row in content["rows"])
    assert json.loads((tmp_path / "near_limit.json").read_text())["table"] == counts
    cams = (tmp_path / "near_limit-cams.jsonl").read_text()
    with monkeypatch.context() as patch:
        patch.setattr(near_limit, "verdict_of", None)
        assert near_limit.main("small", tmp_path)["rows"] == content["rows"]  # of its stores, seconds included
    assert (tmp_path / "near_limit-cams.jsonl").read_text() == cams


def row(verdict, warm, cold):
    return {"verdict": verdict, "truth": {"share": warm}, "cold": {"share": cold}, "rest": {"share": 0.6}}


def test_outcomes():
    rows = [
        row("confirmed", 0.9, 0.8),
        row("confirmed", 0.9, 1.1),
        row("rejected", 1.2, 0.5),
        row("rejected", 0.7, 0.7),
        row("sensitive", 0.99, 0.9),
        row("not converged", 3.0, 0.9),
    ]
    assert [outcome(r) for r in rows] == list(OUTCOMES)
    counts = table(rows)
    assert counts["good"] == 3 and counts["good ones refused"] == 2 and counts["good among the undecided"] == 1
    assert counts["bad from rest only"] == 1
