"""Comparison of undamped copies with Siconos; tests that run it are skipped where no Python has it."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import camopt
from camopt.scene import build_train, builtin_scenes, load_scene
from camopt.scene.rest import state_at_rest
from camopt.verifier.from_outside import SAMPLES
from experiments.support import siconos_judge, undamped
from experiments.support.outside_changes import CHANGES
from tests.verifier.test_independence import imported

needs_siconos = pytest.mark.skipif(undamped.siconos_python() is None, reason=undamped.NO_SICONOS)
COPIES = {scene.name: scene for scene in map(undamped.undamped, map(load_scene, builtin_scenes())) if scene}
SEATED = {name: scene for name, scene in COPIES.items() if scene.seat}


def test_the_judge_imports_nothing_of_camopt():
    names = {name.split(".")[0] for name in imported(Path(siconos_judge.__file__))}
    assert names <= {"numpy", *sys.stdlib_module_names}


def test_copies_have_linear_laws_and_no_damper_in_a_contact():
    assert {"kodama", "motori-1", "motori-2", "exhaust-gas", "pushrod-5mass"} <= set(COPIES)
    assert not {"kodama-hertz", "race-nested", "finger-hydraulic", "pushrod-hydraulic"} & set(COPIES)
    for name, copy in COPIES.items():
        for own, other in zip(load_scene(name).element, copy.element, strict=True):
            kept = 0.0 if own.kind == "contact" else own.damping_N_s_per_m
            assert other == own.model_copy(update={"damping_N_s_per_m": kept})


@pytest.mark.parametrize("name", SEATED)
def test_it_begins_at_rest_as_camopt_does_and_reads_the_same_lift(name, tmp_path):
    cam = camopt.polydyne(load_scene("kodama"))
    scene = SEATED[name].model_copy(update={"design": load_scene("kodama").design})
    found = undamped.siconos_input(scene, cam, tmp_path)
    rest = found["rest"]
    np.testing.assert_allclose(rest, state_at_rest(build_train(scene))[: len(rest)], rtol=0, atol=1e-12)
    angle = np.linspace(-np.pi, np.pi, 3601)[:-1]
    np.testing.assert_allclose(siconos_judge.lift_of(found["cam"], angle), cam(angle), rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    ("name", "element"), [("kodama", "cam_follower"), ("kodama-hertz", "cam_follower"), ("finger-hydraulic", "roller")]
)
def test_what_it_cannot_express_is_refused_with_a_sentence(name, element, tmp_path):
    scene = load_scene(name)
    with pytest.raises(ValueError, match=f"Siconos cannot express {element}: it is given linear springs, and contacts"):
        undamped.siconos_input(scene, camopt.polydyne(scene), tmp_path)


def test_where_no_python_has_siconos_one_sentence_names_the_package(monkeypatch, capsys):
    """Every Python that is tried fails to import it."""
    undamped.siconos_python.cache_clear()
    monkeypatch.setattr(undamped.subprocess, "run", lambda *a, **k: subprocess.CompletedProcess(a, 1))
    scene = load_scene("kodama")
    case = (scene, "polydyne", camopt.polydyne(scene), [5000.0])
    found = undamped.undamped_part([case], case)
    undamped.siconos_python.cache_clear()
    assert (found["undamped"], found["undamped_changes"]) == ([], [])
    assert found["undamped_skipped"] == undamped.NO_SICONOS == capsys.readouterr().out.strip()
    assert "python3-siconos" in undamped.NO_SICONOS and "\n" not in undamped.NO_SICONOS
    assert found["summary"]["undamped"] == 0 and found["summary"]["undamped_within_nm"] is None


def test_what_is_stated_is_a_nanometre_and_the_most_of_two_halvings():
    """Three records that differ by 2 nm and 0.5 nm; the last is wrong by 0.25 nm, but by 4 nm outside the duration."""
    true = np.zeros(SAMPLES + 1)
    far = np.zeros(SAMPLES + 1)
    far[-1] = 4e-9
    records = [
        {"steps": n, "seconds": 0.0, "valve_m": list(v)} for n, v in ((720, true + 2.75e-9), (1440, true + 7.5e-10))
    ]
    records.append({"steps": 2880, "seconds": 0.0, "valve_m": list(true + 2.5e-10)})
    row = undamped.apart({"speed_rpm": 1.0, "turn_s": 0.0288, "halvings": records}, true + far, 1.0)
    assert row["difference_nm"] == pytest.approx(3.75) and row["event_nm"] == pytest.approx(0.25)
    assert row["stated_nm"] == pytest.approx(3.0) and not row["agrees"]
    assert row["step_us"] == pytest.approx(10.0)
    assert [h["difference_nm"] for h in row["halvings"]] == pytest.approx([2.75, 3.25, 3.75])


@needs_siconos
def test_siconos_agrees_and_a_halved_step_is_four_times_as_near():
    """kodama without dampers in its contacts, its Polydyne at 5000 r/min: the rule has order two."""
    scene = load_scene("kodama")
    case = (scene, "polydyne", camopt.polydyne(scene), [5000.0])
    (row,) = undamped.undamped_part([case], None, 2 * siconos_judge.COARSEST)["undamped"]
    coarse, fine = (h["difference_nm"] for h in row["halvings"])
    assert row["agrees"] and fine < 3.0
    assert coarse / fine == pytest.approx(4.0, rel=0.1)


@needs_siconos
def test_siconos_notices_a_micrometre_of_lash(monkeypatch):
    monkeypatch.setattr(
        undamped, "CHANGES", [c for c in CHANGES if c.name in ("lash 1 um more", "seat damping 1 % more")]
    )
    scene = COPIES["motori-1"]
    python = undamped.siconos_python()
    assert python is not None
    (row,) = undamped.noticed(python, scene, "polydyne", camopt.polydyne(scene), [5000.0], 57_600)
    assert row["change"] == "lash 1 um more" and row["noticed"]
