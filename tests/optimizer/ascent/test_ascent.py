"""Ascents: every iterate holds the limits, the objective climbs, the judge decides, and a second start goes on."""

import re
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest

import camopt
from camopt.cam.design_file import read_design
from camopt.cam.families.exponent import exponent
from camopt.cam.families.free import free_cam
from camopt.measure.limits import broken_by_shape
from camopt.optimizer.ascent import ascent as climbing
from camopt.optimizer.ascent.history import NEAREST
from camopt.optimizer.ascent.variables import FamilyVariables
from camopt.optimizer.program.kinematic import kinematic_optimum
from camopt.scene import InputError, load_scene
from camopt.scene.units import MM_PER_DEG2
from tests.exact.test_real_trains import SCENE as REAL

MOTORI = load_scene("motori-1")
assert MOTORI.design is not None
START = camopt.polydyne(MOTORI, design_speed_rpm=6000)
PENALTIES = {"bounce_mm": 1.0, "jump_mm": 1.0}
EASY = camopt.objective(MOTORI, speeds_rpm=(4000, 5000), penalties=PENALTIES, path="exact")
HARD = camopt.objective(MOTORI, speeds_rpm=(5000, 6000, 7000), penalties=PENALTIES, path="exact")
PAGE = Path(__file__).parents[3] / "docs" / "ascent.md"


def lifts(history, knot_deg):
    return [free_cam(MOTORI.design, knot_deg).lift(z) for z in history["cam"].values]


def low_start():
    """A cam within the limits with much less area than they allow."""
    cam = free_cam(MOTORI.design, 6.0)
    return cam.lift(0.9 * kinematic_optimum(MOTORI.design, cam).z)


