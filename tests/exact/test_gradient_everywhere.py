"""No NaN and no silent zero, whatever the gaps and the scene; and a wrong saltation does not go unseen."""

from dataclasses import fields, replace

import numpy as np
import pytest

from camopt.cam.families.polydyne import polydyne
from camopt.cam.lift import Lift
from camopt.exact.adjoint import integrals, motion, seeds
from camopt.exact.adjoint import sweep as adjoint
from camopt.exact.adjoint.metrics import METRICS
from camopt.exact.adjoint.motion import Gradient, TracedMotion, value_and_gradient
from camopt.scene import InputError, MotionRefused, build_train, load_scene, rest_position
from camopt.scene.rest import state_at_rest
from tests.exact.gradient_problems import by_train, cam_with_bumps, from_rest, kodama, moved
from tests.exact.interpreted import interpret

BUILT_IN = ("kodama", "motori-1", "motori-2", "pushrod-5mass")
SWEPT = ("camopt.exact.kernel.", *(module.__name__ for module in (adjoint, integrals, seeds)))
"""What a sweep runs."""
VARIED = ("mass", "stiffness", "damping", "preload", "gap")


def check(found: Gradient, where: str) -> None:
    """Every value that is a number has a gradient of numbers, and every value that is not zero one that is not."""
    parts = {"cam": found.by_coefficients, "start": found.by_start}
    parts |= {field.name: getattr(by_train(found), field.name) for field in fields(by_train(found))}
    for name, part in parts.items():
        assert np.all(np.isfinite(part)), f"{where}: by {name}"
    for i, (metric, value) in enumerate(zip(found.metrics, found.values, strict=True)):
        if np.isfinite(value) and value != 0.0:
            assert np.any(found.by_coefficients[i]), f"{where}: {metric} by the cam"
            assert np.any(by_train(found).stiffness[i]) and np.any(by_train(found).mass[i]), f"{where}: {metric}"


@pytest.mark.parametrize("element", ["cam_follower", "follower_valve"])
def test_gaps_down_to_zero(element):
    scene, train = kodama()
    lift, _ = cam_with_bumps("polydyne", 20)
    e = train.element_names.index(element)
    for gap in (0.0, 1e-9, 1e-6, 5e-5, 1.69e-4, 3e-4):
        other = replace(train, gap=np.where(np.arange(len(train.gap)) == e, gap, train.gap))
        found = value_and_gradient(other, lift, scene.cam_speed(6000), METRICS, mechanical=True)
        check(found, f"gap {gap:g} m")
        seating = found.metrics.index("seating_velocity_m_per_s")
        assert by_train(found).gap[seating, e] != 0.0


def random_motion(seed: int) -> Gradient | None:
    """Gradients in a built-in scene with every number of its train moved by up to two thirds and any speed; None where
    there is no rest or no motion."""
    random = np.random.default_rng(seed)
    scene = load_scene(BUILT_IN[seed % len(BUILT_IN)])
    base = build_train(scene)
    factors = {name: np.exp(random.uniform(-0.5, 0.5, len(getattr(base, name)))) for name in VARIED}
    train = replace(base, **{name: factor * getattr(base, name) for name, factor in factors.items()})
    cam = polydyne(scene, exponents=(2, *sorted(random.choice(np.arange(8, 40), 4, replace=False))))
    try:
        speed = scene.cam_speed(random.uniform(1000.0, 8000.0))
        return value_and_gradient(train, cam, speed, METRICS, mechanical=True)
    except (InputError, MotionRefused):
        return None


@pytest.mark.parametrize("count", [24, pytest.param(1000, marks=pytest.mark.long)])
def test_random_scenes(count):
    followed = 0
    for seed in range(count):
        found = random_motion(seed)
        if found is not None:
            check(found, f"random scene {seed}")
            followed += 1
    assert followed >= 0.9 * count


def test_a_flat_lift_stays_at_rest():
    scene, train = kodama()
    flat = Lift(np.array([-np.pi, np.pi]), np.zeros((1, 7)), 1.0)
    found = value_and_gradient(train, flat, scene.cam_speed(6000), ["bounce_mm", "jump_mm"], mechanical=True)
    check(found, "flat lift")
    sides, x = list(train.cam_side), rest_position(train)
    lash = -(train.compression(x, 0.0) + train.preload / train.stiffness)[sides]  # the contacts apart at rest
    assert found.values[0] == 0.0 and found.values[1] == pytest.approx(1e3 * lash.max())


def taylor_slope(share: float, monkeypatch) -> float:
    """Order of the remainder after the first derivative, the saltation multiplied by `share`."""
    scene, train = kodama()
    lift, bumps = cam_with_bumps("polydyne", 20)
    speed, direction = scene.cam_speed(6000), np.tensordot(np.cos(np.arange(20.0)), bumps, 1)
    start, metric = state_at_rest(train), ["seating_velocity_m_per_s"]
    moving, steps = TracedMotion(train, lift, speed, start), np.array([2e-7, 5e-8])
    after = [from_rest(train, moved(lift, h * direction), speed, metric, start)[0] for h in steps]
    interpret(monkeypatch, *SWEPT)
    original = adjoint.switch_back

    def switch_back(s, trace, seeds, k, bars, room):
        before = [part.copy() for part in bars]
        original(s, trace, seeds, k, bars, room)
        for part, old in zip(bars, before, strict=True):
            part[:] = old + share * (part - old)

    monkeypatch.setattr(adjoint, "switch_back", switch_back)
    monkeypatch.setattr(motion, "sweep", adjoint.sweep)
    values, slopes = moving.swept(metric)
    slope = np.sum(slopes.by_coefficients * direction)
    rests = [abs(found - values[0, 0] - h * slope) for found, h in zip(after, steps, strict=True)]
    return float(np.diff(np.log(rests))[0] / np.diff(np.log(steps))[0])


@pytest.mark.parametrize(("share", "order"), [(1.0, 2.0), (-1.0, 1.0), (2.0, 1.0), (0.0, 1.0)])
def test_a_saltation_flipped_doubled_or_left_out_is_seen(share, order, monkeypatch):
    assert taylor_slope(share, monkeypatch) == pytest.approx(order, abs=0.1)
