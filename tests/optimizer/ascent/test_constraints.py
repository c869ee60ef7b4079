"""Constraints along paths: their Lagrangian against its formula and differences, the metric, and what is refused."""

import re
import shutil
import time
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest

import camopt
from camopt.measure.limits import broken_by_shape
from camopt.optimizer.ascent import ascent as climbing
from camopt.optimizer.ascent.lagrangian import FIRST_WEIGHT, GROWTH, PathLagrangian
from camopt.optimizer.program.program_cam import program_cam
from camopt.scene import InputError, load_scene

MOTORI = load_scene("motori-1")
LIMITS = {"contact_force_N": 0.0, "seat_gap_mm": 0.03}
SPEEDS = (5000.0, 6500.0)
ASKED = camopt.objective(MOTORI, speeds_rpm=SPEEDS, constraints=LIMITS)
PAGE = Path(__file__).parents[3] / "docs" / "ascent.md"


@pytest.fixture(scope="module")
def begun():
    """The Lagrangian at a cam whose contacts would have to pull, with what its first round holds."""
    cam = camopt.nearest_free_cam(MOTORI, camopt.polydyne(MOTORI, design_speed_rpm=6000), knot_deg=12)
    bound = ASKED.of(cam)
    lagrangian = PathLagrangian(bound)
    return bound, lagrangian, cam, lagrangian.begin(bound.parameters, cam)


def test_the_lagrangian_is_its_formula_on_the_paths_of_linearised(begun):
    """Forces and gaps are those of `camopt.linearised`, but for the revolutions in which the two have settled."""
    bound, lagrangian, cam, held = begun
    held = held._replace(multipliers={name: 0.0 * row + 0.1 for name, row in held.multipliers.items()})
    value, worst, _ = jax.jit(lagrangian)(0.0, bound.parameters, held)
    linear = camopt.linearised(MOTORI, cam, SPEEDS)
    half = MOTORI.design.duration_deg / 2
    angle = linear.cam_angle_deg.values
    event = (angle >= 2 - half - 1e-9) & (angle < half - 1e-9)
    force = linear.contact_force_N.values[:, event]
    assert force.min() < -50.0
    assert float(worst["contact_force_N"]) == pytest.approx(force.min(), abs=0.1)
    seated = np.asarray(held.seated).T
    assert seated.any() and not seated.all()
    gap = linear.seat_gap_mm.values
    assert float(worst["seat_gap_mm"]) == pytest.approx(gap[seated].max(), abs=1e-5)
    rows = [force.ravel() / float(held.force_unit), 1.0 - gap[seated] / 0.03]
    asked = [np.sum(np.maximum(0.0, 0.1 - FIRST_WEIGHT * row) ** 2) for row in rows]
    free = 0.1**2 * (2 * 1440 * force.shape[-1] + 2 * 1440)
    assert float(value) == pytest.approx(-(sum(asked) - free) / (2 * FIRST_WEIGHT), rel=1e-3)


def test_its_gradient_is_that_of_differences(begun):
    bound, lagrangian, _, held = begun
    value = jax.jit(lambda z: lagrangian(bound({"z": z}), {"z": z}, held)[0])
    z, way = bound.parameters["z"], np.random.default_rng(1).normal(size=bound.parameters["z"].shape)
    slope, h = jax.grad(value)(z), 1e-8
    assert float(slope @ way) == pytest.approx(float(value(z + h * way) - value(z - h * way)) / (2 * h), rel=1e-5)


def test_multipliers_are_what_the_penalty_has_become_and_the_weight_grows_unless_less_is_broken(begun):
    bound, lagrangian, cam, held = begun
    paths = lagrangian.paths(bound.parameters, held)
    later = lagrangian.next(cam, held, paths)
    force = np.asarray(paths.force)
    limited = np.isfinite(held.multipliers["contact_force_N"])
    lowest = np.unravel_index(np.where(limited, force, 0).argmin(), force.shape)
    worst = float(later.worst) * float(held.force_unit)
    assert worst == pytest.approx(-force[lowest], rel=1e-9)
    assert later.multipliers["contact_force_N"][lowest] == pytest.approx(FIRST_WEIGHT * float(later.worst))
    assert np.all(later.multipliers["seat_gap_mm"] >= 0.0)
    assert float(later.weight) == FIRST_WEIGHT  # no violation was known before
    assert np.all(np.asarray(later.start) == np.asarray(paths.end))
    again = lagrangian.next(cam, later, paths)
    assert float(again.weight) == pytest.approx(GROWTH * FIRST_WEIGHT)


def test_a_step_of_the_metric_moves_the_rows_by_one_unit(begun):
    bound, lagrangian, _, held = begun
    z = np.asarray(bound.parameters["z"])
    metric = lagrangian.metric(lambda vector: {"z": vector}, z, held)

    def rows(y):
        rows = lagrangian.rows(held, lagrangian.paths({"z": z + metric @ y}, held))
        return jnp.concatenate([row[jnp.isfinite(row)] for row in rows.values()])

    h = 1e-6
    slopes = np.stack([(rows(h * y) - rows(-h * y)) / (2 * h) for y in np.eye(len(z))], axis=-1)
    product = slopes.T @ slopes / len(slopes)
    assert product == pytest.approx(np.eye(len(z)), abs=1e-3)  # the ridge takes up to 1e-6 times the condition


