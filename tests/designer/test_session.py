"""The designer's answers without a page: they are the numbers of camopt's public functions for the edited scene."""

import json
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

import camopt
from camopt.designer import slow_parts
from camopt.designer.cams import CONTRADICTION, KNOT_DEG, Cancelled, program_speeds_rpm
from camopt.designer.controls import Refused, controls, edited_scene, read_values
from camopt.designer.session import Session
from camopt.designer.slow_parts import YIELD_SPEEDS, baselines_part, bound_part, trains_of, why_none
from camopt.exact.settled import settled_metrics
from camopt.measure.limits import broken_by_shape
from camopt.optimizer.bound.certificate import area_ratio_bound
from camopt.optimizer.program.kinematic import kinematic_optimum
from camopt.optimizer.program.no_jump import no_jump_program
from camopt.scene import builtin_scenes, load_scene
from camopt.scene.parameters import with_spring
from camopt.scene.schema import SIMULATED
from camopt.scene.train import build_train

SCENE = load_scene("motori-1", need=SIMULATED)
EDITS = {
    "a limit": {"acceleration_max_mm_per_deg2": 0.02},
    "a limit switched on": {"jerk_max_mm_per_deg3": 0.002},
    "duration and lift": {"duration_deg": 150, "max_lift_mm": 9.0},
    "a ramp": {"ramp_height_mm": 0.3},
    "the spring": {"spring_rate_percent": 110.0, "spring_preload_percent": 105.0},
    "the lash": {"lash_mm": 0.12},
    "a margin": {"margin_N": 10.0},
}


@pytest.fixture(scope="module")
def session():
    return Session(SCENE)


def api_scene(values: dict):
    """The scene edited with the Python API."""
    scene = with_spring(
        SCENE, values.get("spring_rate_percent", 100) / 100, values.get("spring_preload_percent", 100) / 100
    )
    design = {k: float(v) for k, v in values.items() if hasattr(scene.design, k)}
    rows = [
        e.model_copy(update={"gap_mm": values["lash_mm"]}) if e.cam_driven and "lash_mm" in values else e
        for e in scene.element
    ]
    return scene.model_copy(update={"design": scene.design.model_copy(update=design), "element": tuple(rows)})


@pytest.mark.parametrize("name", EDITS)
def test_the_cam_is_that_of_the_public_functions(session, name):
    values = EDITS[name]
    session.answer(values, "sketch")  # its intermediate results must not change the answer
    answer, scene = session.answer(values), api_scene(values)
    assert answer["state"] == "ok" and answer["program"] == "no-jump" and not answer["coarse"] and answer["says"] == ""
    cam, margin = camopt.free_cam(scene.design, KNOT_DEG), values.get("margin_N", 0.0)
    speeds = [scene.cam_speed(s) for s in program_speeds_rpm(scene)]
    with threadpool_limits(limits=1, user_api="blas"):
        direct = no_jump_program(build_train(scene), scene.design, cam, speeds).solve(margin)
    assert answer["area_ratio"] == pytest.approx(direct.area_ratio, abs=1e-8)
    assert answer["broken_by_shape"] == []


@pytest.mark.long
def test_the_area_is_that_of_area_bound():
    """`area_bound` uses the listed speeds, which are set to those of the program."""
    operation = SCENE.operation.model_copy(update={"speeds_rpm": tuple(program_speeds_rpm(SCENE))})
    bound = camopt.area_bound(SCENE.model_copy(update={"operation": operation}), KNOT_DEG, 10.0)
    area = Session(SCENE).answer({"margin_N": 10.0})["area_ratio"]
    assert area == pytest.approx(bound["area_ratio_no_jump"], abs=1e-8)


def test_the_kinematic_cam_and_the_worth_of_its_limits(session):
    answer = session.answer({"program": "kinematic"})
    direct = kinematic_optimum(SCENE.design, camopt.free_cam(SCENE.design, KNOT_DEG))
    assert answer["area_ratio"] == pytest.approx(direct.area_ratio, abs=1e-9)
    assert answer["worth"] == pytest.approx(direct.sensitivities, abs=1e-6)
    assert answer["margin_price"] is None


def test_worth_of_a_limit_is_the_gain_by_a_small_change(session):
    limit, value = "acceleration_max_mm_per_deg2", SCENE.design.acceleration_max_mm_per_deg2
    area = session.answer({})["area_ratio"]
    more = session.answer({limit: 1.001 * value})["area_ratio"]
    assert session.answer({})["worth"][limit] == pytest.approx((more / area - 1) / 1e-3, rel=0.05, abs=1e-4)
    less = session.answer({"margin_N": -0.1})["area_ratio"]
    assert session.answer({})["margin_price"] == pytest.approx((area - less) / 0.1, rel=0.05)


