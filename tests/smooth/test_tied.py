"""Motions with tied contacts: the low-storage method, the tie's two ends, and slopes against the closed response."""

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from camopt import load_scene
from camopt.optimizer.ascent.projection import ShapeLimits
from camopt.optimizer.program.force_rows import PEAK, SEAT
from camopt.optimizer.program.no_jump import NoJumpProgram, no_jump_program
from camopt.optimizer.program.program_cam import program_cam
from camopt.optimizer.program.relocation import relocate
from camopt.optimizer.search.search import without_rows
from camopt.optimizer.search.smooth_rows import SMALL_N, SmoothRows
from camopt.scene.train import build_train
from camopt.smooth.laws import Layer
from camopt.smooth.rest import rest_state
from camopt.smooth.simulate import lift_samples
from camopt.smooth.tied import (
    LARGEST_PHASE,
    STEPS,
    WIDTH,
    LowStorage,
    parts_of_steps,
    tied_paths,
    tied_system,
)
from experiments.support.smooth_batch import batch_motion, stage_lifts

HALF = np.deg2rad(72.0)
IMAGINARY_LIMIT = 3.34
"""Largest phase of an undamped oscillation per step for which the method is stable."""


def swung(steps: int, parts: int = 1, turns: int = 1) -> jax.Array:
    """State of an undamped oscillation from (1, 0) after some turns."""
    grid = jnp.linspace(0.0, 2 * jnp.pi * turns, steps + 1)
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(lambda t, y, _: jnp.stack([y[1], -y[0]])), LowStorage(parts), grid[0], grid[-1], None,
        jnp.array([1.0, 0.0]), stepsize_controller=diffrax.StepTo(ts=grid), max_steps=steps,
    )  # fmt: skip
    assert solution.ys is not None
    return solution.ys[-1]


def oscillation(steps: int, parts: int = 1) -> float:
    """Error of an undamped oscillation over one turn."""
    return float(jnp.linalg.norm(swung(steps, parts) - jnp.array([1.0, 0.0])))


def test_the_method_has_order_four():
    assert oscillation(20) / oscillation(40) == pytest.approx(16.0, rel=0.15)


def test_parts_of_a_step_are_steps():
    assert oscillation(20, parts=3) == pytest.approx(oscillation(60), rel=1e-9)


def test_the_method_is_stable_up_to_its_limit_and_no_further():
    within, beyond = (int(2 * np.pi / (factor * IMAGINARY_LIMIT) * 200) for factor in (0.98, 1.02))
    turns = 200

    def growth(steps: int) -> float:
        return float(jnp.linalg.norm(swung(steps, turns=turns)))

    assert growth(within) < 1.0
    assert growth(beyond) > 1.0
    assert np.sqrt(2.0) * LARGEST_PHASE < IMAGINARY_LIMIT


@pytest.mark.parametrize("name", ["motori-1", "finger-hydraulic"])
def test_without_a_tie_the_motion_is_that_of_the_scene(name):
    """Against the batch on equal steps of another method (Dormand and Prince), with the same layer."""
    scene = load_scene(name)
    train, lift = build_train(scene), program_cam(scene.design, 6.0).lift(np.zeros(_size(scene)))
    speeds = np.array([scene.cam_speed(rpm) for rpm in scene.operation.band_rpm])
    tied = tied_system(train)
    start = jnp.repeat(rest_state(train)[:, :, None], 2, axis=2)
    samples = jnp.asarray(lift_samples(lift, STEPS))
    paths = tied_paths(
        tied,
        samples,
        jnp.asarray(speeds),
        start,
        (-HALF, HALF),
        0.0,
        Layer(WIDTH),
        parts=8 * parts_of_steps(tied, speeds.min()),
    )
    stages = jnp.asarray(np.repeat(stage_lifts(lift, 8 * STEPS)[..., None], 2, axis=-1))
    other = batch_motion(tied.system, stages, jnp.asarray(speeds), start)
    forces = np.asarray(other.force)[:, 8::8, list(train.cam_side)]
    assert np.asarray(paths.force).transpose(2, 0, 1) == pytest.approx(forces, abs=2.0)  # N, of some hundreds


def _size(scene) -> int:
    return program_cam(scene.design, 6.0).Z.shape[1]


@pytest.mark.parametrize("name", ["motori-1", "pushrod-5mass"])
def test_slopes_are_those_of_the_closed_response(name):
    """Of every contact force in the event, at the angles at which the motion itself changes its contacts."""
    scene = load_scene(name)
    train, cam = build_train(scene), program_cam(scene.design, 6.0)
    z = np.zeros(cam.Z.shape[1])
    speeds = [scene.cam_speed(rpm) for rpm in scene.operation.band_rpm]
    program = without_rows(train, scene.design, cam, speeds)
    source = SmoothRows(program)
    program, _ = source.first(program, z)
    for _ in range(4):
        program = source.about(program, z)
    closed = relocate(no_jump_program(train, scene.design, cam, speeds), cam.lift(z))
    for smooth, exact in zip(program.blocks, closed.blocks, strict=True):
        for element in train.cam_side:
            matrices = []
            for rows in (smooth, exact):
                chosen = (rows.element == element) & (rows.kind != PEAK) & (rows.kind != SEAT)
                matrices.append((np.round(np.rad2deg(rows.angle[chosen]), 6), rows.matrix[chosen]))
            (angle, mine), (theirs_at, theirs) = matrices
            _, i, j = np.intersect1d(angle, theirs_at, return_indices=True)
            assert len(i) > 100
            assert np.linalg.norm(mine[i] - theirs[j]) < 0.01 * np.linalg.norm(theirs[j])


def rows_of_an_adjuster(*speeds_rpm: float) -> tuple[SmoothRows, NoJumpProgram, np.ndarray]:
    """Rows at speeds up to the top of the band, their program, and a drawn cam with which the valve hangs 2 mm off its
    seat there; with the calmest one it seats."""
    scene = load_scene("pushrod-hydraulic")
    cam = program_cam(scene.design, 6.0)
    drawn = np.random.default_rng(1).normal(0.0, scene.design.acceleration_max_mm_per_deg2, cam.Z.shape[1])
    program = without_rows(build_train(scene), scene.design, cam, [scene.cam_speed(rpm) for rpm in speeds_rpm])
    return SmoothRows(program), program, ShapeLimits(cam, scene.design).nearest(drawn)


def test_a_cam_that_pumps_an_adjuster_up_is_too_far():
    source, program, wild = rows_of_an_adjuster(5800)
    program, _ = source.first(program, np.zeros_like(wild))
    assert np.all(source.errors_at(program, wild) == np.inf)
    assert np.all(source.errors_at(program, 0.01 * wild) < 1.0)


def test_a_search_with_an_adjuster_begins_where_no_contact_pulls():
    source, program, wild = rows_of_an_adjuster(5800)
    program, z = source.first(program, wild)
    assert 0.0 < np.linalg.norm(z) < np.linalg.norm(wild)
    assert program.forces(z)[program.kind != SEAT].min() >= -SMALL_N


def test_each_speed_has_its_own_error_of_the_foretold_forces():
    def errors(*speeds_rpm: float) -> np.ndarray:
        source, program, wild = rows_of_an_adjuster(*speeds_rpm)
        program, _ = source.first(program, np.zeros_like(wild))
        return source.errors_at(program, 0.05 * wild)

    low, high = errors(3500, 5800)
    assert high == pytest.approx(errors(5800)[0], rel=1e-6) and 0.0 < low < 0.5 * high