@pytest.mark.parametrize(
    "optimiser",
    [pytest.param(optax.adam(3e-2), id="adam"), pytest.param(optax.lbfgs(), id="lbfgs", marks=pytest.mark.long)],
)
def test_from_the_calmest_cam_the_area_climbs_within_all_limits(optimiser, monkeypatch, tmp_path):
    """In rounds of four steps; and gone on with from what the folder held after six."""
    monkeypatch.setattr(climbing, "ROUND", 4)
    asked = ASKED, "calmest", optimiser
    chosen = {"knot_deg": 12.0, "judge_every": 2, "metric": True}
    save = climbing.AscentState.save

    def copied(self, path):
        save(self, path)
        if len(self.iterates) == 7:
            shutil.copytree(path.parent, tmp_path / "begun")

    monkeypatch.setattr(climbing.AscentState, "save", copied)
    whole = camopt.ascend(*asked, 10, **chosen, out=tmp_path / "whole")
    history = camopt.ascend(*asked, 10, **chosen, out=tmp_path / "begun", resume=True)
    area = history["area_ratio"].values
    assert area == pytest.approx(whole["area_ratio"].values, rel=1e-6)
    free = program_cam(MOTORI.design, 12.0)
    assert np.abs(history["cam"].values[0]).max() < 1e-12
    assert area[-1] > area[0] + 0.1
    assert all(not broken_by_shape(free.lift(z), MOTORI.design) for z in history["cam"].values)
    assert history.confirmed and history.best.area_ratio(9.4e-3) > area[0] + 0.1
    assert history["contact_force_N"].values[-1] > -60.0 and history["seat_gap_mm"].values.max() < 0.06


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"constraints": {"contact_force": 0.0}}, "expected one of contact_force_N, gap_mm, seat_gap_mm; did you mean"),
        ({"constraints": {"seat_gap_mm": 0.0}}, "above 0 for a gap"),
        ({"constraints": {"contact_force_N": np.nan}}, "expected a number"),
        ({"constraints": LIMITS, "source": "exact"}, "take source='smooth'"),
        ({"constraints": LIMITS, "trains": 4}, "leave out trains"),
        ({"constraints": LIMITS, "tie": 1.5}, "expected a share from 0 to 1"),
        ({"constraints": LIMITS, "width_um": 0.0}, "a width of the contacts' layer above 0"),
    ],
)
def test_unusable_constraints_are_sentences(arguments, words):
    with pytest.raises(InputError) as refused:
        camopt.objective(MOTORI, **arguments)
    assert words in str(refused.value)


@pytest.mark.parametrize(
    ("constraints", "arguments", "words"),
    [
        ({}, {"metric": True}, "give objective() constraints"),
        (LIMITS, {"metric": True, "form": "own"}, "take form='free'"),
        (LIMITS, {"start": "flat"}, "expected a cam, as camopt.polydyne"),
        ({}, {"start": "calmest", "form": "own"}, "it is a free cam"),
        (LIMITS, {"train": {"spring.preload_N": (0.9, 1.1)}}, "leave one of them out"),
    ],
)
def test_what_does_not_go_together_is_a_sentence(constraints, arguments, words):
    objective = camopt.objective(MOTORI, constraints=constraints)
    start = arguments.pop("start", camopt.polydyne(MOTORI, design_speed_rpm=6000))
    with pytest.raises(InputError, match=re.escape(words)):
        camopt.ascend(objective, start, optax.sgd(1e-3), 1, **arguments)


def test_by_default_constraints_hold_at_nine_speeds_of_the_band():
    assert camopt.objective(MOTORI, constraints=LIMITS).speeds_rpm == tuple(np.linspace(*MOTORI.operation.band_rpm, 9))
    assert camopt.objective(MOTORI).speeds_rpm == MOTORI.operation.speeds_rpm


@pytest.mark.long
@pytest.mark.timeout(1200)
def test_from_the_calmest_cam_lbfgs_reaches_what_was_promised():
    """Area ratio 0.556 on `kodama`, confirmed, within 90 s of processor time from the first step on: what is compiled,
    the settled start and the Jacobian come before that step ends. By the lines of the page, but for fewer steps."""
    programs = re.findall(r"```python\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    (program,) = (one for one in programs if 'start="calmest"' in one and "steps=200" in one)
    ended = []
    step = climbing.AscentState.step

    def timed(self, judged):
        step(self, judged)
        ended.append(time.process_time())

    names: dict = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(climbing.AscentState, "step", timed)
        exec(program.replace("steps=200", "steps=90"), names)
    history = names["history"]
    assert history.best.area_ratio(9.4e-3) >= 0.556
    assert ended[-1] - ended[0] < 90.0
