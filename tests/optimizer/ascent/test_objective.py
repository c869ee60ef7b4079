"""The objective: its terms as event-exact has them, its gradient as differences have it, on both paths."""

import jax
import numpy as np
import pytest

import camopt
from camopt.cam.families.exponent import exponent
from camopt.cam.families.free import free_cam
from camopt.exact import settled_metrics
from camopt.exact.adjoint.motion import value_and_gradient
from camopt.measure.as_built import trains_as_built
from camopt.optimizer.ascent.objective import AIM, REPRESENTATIVE
from camopt.optimizer.ascent.variables import TrainVariables
from camopt.optimizer.program.kinematic import kinematic_optimum
from camopt.scene import InputError, build_train, load_scene
from camopt.scene.schema import Tolerance
from tests.exact.test_real_trains import SCENE as REAL

MOTORI = load_scene("motori-1")
CAM = camopt.nearest_free_cam(MOTORI, camopt.polydyne(MOTORI, design_speed_rpm=6000), knot_deg=12)
SPEEDS = (5000.0, 6500.0)
PENALTIES = {"bounce_mm": 2.0, "jump_mm": 1.0, "contact_force_max_N": 1e-4}
PRELOADS = {("spring.preload_N", "seat.preload_N"): (0.8, 1.2), "valve.mass_kg": (0.9, 1.1)}


def metrics(train, cam, speed, revolutions=REPRESENTATIVE):
    found = value_and_gradient(
        train, cam, MOTORI.cam_speed(speed), list(PENALTIES), revolutions=revolutions + 1, revolution=revolutions - 1
    )
    return dict(zip(PENALTIES, found.values, strict=True))


def penalty(rows) -> float:
    """The formula of the page."""
    used = {"bounce_mm": 0.05, "jump_mm": 0.05}
    total = 0.0
    for name, weight in PENALTIES.items():
        values = np.array([row[name] for row in rows])
        total += weight * np.mean(np.maximum(values / used[name] - AIM, 0.0) if name in used else values)
    return total


@pytest.mark.parametrize("revolutions", [pytest.param(1, marks=pytest.mark.long), REPRESENTATIVE])
def test_value_and_terms_are_those_of_event_exact(revolutions):
    asked = {} if revolutions == REPRESENTATIVE else {"revolutions": revolutions}
    objective = camopt.objective(MOTORI, speeds_rpm=SPEEDS, penalties=PENALTIES, **asked).of(CAM)
    rows = [metrics(build_train(MOTORI), CAM, speed, revolutions) for speed in SPEEDS]
    value, terms = objective.value_and_terms(objective.parameters)
    assert float(terms["area_ratio"]) == pytest.approx(CAM.area_ratio(9.4e-3), rel=1e-12)
    for name in PENALTIES:
        assert float(terms[name]) == pytest.approx(np.mean([row[name] for row in rows]), rel=1e-6)
    assert rows[1]["bounce_mm"] > 0.05 and penalty(rows) > 1.0
    assert float(value) == pytest.approx(CAM.area_ratio(9.4e-3) - penalty(rows), rel=1e-6)


def test_by_default_a_metric_is_that_of_the_settled_motion():
    """The first revolution of this cam stays below the limit that its settled motion breaks almost tenfold."""
    scene = load_scene("race-nested")
    cam = kinematic_optimum(scene.design, free_cam(scene.design, 6.0)).lift
    settled = settled_metrics([build_train(scene)], [cam], [scene.cam_speed(8800)]).highest["bounce_mm"][0, 0, 0]
    asked = {"speeds_rpm": (8800.0,), "penalties": {"bounce_mm": 1.0}}
    found = [camopt.objective(scene, **asked, **more).of(cam) for more in ({"revolutions": 1}, {})]
    first, default = (float(one.value_and_terms(one.parameters)[1]["bounce_mm"]) for one in found)
    assert first < scene.design.bounce_max_mm < 0.2 * settled
    assert default == pytest.approx(settled, rel=0.2)


def test_drawn_trains_are_those_of_the_tolerances():
    objective = camopt.objective(MOTORI, speeds_rpm=SPEEDS, penalties=PENALTIES, trains=3, seed=4).of(CAM)
    rows = [metrics(one.train, CAM, speed) for one in trains_as_built(MOTORI, 3, seed=4) for speed in SPEEDS]
    expected = CAM.area_ratio(9.4e-3) - penalty(rows)
    assert float(objective(objective.parameters)) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("maximise", ["area_ratio", "dynamic_area_mm_deg"])
def test_the_gradient_is_that_of_differences(maximise):
    variables = TrainVariables(MOTORI, PRELOADS)
    asked = camopt.objective(MOTORI, speeds_rpm=SPEEDS, maximise=maximise, penalties=PENALTIES, path="exact")
    objective = asked.of(CAM, variables)
    value, start, random = jax.jit(objective), objective.parameters, np.random.default_rng(1)
    slopes = jax.jit(jax.grad(objective))(start)
    assert set(slopes) == {"z", "train"}
    for name, h in (("z", 1e-8), ("train", 1e-7)):
        way = random.normal(size=start[name].shape)
        high, low = (float(value(start | {name: start[name] + sign * h * way})) for sign in (1, -1))
        assert float(slopes[name] @ way) == pytest.approx((high - low) / (2 * h), rel=1e-4)


