"""Every declared metric, read a second time from a raw motion by DOP853, agrees with what camopt states.

Both start from the settled state that camopt found, so that a motion which multiplies errors is compared over the one
revolution that is measured.
"""

from functools import cache

import numpy as np
import pytest

from camopt.cam.read import read_cam
from camopt.exact.adjoint.metrics import METRICS
from camopt.exact.adjoint.motion import TracedMotion
from camopt.measure.metrics import measure
from camopt.scene import QUANTITIES, build_train, builtin_scenes, load_scene
from camopt.scene.response import Response, end_state, joined
from camopt.scene.rest import state_at_rest
from camopt.verifier.convergence import RELATIVE, StepRefinement, Tolerances, apart, first_steps
from camopt.verifier.verdict import method_named
from tests.measure.raw_motion import TURN, Equations, raw_motion, samples
from tests.measure.second_reading import Reading

TOLERANCE_UM, HALVINGS = 2.0, 6
"""As in `camopt.verify` at standard accuracy."""
REFINEMENT = 4
"""Equal samples, as a multiple of the first steps of a method that takes them."""
OWN_ERROR = {"mm": 1e-7, "m/s": 1e-7, "deg": 1e-6, "N": 1e-3, "mm deg": 1e-5}
"""Error of the second reading itself: DOP853 at a relative error of 1e-12 a step, multiplied by the impacts."""

WITHOUT_BOUNCE = {
    "motori-1": ("polydyne", 4000),
    "motori-2": ("kurz", 1000),
    "kodama": ("polydyne", 5000),
    "pushrod-5mass": ("polydyne", 3000),
    "kodama-hertz": ("polydyne", 5000),
    "exhaust-gas": ("polydyne", 4000),
    "finger-hydraulic": ("polydyne", 6000),
    "pushrod-hydraulic": ("polydyne", 6000),
    "race-nested": ("polydyne", 6000),
}
WITH_BOUNCE = {
    "motori-1": ("polydyne", 6000),
    "motori-2": ("kurz", 5000),
    "kodama": ("polydyne", 6000),
    "pushrod-5mass": ("kurz", 7000),
    "kodama-hertz": ("polydyne", 6500),
    "exhaust-gas": ("polydyne", 7000),
    "finger-hydraulic": ("polydyne", 9300),
    "pushrod-hydraulic": ("polydyne", 5000),
    "race-nested": ("polydyne", 11000),
}
LATE = {"motori-1": ("polydyne", 7000)}
"""The valve comes down after its nominal closing, and a later impact is the hardest."""
CURVED = "kodama-hertz", "race-nested"
SHORT = ("motori-1",)
"""One mass: seconds. The other scenes are long."""


def cases(*tables, without=()):
    """A scene and a table, for each of its scenes."""
    return [
        pytest.param(name, table, id=f"{name}-{table[name][1]}", marks=() if name in SHORT else pytest.mark.long)
        for table in tables
        for name in table
        if name not in without
    ]


@cache
def case(name, cam, rpm):
    """Scene, train, cam speed and lift law."""
    scene = load_scene(name)
    return scene, build_train(scene), scene.cam_speed(rpm), read_cam(cam, scene)


@cache
def settled(name, cam, rpm, method):
    """A method's answer at standard accuracy."""
    _, train, speed, lift = case(name, cam, rpm)
    rest = state_at_rest(train)
    return StepRefinement(method_named(method), train, lift, speed, rest, Tolerances(TOLERANCE_UM, HALVINGS)).answer()


@cache
def motion(name, cam, rpm, method):
    """(equations, raw motion) from a method's settled state to the opening foot of the next event."""
    scene, _, _, lift = case(name, cam, rpm)
    equations = Equations(scene, lift, rpm)
    return equations, raw_motion(equations, settled(name, cam, rpm, method).state, TURN + lift.opening_foot)


@cache
def second_reading(name, cam, rpm, method):
    """The second reading of the revolution that follows a method's settled state."""
    return Reading(*motion(name, cam, rpm, method)).figures()


