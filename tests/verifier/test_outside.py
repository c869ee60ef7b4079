"""The judge from outside: it shares no code with camopt, its laws are the scene's, and its motion is camopt's.

Exudyn is an extra: what needs it is skipped where it is missing.
"""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import camopt
from camopt.cam.design_file import write_design
from camopt.cam.families.exponent import exponent
from camopt.measure.metrics import measure
from camopt.scene import InputError, build_train, builtin_scenes, load_scene
from camopt.scene.response import end_state, joined
from camopt.scene.rest import state_at_rest
from camopt.scene.text_file import scene_toml
from camopt.scene.units import MM
from camopt.verifier import from_outside as side
from camopt.verifier.outside import filed, forces
from camopt.verifier.record import VerificationRecord, outside_entries, outside_entry, outside_sentence
from camopt.verifier.verdict import event_exact
from tests.verifier.scenes import REAL, with_elements
from tests.verifier.test_independence import imported

FOLDER = Path(filed.__file__).parent
SEATED = tuple(name for name in builtin_scenes() if load_scene(name).seat)
needs_exudyn = pytest.mark.skipif(side.find_spec("exudyn") is None, reason="the extra `outside` is not installed")


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.py")), ids=lambda p: p.name)
def test_the_judge_imports_nothing_of_camopt_but_itself(path):
    names = {name for name in imported(path) if name.split(".")[0] == "camopt"}
    assert all(name.startswith("camopt.verifier.outside.") for name in names)
    assert not {
        n for n in imported(path) if n.split(".")[0] not in {"camopt", "exudyn", "numpy", *sys.stdlib_module_names}
    }


def test_a_fresh_process_of_the_judge_loads_nothing_of_camopt_but_its_packages():
    """Everything but the engine itself, so that the test runs where Exudyn is missing."""
    asked = "import camopt.verifier.outside.forces, sys; print(*[m for m in sys.modules if m.startswith('camopt')])"
    ended = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, check=True)
    packages = {"camopt", "camopt.verifier"}
    assert set(ended.stdout.split()) == packages | {
        f"camopt.verifier.outside{part}" for part in ("", ".filed", ".forces")
    }


def written(scene, folder: Path) -> filed.FiledTrain:
    (folder / "scene.toml").write_text(scene_toml(scene), encoding="utf-8")
    return filed.read_train(folder / "scene.toml")


@pytest.mark.parametrize("name", SEATED)
def test_laws_touches_and_rest_are_those_of_the_scene(name, tmp_path):
    """Written twice from the same words: forces within round-off of the largest, rest within a picometre."""
    scene = load_scene(name)
    own, train = written(scene, tmp_path), build_train(scene)
    by_name = {e.name: e for e in own.elements}
    assert set(by_name) == set(train.element_names)
    d = np.linspace(-2 * MM, 6 * MM, 401)
    for i, e in enumerate(by_name[n] for n in train.element_names):
        if e.has_memory:
            continue
        if train.laws is None:
            expected = train.preload[i] + train.stiffness[i] * d
        else:
            expected = train.laws.along(i, d, train.preload[i])[0]
        np.testing.assert_allclose(forces.elastic(e, d, np.where), expected, rtol=1e-12, atol=1e-9)
        assert forces.touch(e) == pytest.approx(train.touch_compression[i], rel=1e-9, abs=1e-15)
    np.testing.assert_allclose(forces.at_rest(own), state_at_rest(train)[: len(train.mass)], rtol=0, atol=1e-12)


def test_oil_pushes_beyond_its_travel_and_friction_holds_up_to_its_slip():
    oil = filed.FiledElement("o", "oil", 0, -1, False, stiffness=1e6, travel=1e-3)
    friction = filed.FiledElement("f", "friction", 0, -1, False, stiffness=1e6, slip=1500.0)
    d = np.array([-2e-3, 0.0, 1e-3, 3e-3])
    np.testing.assert_allclose(forces.elastic(oil, d, np.where), [0.0, 0.0, 0.0, 2000.0], atol=1e-9)
    np.testing.assert_allclose(forces.elastic(friction, d, np.where), [-1500.0, 0.0, 1000.0, 1500.0], atol=1e-9)


