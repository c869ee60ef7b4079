"""Limits on the cam's radii under a pad: not applied while the user drags, which is stated, and held at rest."""

import pytest
from threadpoolctl import threadpool_limits

from camopt.designer.cams import KNOT_DEG, program_speeds_rpm
from camopt.designer.session import Session
from camopt.optimizer.program.kinematic import kinematic_optimum
from camopt.optimizer.program.no_jump import no_jump_program
from camopt.optimizer.program.program_cam import program_cam
from camopt.optimizer.program.relocation import converge_tangents
from camopt.scene import load_scene
from camopt.scene.train import build_train

KODAMA, KEY = load_scene("kodama"), "nose_radius_min_mm"


@pytest.fixture(scope="module")
def scene():
    geometry = KODAMA.geometry.model_dump(exclude_none=True) | {"pad_radius_mm": 15.0}
    tables = KODAMA.model_dump(exclude_none=True, exclude_defaults=True)
    tables["design"][KEY], tables["geometry"] = 12.5, geometry
    return type(KODAMA).model_validate(tables)


def test_radii_are_pending_while_dragging_and_held_at_rest(scene):
    session, lower_lift = Session(scene), {"max_lift_mm": 9.35}
    session.answer({}, "sketch")
    session.answer({})
    for values in ({"lash_mm": 0.175}, lower_lift):  # other rows, and a limit alone
        sketch = session.answer(values, "sketch")
        assert sketch["coarse"] and sketch["looked_for"] == [KEY] and sketch["broken_by_shape"] == []
    answer = session.answer(lower_lift)
    assert not answer["coarse"] and answer["looked_for"] == answer["broken_by_shape"] == [] and answer["says"] == ""
    edited = session.edited(lower_lift)
    cam, speeds = program_cam(edited.design, KNOT_DEG), [edited.cam_speed(s) for s in program_speeds_rpm(edited)]
    with threadpool_limits(limits=1, user_api="blas"):
        direct = converge_tangents(no_jump_program(build_train(edited), edited.design, cam, speeds), 0.0)
        assert answer["area_ratio"] == pytest.approx(direct.solve(0.0).area_ratio, abs=1e-8)
    assert answer["area_ratio"] < sketch["area_ratio"]


def test_the_kinematic_cam_holds_them_at_rest(scene):
    session, values = Session(scene), {"program": "kinematic"}
    assert session.answer(values, "sketch")["looked_for"] == [KEY]
    answer, direct = session.answer(values), kinematic_optimum(scene.design, program_cam(scene.design, KNOT_DEG))
    assert not answer["coarse"] and answer["broken_by_shape"] == []
    assert answer["area_ratio"] == pytest.approx(direct.area_ratio, abs=1e-9)
