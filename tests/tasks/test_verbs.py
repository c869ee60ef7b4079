"""Tasks on scenes compute the same numbers as the corresponding functions, to the last bit in every process."""

import numpy as np
import pytest

import camopt
from camopt.cam.design_file import as_written
from camopt.exact.settled import settled_metrics
from camopt.measure.limits import motion_limits
from camopt.scene import InputError, build_train, load_scene
from camopt.scene.load import scene_with
from camopt.scene.quantities import QUANTITIES
from camopt.tasks.plan import load_plan
from camopt.tasks.task import stored_task
from tests.tasks.tasks_of_tests import stored

SCENE = load_scene("motori-1")
SPEEDS = (4000.0, 5000.0)
TASKS = [
    *({"verb": "settled", "scene": "motori-1", "cam": "polydyne", "speed_rpm": speed} for speed in SPEEDS),
    {"verb": "settled", "scene": "motori-1", "cam": "polydyne", "speed_rpm": 5000, "vary": {"spring.preload_N": 300}},
    {"verb": "simulate", "scene": "motori-1", "cam": "polydyne", "speed_rpm": 5000, "revolutions": 3},
    *({"verb": "yield", "scene": SCENE, "cam": "polydyne", "speeds_rpm": SPEEDS, "train": i} for i in (3, 4)),
    {"verb": "simulate", "scene": "motori-1", "cam": "polydyne", "speed_rpm": 5000, "method": "tmn"},
    {"verb": "settled", "scene": "motori-1", "cam": "polydyne:exponents=2/10", "speed_rpm": 5000},
]


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    return camopt.sweep(TASKS, tmp_path_factory.mktemp("verbs") / "x.sqlite", workers=0)


@pytest.fixture(scope="module")
def rows(swept):
    return list(swept.rows())


def test_settled_tasks_give_the_settled_metrics(rows):
    cam, speeds = camopt.polydyne(SCENE), [SCENE.cam_speed(speed) for speed in SPEEDS]
    for row, speed in zip(rows[:2], speeds, strict=True):
        settled = settled_metrics([build_train(SCENE)], [cam], [speed], workers=1)
        for name in QUANTITIES:
            assert row[f"{name}_low"] == settled.lowest[name][0, 0, 0]
            assert row[f"{name}_high"] == settled.highest[name][0, 0, 0]
        assert (row["periodic"], row["revolutions"]) == (settled.periodic[0, 0, 0], settled.revolutions[0, 0, 0])
        limits = motion_limits(SCENE.design)
        assert row["broken"] == [k for k, limit in limits.items() if limit.breaks(settled.worst(limit.metric)[0, 0, 0])]


def test_varied_numbers_apply_to_the_train_and_to_its_cam(rows):
    scene = scene_with(SCENE, {"spring.preload_N": 300.0})
    settled = settled_metrics([build_train(scene)], [camopt.polydyne(scene)], [scene.cam_speed(5000)], workers=1)
    assert rows[2]["vary spring.preload_N"] == 300.0
    assert rows[2]["contact_force_max_N_high"] == settled.highest["contact_force_max_N"][0, 0, 0]
    assert rows[2]["contact_force_max_N_high"] != rows[1]["contact_force_max_N_high"]


def test_simulate_tasks_give_the_results_of_simulate(rows):
    motion = camopt.simulate(SCENE, camopt.polydyne(SCENE), 5000, revolutions=3)
    assert rows[3]["bounce_mm"] == motion["bounce_mm"].values.max()
    assert rows[3]["contact_force_min_N"] == motion["contact_force_min_N"].values.min()
    assert rows[3]["valve_max_mm"] == motion["position_mm"].values.max()


def test_yield_tasks_give_the_trains_of_a_yield(rows):
    estimated = camopt.manufacturing_yield(SCENE, camopt.polydyne(SCENE), 5, speeds_rpm=SPEEDS)
    for row, number in zip(rows[4:6], (3, 4), strict=True):
        used = np.array([row[f"used_{limit}"] for limit in estimated.used.limits])
        assert np.array_equal(used, estimated.used.used[number])
        assert row["holds"] == bool(estimated.used.holds[number]) and row["worst"] == used.max()


def test_faults_found_during_computation_give_failed_rows(rows):
    assert [row["state"] for row in rows] == ["done"] * 6 + ["failed"] * 2
    assert "method 'tmn'" in rows[6]["reason"] and rows[7]["reason"]


def test_rows_are_the_same_in_other_processes(swept, tmp_path):
    camopt.sweep(TASKS, tmp_path / "x.sqlite", workers=2)
    assert stored(tmp_path / "x.sqlite") == stored(swept.store)


def test_a_lift_law_and_its_design_are_the_same_cam(tmp_path):
    cam = camopt.polydyne(SCENE)
    tasks = [{"verb": "settled", "scene": SCENE, "cam": law, "speed_rpm": 5000} for law in (cam, as_written(cam))]
    sweep = camopt.sweep(tasks[:1], tmp_path / "x", workers=0)
    (row,) = sweep.rows()
    metrics = settled_metrics([build_train(SCENE)], [as_written(cam)], [SCENE.cam_speed(5000)], workers=1)
    assert row["jump_mm_high"] == metrics.highest["jump_mm"][0, 0, 0]
    assert sweep.part(row["cam"]).startswith('{"family": "polydyne"')


class TestCall:
    FUNCTION = "tests.tasks.tasks_of_tests:doubled"

    def test_a_function_of_the_user(self, tmp_path):
        tasks = [{"verb": "call", "function": self.FUNCTION, "arguments": {"number": n}} for n in (1, 2.5, [3])]
        sweeps = {workers: camopt.sweep(tasks, tmp_path / str(workers), workers=workers) for workers in (0, 2)}
        rows = list(sweeps[0].rows())
        assert [row["twice"] for row in rows] == [2, 5.0, [3, 3]] and rows[1]["number"] == 2.5
        assert stored(tmp_path / "0") == stored(tmp_path / "2")

    @pytest.mark.parametrize(
        ("changes", "words"),
        [
            ({"function": "doubled"}, "function: String should match pattern"),
            ({"function": "nowhere.at_all:doubled"}, "function 'nowhere.at_all:doubled': cannot be imported"),
            ({"function": "tests.tasks.tasks_of_tests:tripled"}, "cannot be imported"),
            ({"arguments": {"number": {1, 2}}}, "arguments: expected numbers, texts, lists and dictionaries"),
            ({"arguments": {"number": float("nan")}}, "arguments: expected numbers"),
        ],
    )
    def test_an_invalid_call_is_reported_with_a_sentence(self, changes, words):
        with pytest.raises(InputError) as refused:
            stored_task({"verb": "call", "function": self.FUNCTION} | changes, "1")
        assert words in str(refused.value)

    def test_a_plan_may_not_use_the_verb_call(self, tmp_path):
        path = tmp_path / "plan.toml"
        path.write_text('format = 1\nverb = "call"\n')
        with pytest.raises(InputError, match="verb: must be 'settled', 'simulate', 'yield' or 'rehearse'"):
            load_plan(path)
