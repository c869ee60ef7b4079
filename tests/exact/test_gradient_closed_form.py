"""The exact gradient against closed forms (a bouncing ball, a collision), and from rest and in periodic motion."""

from dataclasses import replace

import numpy as np
import pytest

from camopt.exact.adjoint.motion import Samples, TracedMotion, rest_back, value_and_gradient
from camopt.scene.rest import rest_position, state_at_rest
from tests.exact.gradient_problems import by_train, cam_with_bumps, kodama
from tests.exact.small_trains import GRAVITY, ONCE_A_SECOND, STILL, ball, collision, one_mass, spring


def test_bouncing_ball_without_damping():
    """Height after one bounce: with fall time T, contact time C and time t since take-off, x = v t - g t^2 / 2."""
    k, height = 1e5, 0.1
    train = ball(k, 0.0)
    motion = TracedMotion(train, STILL, 2 * np.pi / 0.4, np.array([height, 0.0]), mechanical=True)

    def end(height, k, g):
        fall, omega = np.sqrt(2 * height / g), np.sqrt(k)
        speed = g * fall
        contact = 2 * (np.pi - np.arctan2(speed / omega, g / k)) / omega
        after = 0.4 - fall - contact
        return np.array([speed * after - g * after**2 / 2, speed - g * after])

    def slope(f, at):
        h = 1e-5 * at
        return (f(at + h) - f(at - h)) / (2 * h)

    assert motion.end == pytest.approx(end(height, k, GRAVITY), rel=1e-9)
    slopes = motion.pull_back(ends=np.eye(2))
    assert slopes.by_start[:, 0] == pytest.approx(slope(lambda a: end(a, k, GRAVITY), height), rel=1e-7)
    assert by_train(slopes).stiffness[:, 1] == pytest.approx(slope(lambda a: end(height, a, GRAVITY), k), rel=1e-7)
    by_weight = slope(lambda a: end(height, k, a), GRAVITY)
    assert -by_train(slopes).mass_force[:, 0] == pytest.approx(by_weight, rel=1e-7)
    by_mass = slope(lambda a: end(height, k / a, GRAVITY / a), 1.0)
    assert by_train(slopes).mass[:, 0] == pytest.approx(by_mass, rel=1e-7)


@pytest.mark.parametrize("weight", [1.0, -0.3])
def test_the_force_of_a_spring_follows_the_start_as_its_swing_does(weight):
    """At time t the spring pushes with -k (x0 cos 20 t + v0 sin 20 t / 20)."""
    motion, angle = TracedMotion(one_mass(spring(400.0)), STILL, ONCE_A_SECOND, np.array([0.01, 0.0])), 0.5
    still, force = np.zeros((1, 1, 1)), np.full((1, 1, 1), weight)
    bars = Samples(still, still, still[0], still[0], force, np.zeros((1, 1, 0)))
    turn = 20.0 * (angle + np.pi) / ONCE_A_SECOND
    wanted = -400.0 * weight * np.array([np.cos(turn), np.sin(turn) / 20.0])
    assert motion.pull_back(np.array([angle]), bars).by_start[0] == pytest.approx(wanted, rel=1e-9)


def test_damped_contact_reverses_a_fast_ball_by_its_coefficient_of_restitution():
    """Without gravity a contact m x'' = -k x - c x' lets go where its force is zero, the phase below later."""
    k, c, speed, distance = 1e6, 400.0, 2.0, 0.01
    train = replace(ball(k, c), mass_force=np.zeros(1))
    motion = TracedMotion(train, STILL, 2 * np.pi / 0.02, np.array([distance, -speed]), mechanical=True)

    def end(speed, distance, c, k):
        omega, decay = np.sqrt(k - c**2 / 4), c / 2
        # x'' = 0 at let go: v0 e^{-decay t} (-c cos + (decay^2 - omega^2) / omega sin) = 0
        phase = np.arctan2(c * omega, decay**2 - omega**2)
        time = phase / omega
        shape = np.exp(-decay * time)
        x = -speed * shape * np.sin(phase) / omega
        v = -speed * shape * (np.cos(phase) - decay / omega * np.sin(phase))
        return np.array([x + v * (0.02 - distance / speed - time), v])

    assert motion.end == pytest.approx(end(speed, distance, c, k), rel=1e-10)
    slopes = motion.pull_back(ends=np.eye(2))
    at = np.array([speed, distance, c, k])
    wanted = []
    for i in range(4):
        step = np.eye(4)[i] * 1e-5 * at
        wanted.append((end(*(at + step)) - end(*(at - step))) / (2 * step[i]))
    assert -slopes.by_start[:, 1] == pytest.approx(wanted[0], rel=1e-8)
    assert slopes.by_start[:, 0] == pytest.approx(wanted[1], rel=1e-8, abs=1e-8)
    assert by_train(slopes).damping[:, 1] == pytest.approx(wanted[2], rel=1e-8)
    assert by_train(slopes).stiffness[:, 1] == pytest.approx(wanted[3], rel=1e-8)


