"""What another number of the scene would buy: changes, the table, and the command."""

import pytest

from camopt.cam.families.polydyne import polydyne
from camopt.cli import parser as cli
from camopt.scene import InputError, load_scene
from camopt.scene.units import DEG, MM
from camopt.study import what_if as module
from camopt.study.what_if import changed_scene, what_if, what_if_lines

SCENE = load_scene("motori-1")
CAM = polydyne(SCENE)


def confirmed(scene, cam, trains):
    """What a cam comes to, without its verdict being computed."""
    return dict.fromkeys(key for _, key, _ in module.ROWS) | {"cam": cam.family, "verdict": "confirmed", "says": ""}


def element(scene, name):
    return next(e for e in scene.element if e.name == name)


def test_factors_and_numbers_change_the_scene_together():
    spring = element(SCENE, "spring")
    changes = {
        "spring.stiffness_N_per_m": (True, 1.1),
        "spring.preload_N": (False, 275.0),
        "design.max_lift_mm": (True, 0.9),
    }
    after, found = changed_scene(SCENE, changes)
    assert element(after, "spring").stiffness_N_per_m == pytest.approx(1.1 * spring.stiffness_N_per_m)
    assert element(after, "spring").preload_N == 275.0
    assert after.design.max_lift_mm == pytest.approx(0.9 * SCENE.design.max_lift_mm)
    assert found["spring.preload_N"] == (spring.preload_N, 275.0) and list(found) == list(changes)
    assert element(SCENE, "spring") is spring  # as it was
    everything = changed_scene(SCENE, {"*.damping_N_s_per_m": (True, 2.0)})[1]
    assert len(everything) == sum(row.damping_N_s_per_m > 0 for row in (*SCENE.mass, *SCENE.element))


@pytest.mark.parametrize(
    ("name", "change", "says"),
    [
        ("sprin.stiffness_N_per_m", (True, 1.1), "has no such number.*spring.stiffness_N_per_m"),
        ("design.duration", (False, 1.0), "has no such number"),
        ("operation.speeds_rpm", (False, 1.0), "has no such number"),
        ("valve.mass_kg", (True, -1.0), "with the change: mass.1.mass_kg"),
    ],
)
def test_what_is_no_change_is_one_sentence(name, change, says):
    with pytest.raises(InputError, match=says) as error:
        changed_scene(SCENE, {name: change})
    assert len(str(error.value).splitlines()) == 1


@pytest.fixture(scope="module")
def stiffer():
    return what_if(SCENE, CAM, {"spring.stiffness_N_per_m": (True, 1.1)}, trains=12)


def test_a_stiffer_spring_lets_the_same_cam_run_faster(stiffer):
    """Inertia at the nose is carried up to a speed that grows with the root of the spring's force there."""
    _, before, after = stiffer.values()
    assert after["first_jump_rpm"] > before["first_jump_rpm"] + 50
    assert after["area_ratio"] == before["area_ratio"] and before["area_mm_deg"] == pytest.approx(CAM.area / MM / DEG)
    assert after["yield_percent"] >= before["yield_percent"]


def test_the_cam_is_designed_anew_where_it_is_asked_for(monkeypatch):
    seen = []
    monkeypatch.setattr(module, "outcome", confirmed)

    def no_cam(scene, *rest):
        seen.append(element(scene, "spring").preload_N)
        raise InputError("no free cam holds: raise a limit")

    monkeypatch.setattr(module, "find_cam", no_cam)
    found = what_if(SCENE, CAM, {"spring.preload_N": (False, 275.0)}, redesign=True)
    assert seen == [275.0] and list(found) == ["changed", "as_given", "with_the_change", "redesigned"]
    assert what_if_lines(found)[-1] == "redesigned: no free cam holds: raise a limit"


def test_the_command(monkeypatch, capsys):
    monkeypatch.setattr(module, "outcome", confirmed)
    words = ["what-if", "motori-1", "--cam", "polydyne", "--set", "spring.preload_N=*1.1", "--set", "valve.mass_kg=0.2"]
    assert cli.main(words) == 0
    assert capsys.readouterr().out.startswith("spring.preload_N: 250 -> 275\nvalve.mass_kg: 0.24 -> 0.2\n")
    assert cli.main([*words, "--set", "valve.mass_kg=0.3"]) == 2
    assert "'valve.mass_kg': is given twice" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        cli.main([*words[:4], "--set", "spring.preload_N"])
    assert "such as spring.stiffness_N_per_m=*1.1" in capsys.readouterr().err