def test_rest_is_found_where_a_full_step_of_newton_would_go_to_and_fro():
    """A spring that is stiff for two millimetres and soft on either side, where it begins."""
    rows = ((-1.0, -102.0), (0.499, -100.0), (0.501, 100.0), (2.0, 102.0))
    spring = filed.FiledElement("s", "table", 0, -1, False, rows=rows)
    x = forces.at_rest(filed.FiledTrain((1.0,), (0.0,), (0.0,), (spring,), (), 0, spring, 0.5))
    assert x == pytest.approx([0.5], abs=1e-9)


@needs_exudyn
def test_a_valve_closes_nominally_where_the_lift_falls_to_what_has_leaked_since_the_opening_foot():
    from camopt.verifier.outside.figures import _closing

    cam = filed.FiledCam(np.array([-np.pi, -1.0, 1.0]), np.array([[0.0], [1.0], [0.0]]), 2.0)
    angle = np.linspace(-np.pi, 3 * np.pi, 4001)
    leaked = 0.1 * np.clip(angle + 1.0, 0.0, 2.0)  # 0.2 m: the lift falls to that at 0.8 rad, 0.7 m above the seat
    record = np.stack([angle, 1.5 - np.abs(angle), 1.0 - np.abs(angle), leaked])
    assert _closing(cam, 0.0, record, 1.0)[0] == pytest.approx(700.0, abs=1.0)


def test_the_lift_is_that_of_the_cam(tmp_path):
    scene = load_scene("motori-1")
    cam = camopt.polydyne(scene)
    write_design(tmp_path / "design.json", cam, 1.0)
    own, angle = filed.read_cam(tmp_path / "design.json"), np.linspace(-np.pi, np.pi, 3601)[:-1]
    height, slope = forces.lift(own, angle, np.where)
    np.testing.assert_allclose(height, cam(angle), rtol=0, atol=1e-15)
    np.testing.assert_allclose(slope, cam(angle, 1), rtol=0, atol=1e-13)


def test_three_laws_of_a_contact_differ_where_its_damper_is_stronger_than_its_spring():
    contact = filed.FiledElement("c", "linear", 0, -1, True, stiffness=1e6, damping=100.0, preload=0.0)
    d, rate = np.array([1e-5, 1e-5, -1e-5]), np.array([-0.2, 0.2, 0.2])  # spring 10 N, damper 20 N
    found = {law: forces.force(contact, d, rate, np.where, law).tolist() for law in forces.LAWS_OF_CONTACT}
    assert found == {
        forces.NEVER_PULLS: pytest.approx([0.0, 30.0, 0.0]),
        forces.MAY_PULL: pytest.approx([-10.0, 30.0, 0.0]),
        forces.DAMPING_UP_TO_SPRING: pytest.approx([0.0, 20.0, 0.0]),
    }


def test_what_the_judge_cannot_express_is_refused_with_a_sentence(tmp_path):
    text = scene_toml(load_scene("motori-1")).replace('kind = "contact"', 'kind = "contact"\nmagic = 1', 1)
    (tmp_path / "scene.toml").write_text(text, encoding="utf-8")
    with pytest.raises(filed.OutsideRefused, match="element train: the judge from outside cannot express magic"):
        filed.read_train(tmp_path / "scene.toml")
    (tmp_path / "design.json").write_text("{}", encoding="utf-8")
    with pytest.raises(filed.OutsideRefused, match="no pieces of a lift"):
        filed.read_cam(tmp_path / "design.json")