def test_two_bodies_collide_elastically():
    """Speeds after: v1 = ((m1 - m2) u1 + 2 m2 u2) / (m1 + m2), v2 = ((m2 - m1) u2 + 2 m1 u1) / (m1 + m2)."""
    u1, u2, m1, m2 = 2.0, -1.0, 1.0, 3.0
    train = collision(m1, m2, 1e8)
    motion = TracedMotion(train, STILL, 2 * np.pi / 0.02, np.array([-0.01, 0.01, u1, u2]), mechanical=True)
    total = m1 + m2
    v1, v2 = ((m1 - m2) * u1 + 2 * m2 * u2) / total, ((m2 - m1) * u2 + 2 * m1 * u1) / total
    assert motion.end[2:] == pytest.approx([v1, v2], rel=1e-6)
    slopes = motion.pull_back(ends=np.eye(4)[2:])
    by_speeds = np.array([[(m1 - m2), 2 * m2], [2 * m1, (m2 - m1)]]) / total
    assert slopes.by_start[:, 2:] == pytest.approx(by_speeds, rel=1e-6)
    by_masses = np.array([[2 * m2, -2 * m1], [2 * m2, -2 * m1]]) * (u1 - u2) / total**2
    assert by_train(slopes).mass == pytest.approx(by_masses, rel=1e-6)


def test_rest_follows_the_train():
    _, train = kodama()
    random = np.random.default_rng(3)
    by_start = np.concatenate([random.normal(size=(2, 10)), np.zeros((2, 10))], axis=1)
    found = rest_back(train, by_start)
    for name in ("mass_force", "stiffness", "preload", "gap"):
        value = getattr(train, name)
        for i in range(len(value)):
            step = 1e-5 * (abs(value[i]) or {"gap": 1e-4}.get(name, 10.0)) * np.eye(len(value))[i]
            up, down = (rest_position(replace(train, **{name: value + sign * step})) for sign in (1, -1))
            wanted = by_start[:, :10] @ (up - down) / (2 * step[i])
            assert getattr(found, name)[:, i] == pytest.approx(
                wanted, rel=1e-5, abs=1e-7 * np.abs(wanted).max() + 1e-13
            )


def test_periodic_motion_follows_the_cam():
    """Against central differences of the periodic state, found again by Newton's method with the cycle's Jacobian."""
    scene, train = kodama()
    lift, bumps = cam_with_bumps("design", 20)
    speed, direction = scene.cam_speed(5000), np.tensordot(np.cos(np.arange(20.0)), bumps, 1)

    def periodic(cam, state):
        for _ in range(6):
            cycle = TracedMotion(train, cam, speed, state)
            jacobian = cycle.pull_back(ends=np.eye(20)).by_start
            state = state + np.linalg.solve(np.eye(20) - jacobian, cycle.end - state)
        assert np.abs(TracedMotion(train, cam, speed, state).end - state)[:10].max() < 1e-11
        return state

    names = ["contact_force_max_N", "dynamic_area_mm_deg", "seating_velocity_m_per_s"]
    settled = state_at_rest(train)
    for _ in range(20):
        settled = TracedMotion(train, lift, speed, settled).end
    state = periodic(lift, settled)
    cycle = TracedMotion(train, lift, speed, state)
    jacobian = cycle.pull_back(ends=np.eye(20)).by_start
    assert np.abs(np.linalg.eigvals(jacobian)).max() < 1.0
    held = value_and_gradient(train, lift, speed, names, state, revolutions=2)
    adjoint = np.linalg.solve((np.eye(20) - jacobian).T, held.by_start.T).T  # the start follows the end
    total = held.by_coefficients + cycle.pull_back(ends=adjoint).by_coefficients
    exact, errors = np.sum(total * direction, axis=(1, 2)), []
    for h in (1e-5, 1e-6):
        cams = [replace(lift, coefficients=lift.coefficients + sign * h * direction) for sign in (1, -1)]
        up, down = (TracedMotion(train, cam, speed, periodic(cam, state), 2).values(names) for cam in cams)
        errors.append(np.abs((up - down) / (2 * h) / exact - 1))
    assert np.min(errors, axis=0).max() < 1e-6
    assert np.abs(np.sum(held.by_coefficients * direction, axis=(1, 2)) / exact - 1).max() > 1e-3  # it does matter


def test_grazing_is_reported():
    train = ball(1e6, 100.0)
    slow, fast = (value_and_gradient(train, STILL, 2 * np.pi, [], np.array([x, 0.0])).grazing for x in (1e-7, 0.1))
    assert slow.approach_m_per_s == pytest.approx(np.sqrt(2 * GRAVITY * 1e-7), rel=1e-3)
    assert slow.approach_m_per_s < 0.1 * np.sqrt(2 * GRAVITY * 0.1)
    assert fast.gap_m == np.inf