@pytest.mark.parametrize(
    ("optimiser", "steps"),
    [
        pytest.param(optax.adam(2e-4), 40, id="adam"),
        pytest.param(optax.sgd(1e-4), 40, id="sgd", marks=pytest.mark.long),
        pytest.param(optax.lbfgs(), 10, id="lbfgs", marks=pytest.mark.long),
    ],
)
def test_where_nothing_bounces_the_area_climbs_to_the_programs(optimiser, steps):
    largest = kinematic_optimum(MOTORI.design, free_cam(MOTORI.design, 6.0)).area_ratio
    history = camopt.ascend(EASY, low_start(), optimiser, steps, judge_every=steps // 2)
    assert all(not broken_by_shape(lift, MOTORI.design) for lift in lifts(history, 6.0))
    value = history["objective"].values
    assert value[0] < largest - 0.005
    assert largest - 0.003 < value.max() <= largest + 1e-9
    assert history["judged"].values.nonzero()[0].tolist() == [0, steps // 2, steps]
    assert history.confirmed and history.best.area_ratio(9.4e-3) == pytest.approx(
        float(history["area_ratio"].max()), 1e-3
    )


def test_a_cam_that_bounces_far_beyond_its_limits_ends_in_one_that_the_judge_confirms():
    history = camopt.ascend(HARD, START, optax.adam(1e-3), 60, knot_deg=6.0)
    share = history["largest_share"].values
    assert share[0] > 50 and history.confirmed and 0.35 < history.best.area_ratio(9.4e-3) < 0.5
    best = history.dataset.attrs["best"]
    holding = history["objective"].values[(share <= 1.0)]
    assert share[best] <= 1.0 and history["objective"].values[best] == holding.max()
    assert not broken_by_shape(history.best, MOTORI.design)
    assert all(not broken_by_shape(lift, MOTORI.design) for lift in lifts(history, 6.0))
    assert "step " in repr(history) and "holds every limit" in history._repr_html_()
    assert len(history.plot().axes) == 3


def test_where_no_cam_holds_there_is_no_best_one_but_a_nearest(tmp_path):
    history = camopt.ascend(HARD, START, optax.adam(1e-3), 2, knot_deg=12.0, judge_every=1, out=tmp_path / "x")
    share = history["largest_share"].values
    assert share.min() > 1.0 and not history["holds"].any()
    assert history.best is None and history.best_scene is None and not history.confirmed
    assert "best" not in history.dataset.attrs and history.dataset.attrs["nearest"] == int(share.argmin())
    nearest = lifts(history, 12.0)[int(share.argmin())]
    assert history.nearest.coefficients == pytest.approx(nearest.coefficients, rel=1e-12)
    assert "none of the 3 judged cams holds all limits; the nearest is that of step " in repr(history)
    assert len(history.plot().axes) == 3
    assert (tmp_path / "x" / "nearest.json").exists() and not (tmp_path / "x" / "design.json").exists()
    with pytest.raises(InputError, match="None in place of a cam"):
        camopt.verify(MOTORI, history.best)


def test_trains_with_other_laws_are_taken_and_no_docstring_refuses_them():
    """The first of them has no limit on the motion, either, of which a judge might use a share."""
    objective = camopt.objective(REAL, speeds_rpm=(3000,), penalties={"contact_force_max_N": 1e-4})
    history = camopt.ascend(objective, exponent(REAL), optax.adam(1e-4), 1, knot_deg=14.0)
    assert np.all(history["gradient_norm"].values > 0)
    scene = load_scene("finger-hydraulic")
    found = camopt.manufacturing_yield(scene, camopt.read_cam("polydyne", scene), 2, speeds_rpm=(3000,))
    assert len(found.used.used) == 2
    for function in (camopt.ascend, camopt.objective, camopt.manufacturing_yield):
        assert "linear" not in (function.__doc__ or "")


def test_numbers_of_the_train_vary_within_their_bounds():
    """Less spring force is less contact force: both factors fall, that on the preload to its bound."""
    spring, both = "spring.stiffness_N_per_m", ("spring.preload_N", "seat.preload_N")
    train = {spring: (0.9, 1.1), both: (0.98, 1.02)}
    objective = camopt.objective(MOTORI, speeds_rpm=(3000,), penalties={"contact_force_max_N": 1e-3}, path="exact")
    history = camopt.ascend(objective, START, optax.adam(3e-3), 12, knot_deg=12.0, train=train, judge_every=12)
    factors = history["train"]
    assert list(factors["factor"].values) == [spring, "spring.preload_N = seat.preload_N"]
    assert np.all(factors.values[0] == 1.0)
    assert 1 - 12 * 0.003 < factors.values[-1, 0] < 0.99 and factors.values[-1, 1] == 0.98
    changed = history.best_scene.element
    assert history.dataset.attrs["best"] == 12 and history.confirmed
    assert changed[1].stiffness_N_per_m == pytest.approx(38200.0 * float(factors[-1, 0]))
    assert changed[1].preload_N == changed[2].preload_N == pytest.approx(245.0)


def test_a_line_search_sees_the_value_and_its_slope_at_the_nearest_point_within_the_limits():
    """At a point itself what the transformation is given, and beyond the limits central differences."""
    seen = []

    def update(downhill, state, point, *, value, grad, value_fn, **_):
        uphill, way = -grad["cam"], jnp.cos(jnp.arange(grad["cam"].size))
        beyond = point["cam"] + 3e-3 * uphill / jnp.abs(uphill).max()
        loss = jax.value_and_grad(lambda cam: value_fn(point | {"cam": cam}))
        pair = [float(loss(beyond + h * way)[0]) for h in (1e-8, -1e-8)]
        seen.append((loss(point["cam"]), (value, grad["cam"]), loss(beyond)[1] @ way, (pair[0] - pair[1]) / 2e-8))
        return {name: -1e-3 * part for name, part in downhill.items()}, state

    camopt.ascend(EASY, low_start(), optax.GradientTransformationExtraArgs(lambda _: (), update), 1)
    for (value, slopes), given, slope, difference in seen:
        assert float(value) == pytest.approx(float(given[0]), rel=1e-12)
        assert np.asarray(slopes) == pytest.approx(np.asarray(given[1]), abs=1e-9)
        assert abs(difference) > 0.1 and float(slope) == pytest.approx(difference, rel=1e-5)


class TestOwnParameters:
    def test_a_members_own_parameters_climb_within_the_limits(self):
        """The one limit is a hundredth beyond what the start has, so that it soon holds the climb back."""
        highest = 1.01 * START.extremes(2)[1]
        none = dict.fromkeys(("acceleration_min_mm_per_deg2", "jerk_max_mm_per_deg3", "nose_deg"))
        limits = {**none, "acceleration_max_mm_per_deg2": highest / MM_PER_DEG2}
        scene = MOTORI.model_copy(update={"design": MOTORI.design.model_copy(update=limits)})
        objective = camopt.objective(scene, speeds_rpm=(4000,), path="exact")
        history = camopt.ascend(objective, START, optax.sgd(1.0), 3, form="own", judge_every=1)
        area, best = history["area_ratio"].values, history.best
        assert area[0] == pytest.approx(START.area_ratio(9.4e-3)) and area.max() > area[0] + 1e-4
        assert best.family == "polydyne (ascended)" and not broken_by_shape(best, scene.design)
        again = camopt.polydyne(scene, (2, *best.parameters["exponents"]), best.parameters["speed_rpm"])
        theta = np.linspace(-1.2, 1.2, 100)
        assert np.abs(again(theta) - best(theta)).max() < 1e-9
        assert best.extremes(2)[1] == pytest.approx(highest, rel=1e-3)

    def test_factors_that_give_no_cam_are_a_sentence(self):
        with pytest.raises(InputError, match="no member of polydyne near this one holds the design's limits"):
            FamilyVariables(MOTORI, camopt.polydyne(MOTORI)).nearest(-np.ones(5))

    @pytest.mark.long
    def test_a_family_without_a_member_near_is_a_sentence(self):
        with pytest.raises(InputError, match="no member of polydyne near this one holds the design's limits"):
            camopt.ascend(EASY, START, optax.adam(1e-3), 1, form="own")


class TestFolder:
    @pytest.mark.long
    def test_an_ascent_that_was_interrupted_goes_on_to_the_last_digit(self, tmp_path, monkeypatch):
        whole = camopt.ascend(HARD, START, optax.adam(1e-3), 8, knot_deg=12.0, judge_every=2, out=tmp_path / "whole")
        step, broken = climbing.AscentState.step, []

        def interrupted(self, judged):
            if len(self.iterates) == 5 and not broken:
                broken.append(True)
                raise KeyboardInterrupt
            step(self, judged)

        monkeypatch.setattr(climbing.AscentState, "step", interrupted)
        asked = HARD, START, optax.adam(1e-3), 8
        with pytest.raises(KeyboardInterrupt):
            camopt.ascend(*asked, knot_deg=12.0, judge_every=2, out=tmp_path / "x")
        with pytest.raises(InputError, match="interrupted ascend run"):
            camopt.ascend(*asked, knot_deg=12.0, judge_every=2, out=tmp_path / "x")
        again = camopt.ascend(*asked, knot_deg=12.0, judge_every=2, out=tmp_path / "x", resume=True)
        assert again.dataset.identical(whole.dataset)
        cam, file = (again.best, "design.json") if again.confirmed else (again.nearest, NEAREST)
        names = {"ascent.json", file, "history.csv", "run.json", "scene.toml", "figures"}
        assert {path.name for path in (tmp_path / "x").iterdir()} == names
        for name in names - {"run.json", "figures"}:
            assert (tmp_path / "x" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()
        assert read_design(tmp_path / "x" / file, MOTORI).coefficients == pytest.approx(cam.coefficients, rel=1e-12)

    def test_another_objective_is_refused(self, tmp_path):
        camopt.ascend(EASY, START, optax.adam(1e-3), 1, knot_deg=12.0, out=tmp_path / "x")
        with pytest.raises(InputError, match="its settings differ"):
            camopt.ascend(HARD, START, optax.adam(1e-3), 1, knot_deg=12.0, out=tmp_path / "x", resume=True)


@pytest.mark.parametrize(
    "arguments", [{"form": "cam"}, {"steps": 0}, {"judge_every": 0}], ids=["form", "steps", "judge_every"]
)
def test_unusable_arguments_are_sentences(arguments):
    with pytest.raises(InputError, match="expected free or own, and numbers from 1 on"):
        camopt.ascend(EASY, START, optax.adam(1e-3), **arguments)


GAINED = 0.5
"""Area ratio that the page's climb gains at least: the calmest cam has 0.06, and fifty steps lead close to 0.6."""
PROGRAMS = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)


@pytest.mark.parametrize(
    ("optimiser", "steps"),
    [("optax.adam(1e-3)", 50), ("optax.lbfgs()", 4), pytest.param("optax.lbfgs()", 50, marks=pytest.mark.long)],
)
def test_the_lines_of_the_page_run_on_the_exact_path(optimiser, steps, capsys):
    program = PROGRAMS[0].replace('source="smooth"', 'source="exact"').replace("optax.adam(1e-3)", optimiser)
    program = program.replace("steps=50", f"steps={steps}")
    assert 'source="exact"' in program and optimiser in program and f"steps={steps})" in program
    exec(program, names := {})
    assert "holds every limit" in capsys.readouterr().out
    area = names["history"]["area_ratio"]
    assert float(area[-1] - area[0]) > (GAINED if "adam" in optimiser else 0.0)


@pytest.mark.long
@pytest.mark.timeout(1200)
def test_the_lines_of_the_page_run_as_printed(capsys):
    exec(PROGRAMS[0], names := {})
    assert "smooth path, 50 steps" in capsys.readouterr().out and names["history"].confirmed
    area = names["history"]["area_ratio"]
    assert float(area[-1] - area[0]) > GAINED
    exec(PROGRAMS[1], {})
    assert re.match(r"\[.*\d", capsys.readouterr().out)


@pytest.mark.long
@pytest.mark.timeout(1200)
def test_both_paths_climb_alike():
    values = {}
    for path in ("exact", "smooth"):
        objective = camopt.objective(MOTORI, speeds_rpm=(5500.0,), penalties=PENALTIES, path=path)
        values[path] = camopt.ascend(objective, START, optax.adam(1e-3), 3, knot_deg=12.0)["objective"].values
    assert values["smooth"] == pytest.approx(values["exact"], rel=1e-2)


LINES = """
import camopt, optax

scene = camopt.load_scene("motori-1")
start = camopt.polydyne(scene, exponents=(2, 10, 18, 26, 34), design_speed_rpm=3000)
objective = camopt.objective(scene, speeds_rpm=(4000, 5000), maximise="area_ratio",
                             penalties={"bounce_mm": 1.0, "jump_mm": 1.0}, path="smooth")
history = camopt.ascend(objective, start, optax.adam(1e-3), steps=50)
history.plot(); camopt.verify(scene, history.best)
"""
"""What a researcher was promised, but for a design speed that this family does not have. Speeds are crankshaft r/min,
and at 3000 the Polydyne of these exponents would rise to 13 mm; 3000 camshaft r/min, as MOTORI 2004 counts, are
6000."""


def promised(*changes: tuple[str, str]):
    """The history of the promised lines with a working design speed and other changes."""
    text = LINES
    for printed, words in (("design_speed_rpm=3000", "design_speed_rpm=6000"), *changes):
        assert printed in text
        text = text.replace(printed, words)
    exec(text, names := {})
    return names["history"]


def test_the_printed_design_speed_is_refused_with_a_remedy():
    with pytest.raises(InputError, match=r"would rise to 13.24 mm .* try a higher speed_rpm"):
        exec(LINES, {})


def test_some_steps_from_the_promised_start():
    quickly = (
        ('path="smooth"', 'path="exact"'),
        ("steps=50", "steps=4"),
        ("camopt.verify(scene, history.best)", "history"),
    )
    history = promised(*quickly)
    assert history.dataset.sizes["step"] == 5 and history.confirmed


@pytest.mark.long
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("optimiser", ["optax.adam(1e-3)", "optax.lbfgs()"])
@pytest.mark.parametrize("path", ["smooth", "exact"])
def test_the_promised_lines_in_full(path, optimiser):
    history = promised(('path="smooth"', f'path="{path}"'), ("optax.adam(1e-3)", optimiser))
    assert history.dataset.sizes["step"] == 51 and history.confirmed
