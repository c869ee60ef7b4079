import json
from dataclasses import replace

import numpy as np
import pytest

from camopt.cam.design_file import write_design
from camopt.cam.read import read_cam
from camopt.exact import settled_metrics
from camopt.exact.engine import prepare
from camopt.measure.settling import settle
from camopt.optimizer.baselines.figures import settled_motion, stated_periodic
from camopt.report import page
from camopt.report.folder import read_run_folder
from camopt.report.motion import MOST_NUMBERS, RunCams, animation, cams_of, last_revolution_numbers
from camopt.scene import build_train, load_scene
from camopt.scene.rest import state_at_rest
from camopt.scene.units import DEG, MM
from camopt.verifier.verdict import verdict_on
from tests.report.conftest import rows_of, write_cams

SCENE = load_scene("motori-1")
SPEED = SCENE.cam_speed(5000)


@pytest.fixture(scope="module")
def polydyne():
    return read_cam("polydyne", SCENE)


def test_motion_is_the_settled_one_of_event_exact(polydyne):
    train = build_train(SCENE)
    numbers = last_revolution_numbers(settled_motion(train, polydyne, SPEED, None, 720), 0.5)
    settled = settle(prepare(train, polydyne, SPEED), state_at_rest(train))
    record = settled.response
    middle = 2 * np.pi * (record.revolutions - 1)
    for i in (0, 250, 360, 500, 720):
        at = middle + (-180 + 0.5 * i) * DEG
        x = np.interp(at, record.angle, record.x[:, 0])
        assert numbers["position_um"][0][i] == pytest.approx(1e6 * x, abs=1.5)  # rounded to 1 um, chords of the record
        v = np.interp(at, record.angle, record.v[:, train.valve])
        assert numbers["valve_mm_per_s"][i] == pytest.approx(1e3 * v, rel=0.02, abs=2.0)
        for e in range(4):
            assert numbers["separation_um"][e][i] == pytest.approx(
                1e6 * np.interp(at, record.angle, record.separation(e)), abs=1.0
            )
    assert numbers["periodic"] == settled.periodic
    worst = settled.metrics(polydyne)
    inside = slice(round((180 - 72) / 0.5), round((180 + 72) / 0.5) + 1)
    assert max(numbers["force_N"][0][inside]) == pytest.approx(worst.worst("contact_force_max_N"), rel=0.02)
    jump = max(numbers["separation_um"][0][inside]) / 1000
    assert jump == pytest.approx(worst.worst("jump_mm"), abs=2e-3)


def test_a_motion_settles_here_if_it_does_in_the_verdict():
    """A motion with bouncing contacts settles slowly: it needs more revolutions than the first attempt runs, and
    settles in the verdict's later attempts."""
    lively = [e.model_copy(update={"damping_N_s_per_m": 0.3 * e.damping_N_s_per_m}) for e in SCENE.element]
    scene = SCENE.model_copy(update={"element": lively})
    lift = read_cam("polydyne", SCENE)
    train, speed = build_train(scene), scene.cam_speed(6100)
    assert not settled_metrics([train], [lift], [speed]).periodic.any()
    (judged,) = verdict_on(scene, lift, (6100.0,), ("event",), None).as_dict()["speeds"]
    assert judged["periodic"] and judged["revolutions"] > 40
    (stated,) = stated_periodic({"speeds": [judged]}).values()
    drawn = last_revolution_numbers(settled_motion(train, lift, speed, stated, 360), 1.0)
    assert drawn["periodic"]
    first, last = (np.array([one[i] for one in drawn["position_um"]]) for i in (0, -1))
    np.testing.assert_allclose(first, last, atol=2)  # positions are rounded to a micrometre
    assert not settled_motion(train, lift, speed, False).periodic  # the verdict's statement is used


def folder_of(write, contents, lift):
    """A run folder of motori-1 whose design and Polydyne have the same lift."""
    lifts = {"design": lift, "polydyne": lift}
    contents["comparison"] = rows_of(contents["comparison"], lifts)
    folder = write(contents, "motori-1")
    write_cams(folder, lifts)
    return folder


def larger(row: dict) -> dict:
    """The row with an area ratio that differs from that of its cam."""
    return row | {"area_ratio": str(float(row["area_ratio"]) + 2e-6)}


@pytest.mark.parametrize(
    ("changed", "shown", "says"),
    [
        (dict, ["design", "polydyne"], None),
        (larger, ["design"], "polydyne is not simulated here: its area ratio comes out as"),
        (lambda row: row | {"verdict": "failed"}, ["design"], "polydyne has no member within the limits."),
        (lambda row: row | {"cam": "multi-pol (no-jerk)"}, ["design", "multi-pol (no-jerk)"], None),
        # a name neither leads to a file outside the folder nor starts a search
        *(
            (lambda row, name=name: row | {"cam": name}, ["design"], name)
            for name in ("../secret", "/secret", "multi-pol")
        ),
    ],
)
def test_cams_are_those_that_the_folder_holds_with_the_recorded_area(
    tmp_path, write, contents, polydyne, changed, shown, says
):
    folder = folder_of(write, contents, polydyne)
    for path in (tmp_path / "secret.json", folder / "cams" / "multi-pol (no-jerk).json"):
        write_design(path, polydyne, 9.4 * MM)
    run = read_run_folder(folder)
    comparison = [row if row["cam"] == "design" else changed(row) for row in run.comparison]
    cams = cams_of(folder, replace(run, comparison=comparison))
    assert list(cams.lifts) == shown
    assert [sentence.startswith(says) for sentence in dict.fromkeys(cams.left_out)] == [True] * (says is not None)


def test_animation_has_a_limited_size(write, contents, polydyne):
    folder = folder_of(write, contents, polydyne)
    cams = cams_of(folder, read_run_folder(folder))
    data, left_out = animation(cams)
    assert data is not None and left_out == []
    assert data["step_deg"] == 0.5 and data["seat"] == 2 and data["follower"] == "point"
    assert [m["speed_rpm"] for m in data["cams"][0]["motions"]] == [5000, 6000, 7000]
    top = np.array(data["cams"][0]["contour_mm"])[180]
    np.testing.assert_allclose(top, [0.0, 16 + polydyne(0.0) / MM], atol=1e-3)
    many = replace(cams, lifts={f"polydyne {i}": polydyne for i in range(30)})
    coarse, _ = animation(many)
    assert coarse is not None
    count = sum(np.size(m[k]) for c in coarse["cams"] for m in c["motions"] for k in m if k.endswith(("_um", "_N")))
    assert coarse["step_deg"] > 0.5 and count < 1.01 * MOST_NUMBERS


@pytest.mark.long
def test_a_scene_with_curved_laws_moves_by_chords(polydyne):
    data, left_out = animation(RunCams(load_scene("kodama-hertz"), {"design": polydyne}, []))
    assert data is not None and not left_out


def test_embedded_data_cannot_end_its_element():
    data = {"name": "</script><!--<script>&amp;\u2028", "values": [1.5, -2]}
    template = page._environment().from_string("{{ data | tojson }}")
    text = template.render(data=data)
    assert json.loads(text) == data
    assert not set("<>&\u2028") & set(text)
    with pytest.raises(ValueError):
        template.render(data={"x": float("nan")})