def test_the_motion_is_that_of_verify_and_of_simulate(session):
    speed = SCENE.operation.speeds_rpm[-1]
    motion, lift = session.answer({"speed_rpm": speed})["motion"], session.design({}).cam.lift
    judged = camopt.verify(SCENE, lift, (speed,), "event", "draft").as_dict()["speeds"][0]
    for name, tolerance in {"bounce_mm": 1e-3, "jump_mm": 1e-3, "contact_force_max_N": 1.0}.items():
        assert motion["metrics"][name] == pytest.approx(judged[name], abs=tolerance)
    animation = motion["animation"]
    shown = np.array(animation["cams"][0]["motions"][0]["separation_um"][animation["seat"]]) / 1000
    simulated = camopt.simulate(SCENE, lift, speed, revolutions=12, step_deg=1.0)
    valve = simulated["position_mm"].sel(mass=SCENE.valve).values[-361:]
    seat = build_train(SCENE)
    opened = np.maximum(0.0, valve + seat.touch_compression[seat.seat] * 1e3)
    np.testing.assert_allclose(shown, opened, atol=2e-3)


def test_the_band_is_that_of_the_settled_metrics(session):
    band, lift = session.answer({}, "band"), session.design({}).cam.lift
    train = build_train(SCENE)
    direct = settled_metrics([train], [lift], [SCENE.cam_speed(s) for s in band["speeds_rpm"]])
    np.testing.assert_allclose(band["curves"]["bounce_mm"], direct.worst("bounce_mm")[0, 0], atol=1e-9)
    np.testing.assert_allclose(band["curves"]["jump_mm"], direct.worst("jump_mm")[0, 0], atol=1e-9)
    used = np.array(band["curves"]["bounce_mm"]) / SCENE.design.bounce_max_mm
    assert band["worst"]["bounce_max_mm"]["used"] == pytest.approx(used.max())
    assert band["speeds_rpm"][0], band["speeds_rpm"][-1] == SCENE.operation.band_rpm


@pytest.mark.long
def test_multi_pol_is_that_of_the_public_function(session):
    rows = {row["label"]: row for row in baselines_part(SCENE, None)["baselines"]}
    cam = camopt.read_cam("multi-pol", SCENE)
    assert rows["Multi-Pol"]["area_ratio"] == pytest.approx(cam.area_ratio_in(SCENE.design), abs=1e-12)


def test_bound_polydyne_and_yield_are_those_of_the_public_functions(session, monkeypatch):
    lift = session.design({}).cam.lift
    assert bound_part(SCENE, lift)["area_ratio_bound"] == float(area_ratio_bound(SCENE.design).bound)
    monkeypatch.setattr(slow_parts, "FAMILIES", {"polydyne": "Polydyne"})
    rows = {row["label"]: row for row in baselines_part(SCENE, lift)["baselines"]}
    polydyne = camopt.polydyne(SCENE)
    if rows["Polydyne"]["area_ratio"] is not None:
        assert rows["Polydyne"]["area_ratio"] == pytest.approx(polydyne.area_ratio_in(SCENE.design), abs=1e-12)
    assert rows["Polydyne"]["says"] or not broken_by_shape(polydyne, SCENE.design)
    speeds = np.linspace(*SCENE.operation.band_rpm, YIELD_SPEEDS)
    full = camopt.manufacturing_yield(SCENE, lift, 8, speeds_rpm=speeds)
    assert trains_of(SCENE, lift, 8)["share"] == full.share.share


def test_a_sketch_is_close_and_marked_as_coarse():
    session = Session(SCENE)
    sketch = session.answer({"lash_mm": 0.11}, "sketch")
    cam = session.answer({"lash_mm": 0.11})
    assert sketch["coarse"] and not cam["coarse"]
    assert sketch["area_ratio"] == pytest.approx(cam["area_ratio"], rel=0.01)
    again = session.answer({"lash_mm": 0.11, "max_lift_mm": 9.0}, "sketch")
    assert not again["coarse"]  # only a limit has changed since the rows were complete


def test_answers_do_not_depend_on_earlier_requests():
    session = Session(SCENE)
    for values in ({}, {"duration_deg": 160}, {"spring_rate_percent": 130.0}, {"margin_N": 40.0}):
        session.answer(values, "sketch")
        session.answer(values)
    alone = Session(SCENE).answer({"ramp_height_mm": 0.28})
    assert session.answer({"ramp_height_mm": 0.28})["area_ratio"] == pytest.approx(alone["area_ratio"], abs=1e-8)


@pytest.mark.parametrize(
    ("values", "key", "says"),
    [
        ({"max_lift_mm": -3}, "max_lift_mm", "greater than 0"),
        ({"max_lift_mm": "9"}, "max_lift_mm", "a number"),
        ({"max_lift_mm": float("nan")}, "max_lift_mm", "a number"),
        ({"max_lift_mm": True}, "max_lift_mm", "a number"),
        ({"max_lift_mm": None}, "max_lift_mm", "is needed"),
        ({"max_lift_mm": 10**400}, "max_lift_mm", "a number"),
        ({"max_lift_mm": 0.2}, "", "ramp height"),
        ({"nose_deg": 90}, "nose_deg", "half of duration_deg"),
        ({"band_low_rpm": 9e4}, "band_high_rpm", "lower"),
        ({"spring_rate_percent": -1}, "spring_rate_percent", "at least"),
        ({"program": "best"}, "program", "no-jump"),
        ({"speed_rpm": 0}, "speed_rpm", "above 0"),
        ({"reach_max_lift": 1}, "reach_max_lift", "true or false"),
        ({"nonsense": 1}, "nonsense", "unknown"),
    ],
)
def test_invalid_values_have_a_sentence_by_key(session, values, key, says):
    answer = session.answer(values, "sketch")
    assert answer["state"] == "refused" and says in answer["faults"][key]
    json.dumps(answer, allow_nan=False)