def verifier_figures(name, cam, rpm, method):
    """The verifier's metrics of that revolution, by the method at the steps at which its answer stood."""
    _, train, speed, lift = case(name, cam, rpm)
    answer = settled(name, cam, rpm, method)
    revolve = method_named(method)(train, lift, speed, answer.steps_per_revolution)
    first = revolve(answer.state)
    figures = measure(joined([first, revolve(end_state(first))]), lift)
    return {metric: float(values[0]) for metric, values in figures.items()}


def first_method(name):
    """The most accurate one: event-exact has chords where laws are curved."""
    return "dop853" if name in CURVED else "event"


def test_every_scene_with_a_dynamics_and_every_declared_metric_is_read():
    dynamic = {name for name in builtin_scenes() if load_scene(name).operation is not None}
    assert set(WITHOUT_BOUNCE) == set(WITH_BOUNCE) == dynamic
    assert set(second_reading("motori-1", *WITHOUT_BOUNCE["motori-1"], "event")) == set(QUANTITIES)


@pytest.mark.parametrize(("name", "table"), cases(WITHOUT_BOUNCE, WITH_BOUNCE, LATE))
def test_the_verifier_states_what_the_second_reading_finds(name, table):
    """The most accurate method's figures, all of them, within the error that stands beside them."""
    where = name, *table[name], first_method(name)
    stated, found, answer = verifier_figures(*where), second_reading(*where), settled(*where)
    assert (found["bounce_mm"] > 1e-3) == (table is not WITHOUT_BOUNCE)
    if table is LATE:
        assert found["bounce_mm"] > 1 and found["impact_velocity_m_per_s"] > found["seating_velocity_m_per_s"]
    for metric, quantity in QUANTITIES.items():
        allowed = answer.error[metric] + OWN_ERROR[quantity.unit]
        assert apart(stated[metric], found[metric]) <= allowed, (metric, stated[metric], found[metric], allowed)


@pytest.mark.parametrize(("name", "table"), cases(WITHOUT_BOUNCE, WITH_BOUNCE))
def test_equal_samples_decide_alike(name, table):
    """The raw motion sampled as methods of fixed steps leave it, which have no sample at a switching: the verifier
    reads the deciding figures within half of what halving the step may still move, the least error that it grants.
    """
    where = name, *table[name], first_method(name)
    _, train, speed, lift = case(*where[:3])
    equations, stretches = motion(*where)
    foot = TURN + lift.opening_foot
    angles = np.linspace(-np.pi, foot, REFINEMENT * first_steps(train, speed))
    rise, y, force = samples(equations, stretches, angles)
    after = np.append(angles, 3 * np.pi)  # a record has whole revolutions; beyond the foot nothing is read
    rise, y, force = (np.concatenate([part, part[-1:]]) for part in (rise, y, force))
    n = len(train.mass)
    more = np.zeros((len(after), len(train.a) - force.shape[1]))  # the train's oil stands apart from its plunger
    force = np.concatenate([force, more], axis=1)
    record = Response(train, speed, after, rise, y[:, :n], y[:, n : 2 * n], force, y[:, 2 * n :])
    stated, found = measure(record, lift), second_reading(*where)
    for metric, absolute in Tolerances(TOLERANCE_UM).absolute.items():
        allowed = 0.5 * (absolute + RELATIVE * abs(found[metric]))
        assert apart(stated[metric][0], found[metric]) <= allowed, (metric, stated[metric], found[metric])


@pytest.mark.parametrize(("name", "table"), cases(WITHOUT_BOUNCE, WITH_BOUNCE, without=CURVED))
def test_event_exact_states_what_the_second_reading_finds(name, table):
    """The metrics that event-exact differentiates, read from its power series at exact instants."""
    where = name, *table[name]
    _, train, speed, lift = case(*where)
    metrics = [metric for metric in METRICS if metric in QUANTITIES]
    traced = TracedMotion(train, lift, speed, settled(*where, "event").state, 2)
    stated, found = traced.swept(metrics)[0][:, 0], second_reading(*where, "event")
    for metric, value in zip(metrics, stated, strict=True):
        assert apart(value, found[metric]) <= OWN_ERROR[QUANTITIES[metric].unit], (metric, value, found[metric])
