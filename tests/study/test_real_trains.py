"""The studies on trains with memories: states of 2n + r numbers on every path."""

from functools import cache

import numpy as np
import pytest

from camopt.cam.families.polydyne import polydyne
from camopt.scene import build_train, load_scene
from camopt.scene.rest import state_at_rest
from camopt.study.extremes.cases import cases
from camopt.study.extremes.extremes import smooth_float32
from camopt.study.simulate.motion import simulate
from camopt.study.tradeoff.methods import RevolutionCase
from experiments.support.smooth_costs import equal_steps, recorded

NAME, RPM = "finger-hydraulic", 4000.0


@cache
def hydraulic():
    scene = load_scene(NAME)
    return scene, build_train(scene), polydyne(scene)


def test_a_simulation_starts_with_its_memories_at_rest():
    scene, _, lift = hydraulic()
    events = [simulate(scene, lift, RPM, method, revolutions=1) for method in ("event", "rkg")]
    valves = [motion["position_mm"].sel(mass="valve").values for motion in events]
    assert np.ptp(valves[0]) > 8.5
    assert np.abs(valves[0] - valves[1]).max() < 2e-3


def test_equal_steps_of_the_smooth_path_carry_memories():
    scene, train, lift = hydraulic()
    case = RevolutionCase(scene, lift, RPM)
    run, rest = equal_steps(case, "float64", 5760, np.array([case.cam_speed]))
    assert rest.shape == (2, len(train.mass) + len(train.memory), 1)
    _, x, _, _, memory = recorded(run(rest, 1e-6))
    exact = simulate(scene, lift, RPM, "event", revolutions=1, step_deg=0.0625)["position_mm"].sel(mass="valve").values
    assert np.abs(1e3 * x[0, :, train.valve] - exact).max() < 0.02
    assert memory.shape == (1, 5761, 2) and np.all(np.isfinite(memory))


@pytest.mark.long
def test_single_precision_carries_memories():
    scene, train, lift = hydraulic()
    motion = smooth_float32(train, lift, scene.cam_speed(RPM), 4096)(state_at_rest(train))
    assert motion.memory.shape == (len(motion.angle), 2) and np.ptp(motion.x[:, train.valve]) > 8.5e-3


OF_OIL = {"hardly leaks", "leaks a thousand times as fast"}
OF_FRICTION = {"slips at a thousandth", "slips at three times"}
OF_FORCES = {"forces three times", "forces of the other sign"}


@pytest.mark.parametrize(
    ("name", "own"), [("finger-hydraulic", OF_OIL | OF_FRICTION), ("exhaust-gas", OF_FORCES), ("kodama", set())]
)
def test_extremes_of_what_only_some_scenes_have(name, own):
    found = {case for case, _ in cases(load_scene(name))}
    assert found & (OF_OIL | OF_FRICTION | OF_FORCES) == own