def test_contradictory_limits_are_reported(session):
    values = {"max_lift_mm": 30.0, "reach_max_lift": True}
    answer = session.answer(values)
    assert answer["state"] == "no cam" and answer["says"] == CONTRADICTION
    assert session.answer({})["state"] == "ok"
    assert why_none(session.edited({}), None)["says"] == ""


@pytest.mark.long
def test_contradictory_limits_are_diagnosed(session):
    assert "would have to" in why_none(session.edited({"max_lift_mm": 30.0, "reach_max_lift": True}), None)["says"]


def test_a_margin_that_no_cam_keeps_gives_the_kinematic_cam(session):
    answer = session.answer({"margin_N": 2000.0})
    assert answer["program"] == "kinematic" and "No cam keeps contact" in answer["says"]


def test_an_answer_that_is_not_wanted_any_more_is_cancelled(session):
    with pytest.raises(Cancelled):
        session.answer({"duration_deg": 141.5}, "cam", lambda: False)
    with pytest.raises(Cancelled):
        session.answer({}, "band", lambda: False)


def test_an_answer_is_cancelled_between_two_programs(session):
    """The tangents of a curved law need a sequence of programs; it ends at the first that is not wanted any more."""
    hydraulic, checks = Session(load_scene("finger-hydraulic")), []

    def wanted() -> bool:
        checks.append(None)
        return len(checks) < 5

    with pytest.raises(Cancelled):
        hydraulic.answer({}, "cam", wanted)
    assert len(checks) == 5
    assert hydraulic.answer({}, "sketch")["state"] == "ok"


def test_a_spring_with_a_force_table_has_sliders():
    """finger-hydraulic has springs by force tables only; its sliders multiply the forces or their slopes."""
    hydraulic = Session(load_scene("finger-hydraulic"))
    assert {"spring_rate_percent", "spring_preload_percent"} <= set(hydraulic.controls)
    stiffer = hydraulic.edited({"spring_rate_percent": 110.0})
    for before, after in zip(hydraulic.scene.element, stiffer.element, strict=True):
        if before.force_table:
            (c0, f0), (c1, f1) = before.force_table[:2]
            (d0, g0), (d1, g1) = after.force_table[:2]
            assert (g1 - g0) / (d1 - d0) == pytest.approx(1.1 * (f1 - f0) / (c1 - c0))
    assert hydraulic.answer({"spring_rate_percent": 110.0}, "sketch")["state"] == "ok"


def resident_MB() -> float:
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * 4096 / 1000**2


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="only Linux tells a process's memory so")
@pytest.mark.parametrize("changes", [60, pytest.param(2000, marks=pytest.mark.long)])
def test_memory_stays_flat_over_many_changes(changes):
    session = Session(SCENE)

    def change(i: int) -> None:
        values = {"max_lift_mm": 9.0 + 0.001 * (i % 97), "lash_mm": 0.1 + 0.001 * (i % 11)}
        assert session.answer(values, "sketch")["state"] == "ok"

    for i in range(40):  # caches fill
        change(i)
    before = resident_MB()
    for i in range(changes):
        change(i)
    assert resident_MB() < before + 0.15 * before


@pytest.mark.parametrize("name", sorted(builtin_scenes()))
def test_every_scene_has_controls_that_leave_it_as_it_is(name):
    scene = load_scene(name)
    if None in (scene.seat, scene.operation, scene.design):
        pytest.skip("no motion in this scene")
    listed = controls(scene)
    by_key = {c.key: c for c in listed}
    assert len(by_key) == len(listed)
    assert edited_scene(scene, read_values(by_key, {})) == scene
    for c in listed:
        if c.low or c.high:
            assert c.low < c.high and c.step > 0 and (c.value is None or c.low <= c.value <= c.high), c.key


def test_a_tolerance_may_be_changed_and_switched_off():
    scene = load_scene("kodama")
    by_key = {c.key: c for c in controls(scene)}
    values = read_values(by_key, {"tolerance.lash": None, "tolerance.preload": 0.01, "grinding_error_um": None})
    edited = edited_scene(scene, values)
    assert [t.label for t in edited.tolerance] == [t.label for t in scene.tolerance if t.label != "lash"]
    assert next(t for t in edited.tolerance if t.label == "preload").relative == 0.01
    assert edited.grinding is None


def test_refused_states_all_faults():
    with pytest.raises(Refused, match=r"max_lift_mm: expected a number.*; nonsense: unknown key|nonsense.*max_lift_mm"):
        read_values({c.key: c for c in controls(SCENE)}, {"max_lift_mm": "x", "nonsense": 1})