def test_without_exudyn_one_sentence_says_what_to_install(monkeypatch):
    monkeypatch.setattr(side, "find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"needs Exudyn, which is not installed: pip install 'camopt\[outside\]'"):
        side.require_outside()


@needs_exudyn
def test_a_judge_without_an_answer_is_not_waited_for(monkeypatch):
    monkeypatch.setattr(side, "TIMEOUT_S", 0.01)
    scene = load_scene("motori-1")
    with pytest.raises(InputError, match=r"has no answer after 0.01 s: ask for fewer speeds"):
        side.outside_motions(scene, camopt.polydyne(scene), [5000.0])


@needs_exudyn
@pytest.mark.parametrize(
    ("scene", "family", "speed_rpm"),
    [
        (load_scene("motori-1"), camopt.polydyne, 5000.0),
        (load_scene("kodama"), camopt.polydyne, 5000.0),  # constant force, damping to ground
        (REAL, exponent, 3000.0),  # oil, friction, a force by the cam angle
    ],
)
def test_exudyn_agrees_from_rest_within_a_nanometre(scene, family, speed_rpm):
    """Every jump stays below 0.05 mm: both revolutions count."""
    (found,) = side.from_outside(scene, family(scene), [speed_rpm])
    assert found["agrees"] and found["revolutions"] == side.REVOLUTIONS
    assert found["difference_nm"] < side.AGREES_NM


@needs_exudyn
def test_figures_are_read_alike():
    """motori-1 is thrown at 6000 r/min: its bounce is what is left at the nominal closing, which lies between steps."""
    scene, speed_rpm = load_scene("motori-1"), 6000.0
    cam = side.as_written(camopt.polydyne(scene))
    theirs = side.outside_motions(scene, cam, [speed_rpm])["speeds"][0]["figures"][0]
    revolve = event_exact(build_train(scene), cam, scene.cam_speed(speed_rpm), 2880)
    first = revolve(state_at_rest(build_train(scene)))
    ours = measure(joined([first, revolve(end_state(first))]), cam)
    assert ours["bounce_mm"][0] > 0.05 and ours["jump_mm"][0] > 0.05
    for name, value in theirs.items():
        assert value == pytest.approx(ours[name][0], abs=1e-4 if name.endswith("_mm") else 0.0, rel=1e-3), name


@needs_exudyn
def test_exudyn_notices_a_seat_damping_that_is_one_per_cent_off():
    """Which settled figures miss: the judge gets the scene, camopt's motion the changed one."""
    scene = load_scene("motori-1")
    cam = side.as_written(camopt.polydyne(scene))
    damping = next(e.damping_N_s_per_m for e in scene.element if e.name == "seat")
    found = side.outside_motions(scene, cam, [5000.0])
    valve = side.valve_from_rest(with_elements(scene, seat={"damping_N_s_per_m": 1.01 * damping}), cam, 5000.0)
    noticed = side.compared(found["engine"], found["speeds"][0], *valve)
    assert not noticed["agrees"]
    assert "disagrees at 5000 r/min" in outside_sentence([noticed])


def said(difference_nm: float) -> dict:
    return outside_entry(5000.0, "Exudyn 1", 2, difference_nm, 1.1)


def test_the_sentence_states_the_largest_difference():
    assert outside_sentence([said(0.25), said(0.5)]) == (
        "Exudyn 1 agrees within 0.5 nm at 2 speeds, by the valve's motion from rest."
    )
    assert outside_sentence([]) == ""


def test_agreement_decides_nothing_and_disagreement_undoes_a_verdict():
    speeds = [{"speed_rpm": 5000.0}, {"speed_rpm": 6000.0}]
    record = VerificationRecord(verdict="rejected", reason="why", speeds=speeds)
    agreed = record.with_outside([said(0.5)])
    assert (agreed["verdict"], agreed["reason"]) == ("rejected", "why")
    assert [set(entry) for entry in agreed["speeds"]] == [{"speed_rpm", "outside"}, {"speed_rpm"}]
    apart = record.with_outside([said(1.2)])
    assert apart["verdict"] == "not converged"
    assert apart["reason"].startswith("Exudyn 1 disagrees at 5000 r/min")
    assert record.with_outside([]) == record
    assert agreed.outside == [said(0.5)] and record.outside == []


def test_an_outside_json_from_anywhere_is_read_or_refused():
    assert outside_entries(json.dumps([said(0.5) | {"agrees": "whatever"}])) == [said(0.5)]
    for wrong in ("{}", "[1]", '[{"speed_rpm": 1}]', json.dumps([said(0.5) | {"difference_nm": "1"}])):
        with pytest.raises(ValueError, match="expected"):
            outside_entries(wrong)