LAWS = "lifter.leak_N_s_per_m", "guide.slip_N", "guide.stiffness_N_per_m"
PUSHED = {"speeds_rpm": (4000.0,), "penalties": {"seating_velocity_m_per_s": 1.0, "contact_force_max_N": 1e-4}}


class TestLaws:
    """A train with an adjuster and friction, whose numbers scatter and vary as all others do."""

    def test_drawn_trains_have_their_own_laws(self):
        names = *LAWS, "lifter.spring_N_per_m", "lifter.preload_N", "lifter.stiffness_N_per_m"
        scene = REAL.model_copy(update={"tolerance": tuple(Tolerance(of=name, relative=0.1) for name in names)})
        drawn = camopt.objective(scene, trains=2, **PUSHED).of(exponent(scene))
        alone = [camopt.objective(one.scene, **PUSHED) for one in trains_as_built(scene, 2)]
        values = [float(one.of(exponent(scene))(drawn.parameters)) for one in alone]
        assert np.ptp(values) > 1e-3
        assert float(drawn(drawn.parameters)) == pytest.approx(np.mean(values), rel=1e-9)

    def test_leak_and_slip_may_vary(self):
        variables = TrainVariables(REAL, dict.fromkeys(LAWS, (0.5, 2.0)))
        bound = camopt.objective(REAL, **PUSHED).of(exponent(REAL), variables)
        factors = np.array([0.8, 1.3, 1.1])
        there = camopt.objective(variables.scene_with(factors), **PUSHED).of(exponent(REAL))
        value = jax.jit(lambda factors: bound(bound.parameters | {"train": factors}))
        assert float(value(factors)) == pytest.approx(float(there(there.parameters)), rel=1e-9)
        slopes = jax.grad(value)(factors)
        for i, move in enumerate(1e-5 * np.eye(3)):
            assert slopes[i] == pytest.approx(float(value(factors + move) - value(factors - move)) / 2e-5, rel=1e-4)

    def test_a_number_that_moves_an_adjusters_table_is_a_sentence(self):
        with pytest.raises(InputError, match="changes the train nonlinearly"):
            TrainVariables(REAL, {"lifter.stiffness_N_per_m": (0.9, 1.1)})


def test_factors_of_the_train_are_those_of_its_scene():
    variables, factors = TrainVariables(MOTORI, PRELOADS), np.array([1.1, 0.95])
    changed = variables.scene_with(factors)
    assert [e.preload_N for e in changed.element] == pytest.approx([0.0, 275.0, 275.0, 0.0])
    assert changed.mass[0].mass_kg == pytest.approx(0.228)
    asked = camopt.objective(MOTORI, speeds_rpm=SPEEDS, penalties=PENALTIES).of(CAM, variables)
    there = camopt.objective(changed, speeds_rpm=SPEEDS, penalties=PENALTIES).of(CAM)
    both = [float(asked(asked.parameters | {"train": factors})), float(there(there.parameters))]
    assert both[0] == pytest.approx(both[1], rel=1e-9)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"maximise": "area_rate"}, "did you mean 'area_ratio'?"),
        ({"penalties": {"bounce": 1.0}}, "did you mean 'bounce_mm'?"),
        ({"penalties": {"peak_contact_force_N": 1.0}}, "did you mean 'contact_force_max_N'?"),
        ({"maximise": "least_contact_force_N"}, "did you mean 'contact_force_min_N'?"),
        ({"penalties": {"area_ratio": 1.0}}, "'area_ratio': expected one of"),
        ({"path": "event"}, "source 'event': expected one of auto, exact, smooth"),
        ({"speeds_rpm": ()}, "crankshaft speeds above 0"),
        ({"speeds_rpm": (-1,)}, "crankshaft speeds above 0"),
        ({"revolutions": 0}, "at least 1 and 0 are needed"),
    ],
)
def test_unusable_arguments_are_sentences(arguments, words):
    with pytest.raises(InputError) as refused:
        camopt.objective(MOTORI, **arguments)
    assert words in str(refused.value)


@pytest.mark.parametrize(
    ("bounds", "words"),
    [
        ({"spring.preload": (0.9, 1.1)}, "has no such number: expected NAME.KEY of a mass or an element; did you mean"),
        ({"spring.preload_N": (1.1, 1.2)}, "the bounds must enclose 1"),
    ],
)
def test_unusable_variables_of_the_train_are_sentences(bounds, words):
    with pytest.raises(InputError) as refused:
        TrainVariables(MOTORI, bounds)
    assert words in str(refused.value)


def test_a_scene_without_design_has_no_objective():
    with pytest.raises(InputError, match="needs valve, seat"):
        camopt.objective(load_scene("ohv-3dof"))


@pytest.mark.long
def test_both_paths_have_one_value():
    """By a layer of a micrometre of contact, within a hundredth; the slopes are compared by the long test."""
    values = []
    for path in ("exact", "smooth"):
        value = camopt.objective(MOTORI, speeds_rpm=(5500.0,), penalties=PENALTIES, path=path).of(CAM)
        values.append(float(jax.jit(value)(value.parameters)))
    assert values[1] == pytest.approx(values[0], rel=1e-2)
