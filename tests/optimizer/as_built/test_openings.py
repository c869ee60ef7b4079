"""Openings foretold from tied forces, these forces, and the program on them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from camopt.measure.as_built import trains_as_built
from camopt.optimizer.as_built.exact_forces import EDGES, exact_forces
from camopt.optimizer.as_built.openings_program import BROKEN, LONG, STEP, OpeningsProgram, opening_rows
from camopt.optimizer.as_built.search import band_speeds, free_program
from camopt.optimizer.as_built.smooth_forces import SmoothForces
from camopt.optimizer.program.periodic import periodic_response, sample_cam
from camopt.optimizer.program.phases import LIFTED, phase_contacts, static_angles
from camopt.scene import load_scene
from camopt.scene.errors import NoCamFound
from camopt.scene.train import build_train


@pytest.fixture(scope="module")
def kodama():
    """Scene, program of the shape, a cam of it, cam speeds, drawn trains, and the angles and values of their forces."""
    scene = load_scene("kodama")
    plain, z = free_program(scene)
    speeds, trains = band_speeds(scene)[:2, -2:], trains_as_built(scene, 12, seed=4)
    return plain, z, speeds, trains, exact_forces(trains, plain.train, plain.cam, speeds)


@pytest.mark.parametrize("contact", [0, 1])
def test_a_contact_opens_as_its_train_moves_without_the_force_that_it_lacks(contact):
    """By DOP853 on the train whose contact is open, under the tied force taken away from both its sides."""
    train, speed, count = build_train(load_scene("kodama")), 366.0, 30
    element = train.cam_side[contact]
    force = lambda angle: -200.0 * np.sin(np.pi * np.clip(angle / (20 * STEP), 0.0, 1.0))  # noqa: E731
    closed = phase_contacts(train)[LIFTED].copy()
    closed[element] = False
    d, n = train.incidence, len(train.mass)
    k, c = train.stiffness * closed, train.damping * closed

    def rate(t, y):
        u, v = d @ y[:n], d @ y[n:]
        push = -d.T @ (k * u + c * v) - train.mass_damping * y[n:] - d[element] * force(speed * t)
        return np.concatenate([y[n:], push / train.mass])

    end = (count - 1) * STEP / speed
    motion = solve_ivp(rate, (0.0, end), np.zeros(2 * n), "DOP853", rtol=1e-10, atol=1e-15, dense_output=True)
    at = np.arange(count) * STEP
    truth = motion.sol(at / speed)[:n].T @ d[element]
    rows = opening_rows(train, element, speed, count)
    longest = rows[-1] @ force(at)
    within = at <= LONG[-1] * STEP
    assert truth.max() > 2e-5  # m: it opens, where the tied force pulls
    np.testing.assert_allclose(longest[within], truth[within], atol=0.02 * truth.max())  # trapezoids of a degree
    assert rows.shape == (len(LONG), count, count) and not rows[0][20, :13].any()  # what is older counts for nothing


def test_forces_have_the_errors_of_the_ground_cam(kodama):
    """Against the response to the ground cam itself, whose own pieces are its steps."""
    plain, z, speeds, trains, (theta, forces) = kodama
    one, cam = trains[1], plain.cam
    found = forces[1] @ np.append(1.0, z)
    angles = static_angles(one.train, cam)
    samples = sample_cam(cam, angles, EDGES, one.cam(cam.lift(z)))
    smooth = forces[1, ..., 1:] @ z
    for s, speed in enumerate(speeds[1]):
        response = periodic_response(one.train, samples, speed, angles)
        for c, element in enumerate(one.train.cam_side):
            force = response.force(element, np.arange(len(samples.edges)))[:, 0]
            expected = np.interp(theta, samples.edges, force)
            assert np.abs(found[s, c] - expected).max() < 0.01 * np.ptp(expected)
    _, plain_forces = exact_forces([one], plain.train, cam, speeds[1:])
    assert np.allclose(plain_forces[0, ..., 1:] @ z, smooth)


def test_the_smoothed_motion_has_the_same_forces(kodama):
    """Its layer of a micrometre and its steps of a quarter of a degree move them by some newtons of more than 1500."""
    plain, z, speeds, trains, (theta, forces) = kodama
    smooth = SmoothForces(trains[:2], plain.train, plain.cam, speeds)
    of_exact = forces[:2] @ np.append(1.0, z)
    of_smooth = smooth.about(z) @ np.append(1.0, z)
    for c in range(2):
        at_same = [np.interp(theta, smooth.theta, force) for force in of_smooth[:, 0, c]]
        inside = (theta > smooth.theta[0]) & (theta < smooth.theta[-1])
        apart = np.abs(np.array(at_same) - of_exact[:, 0, c])[:, inside]
        assert np.median(apart) < 0.02 * np.ptp(of_exact[:, 0, c])


def test_rows_first_working_decide_the_time_alone(kodama, monkeypatch):
    plain, z, speeds, _, (theta, forces) = kodama
    found = []
    for _ in range(2):
        program = OpeningsProgram(plain, theta, speeds, forces)
        found.append(program.largest(z, np.full(program.cam_speeds.shape, 4e-5), 3))
        monkeypatch.setattr(OpeningsProgram, "_first_working", lambda *_: None)
    assert found[0].area_ratio == pytest.approx(found[1].area_ratio, abs=1e-9)
    assert found[0].lift.coefficients == pytest.approx(found[1].lift.coefficients, rel=1e-5, abs=1e-9)


def test_no_train_that_is_kept_opens_more_than_its_limit(kodama):
    plain, z, speeds, trains, (theta, forces) = kodama
    areas = []
    for lost, limit in ((0, 2e-5), (0, 4e-5), (3, 4e-5)):
        program = OpeningsProgram(plain, theta, speeds, forces)
        found = program.largest(z, np.full(program.cam_speeds.shape, limit), lost)
        cases = np.argwhere(np.ones((len(trains), 2), dtype=bool))
        worst = program.predicted_openings(found.z, cases).max(axis=(1, 2)).reshape(-1, 2).max(axis=1)
        assert np.sum(~program.kept) == lost
        assert worst[program.kept].max() == pytest.approx(limit, abs=BROKEN + 1e-9)
        assert np.all(worst[~program.kept] > limit)
        areas.append(found.area_ratio)
    assert areas[0] < areas[1] < areas[2]


def test_a_train_whose_lash_no_ramp_takes_has_forces_at_the_usual_angles(kodama):
    """Twice the tolerances ended the search with the sentence that is meant for a scene."""
    plain, _, speeds, trains, _ = kodama
    one = trains[0]
    lash = int(np.argmax(one.train.gap))
    gap = one.train.gap.copy()
    gap[lash] += 2e-4
    wide = replace(one, train=replace(one.train, gap=gap))
    with pytest.raises(NoCamFound, match="must lie on the opening ramp"):
        static_angles(wide.train, plain.cam)
    _, found = exact_forces([wide], plain.train, plain.cam, speeds[:1])
    assert np.all(np.isfinite(found)) and found[0, ..., 0].max() > 0.0
