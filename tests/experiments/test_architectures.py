"""Ten architectures: the draw covers what it says, and the small size ends in a verdict or a sentence."""

import json

from experiments import architectures
from experiments.architectures import ARCHITECTURES, DEFECT, drawn


def test_draws_are_ordinary_trains_of_two_to_fourteen_masses_and_repeat():
    scenes = [drawn(i) for i in range(40)]
    assert drawn(3) == scenes[3]
    assert {s.name.rsplit("-", 1)[0] for s in scenes} == set(ARCHITECTURES)
    counts = {len(s.mass) for s in scenes}
    assert min(counts) == 2 and max(counts) == 14 and len(counts) > 8
    rods = [e for s in scenes if s.name.startswith("pushrod-elastic") for e in s.element if e.name == "rod_foot_rocker"]
    assert len(rods) == 10 and {e.kind for e in rods} == {"spring"}
    assert 0 < sum(s.design.closing_ramp_velocity_mm_per_deg is not None for s in scenes) < 30


def test_the_job_ends_in_a_verdict_or_a_sentence(tmp_path, monkeypatch):
    light = drawn(8)  # a bucket train of two masses: seconds
    monkeypatch.setattr(architectures, "drawn", lambda _: light)
    monkeypatch.setattr("camopt.optimizer.baselines.comparison.SECTIONED", ())
    content = architectures.main("small", tmp_path)
    (row,) = content["rows"]
    assert row["ends"] != DEFECT
    assert row["ends"] == "confirmed" or len(row["sentence"]) > 20
    assert json.loads((tmp_path / "architectures.json").read_text())["provenance"]["command"].endswith("small")


def test_a_crash_is_a_defect_and_a_refusal_is_none(tmp_path, monkeypatch):
    def singular(*_, **__):
        raise ArithmeticError("Singular matrix")

    monkeypatch.setattr(architectures, "optimize", singular)
    row = architectures.job(drawn(0), tmp_path / "run")
    assert (row["ends"], row["sentence"]) == (DEFECT, "ArithmeticError: Singular matrix")
