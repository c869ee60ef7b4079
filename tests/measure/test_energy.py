"""The energy balance closes on event-exact records, and only with the right signs, dampers and contact law."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from camopt.cam.families.exponent import exponent
from camopt.cam.families.polydyne import polydyne
from camopt.exact import prepare
from camopt.measure.energy import Elastic, energy
from camopt.scene import build_train, load_scene
from camopt.scene.laws import OIL, PROGRESSIVE
from camopt.scene.response import Response, end_state, joined
from camopt.scene.train import GROUND
from camopt.verifier.methods import dop853, rkg, tmm
from tests.verifier.scenes import REAL, from_rest, with_elements
from tests.verifier.trains import ball_on_seat, laws, no_lift, smooth_lift, train, two_springs

CLOSED = 1e-8
"""Residual by the largest stored energy that counts as closed: docs/model.md defines what counts as dissipated."""


@cache
def revolutions(name, rpm):
    """The first two revolutions from rest."""
    case, rest = from_rest(name, rpm)
    revolve = prepare(*case, 7200)
    first = revolve(rest)
    return first, revolve(end_state(first)), case[1]


def second_revolution(name, rpm):
    return revolutions(name, rpm)[1:]


CASES = [("kodama", 5000), ("kodama", 7000), ("motori-1", 5000), ("motori-1", 7000)]


@pytest.mark.parametrize(("name", "rpm"), CASES)
def test_balance_closes_on_event_exact_records(name, rpm):
    found = energy(*second_revolution(name, rpm))
    assert abs(found.residual_relative) < CLOSED
    peak = found.stored.max()
    assert found.put_in > 1e-3 * peak and found.dissipated > 1e-3 * peak
    assert np.all(found.damped >= 0) and np.all(found.damped_to_ground >= 0) and np.all(found.left >= 0)
    assert found.left.sum() > 1e3 * CLOSED * peak  # so the balance would not close without it


@pytest.mark.parametrize(("name", "rpm"), CASES)
def test_a_damper_that_works_with_the_wrong_sign_opens_the_balance(name, rpm):
    found = energy(*second_revolution(name, rpm))
    for e in np.flatnonzero(found.damped > 1e-6 * found.stored.max()):
        flipped = found.damped.copy()
        flipped[e] = -flipped[e]
        assert abs(replace(found, damped=flipped).residual_relative) > 10 * CLOSED
    assert abs(replace(found, by_cam=-found.by_cam).residual_relative) > 1e5 * CLOSED


@pytest.mark.parametrize("part", ["stiffness", "damping", "mass", "preload"])
def test_a_record_of_another_train_does_not_balance(part):
    response, lift = second_revolution("kodama", 7000)
    other = replace(response.train, **{part: getattr(response.train, part) * 1.001})
    assert abs(energy(replace(response, train=other), lift).residual_relative) > 100 * CLOSED


def test_undamped_drop_keeps_its_energy():
    fall, weight, stiffness = 0.2, 10.0, 4e4
    response = prepare(ball_on_seat(stiffness, 0.0), no_lift(), 2 * np.pi / 2.0, 4000)(np.array([fall, 0.0]))
    assert np.count_nonzero(np.diff(response.force[:, 0] > 0)) > 6  # it bounced
    found = energy(response, no_lift())
    total = found.stored + weight * response.x[:, 0]  # potential of the weight: what its work has not put in yet
    assert np.abs(total - weight * fall).max() < 1e-12 * weight * fall
    assert found.dissipated == found.left.sum() == 0.0
    assert found.by_forces.sum() == pytest.approx(weight * (fall - response.x[-1, 0]), rel=1e-9)


def test_what_an_opening_contact_still_holds_is_left_behind():
    stiffness, damping = 4e4, 120.0
    response = prepare(ball_on_seat(stiffness, damping), no_lift(), 2 * np.pi / 0.6, 8000)(np.array([0.2, 0.0]))
    jump = np.flatnonzero(np.diff(response.angle) == 0)
    openings = [i for i in jump if response.x[i, 0] < 0 and response.force[i - 1, 0] > response.force[i + 1, 0]]
    held = sum(0.5 * stiffness * response.x[i, 0] ** 2 for i in openings)
    found = energy(response, no_lift())
    assert held > 1e-4 * found.stored.max()
    assert found.left.sum() == pytest.approx(held, rel=1e-6)
    assert abs(found.residual_relative) < CLOSED


def test_records_add_up():
    *motions, lift = revolutions("motori-1", 7000)
    parts, whole = [energy(motion, lift) for motion in motions], energy(joined(motions), lift)
    assert whole.put_in == pytest.approx(sum(p.put_in for p in parts), rel=1e-12)
    assert whole.dissipated == pytest.approx(sum(p.dissipated for p in parts), rel=1e-12)


@pytest.mark.parametrize(("method", "order"), [(rkg, 4), (tmm, 3)])
def test_without_located_contacts_the_residual_is_the_error_of_the_method(method, order):
    start, lift = np.array([0.02, -0.03, 0.4, -0.2]), smooth_lift(0.5)
    runs = [method.prepare(two_springs(), lift, 1.5, steps)(start) for steps in (1600, 6400)]
    coarse, fine = (abs(energy(run, lift).residual) for run in runs)
    assert np.log(coarse / fine) / np.log(4) == pytest.approx(order, abs=0.25)


@cache
def real_revolution(rpm, method=dop853, steps=7200):
    case, rest = from_rest(REAL, rpm, exponent)
    return method.prepare(*case, steps)(rest), case[1]


@pytest.mark.parametrize("rpm", [2000, 4000])
def test_balance_closes_with_table_oil_friction_and_gas_force(rpm):
    response, lift = real_revolution(rpm)
    found = energy(response, lift)
    lost = dict(zip(response.train.element_names, found.damped, strict=True))
    peak = found.stored.max()
    assert abs(found.residual_relative) < CLOSED
    assert all(lost[name] > 1e-5 * peak for name in ("guide", "lifter-oil", "beehive", "seat"))
    assert abs(found.by_forces.sum()) > 1e-2 * peak
    slid = np.abs(np.diff(response.memory[:, 0])).sum()
    assert lost["guide"] == pytest.approx(15.0 * slid, rel=1e-12)


@pytest.mark.parametrize(("law", "element"), [("slip", "guide"), ("leak", "lifter-oil"), ("table", "beehive")])
def test_a_record_under_another_law_does_not_balance(law, element):
    response, lift = real_revolution(4000)
    opening = slice(np.searchsorted(response.angle, 0.0))  # over a revolution a spring gives back what it took
    parts = {name: getattr(response, name)[opening] for name in ("angle", "lift", "x", "v", "force", "memory")}
    response = replace(response, **parts)
    assert abs(energy(response, lift).residual_relative) < CLOSED
    train = response.train
    numbers, e = getattr(train.laws, law).copy(), train.element_names.index(element)
    numbers[e] *= np.array([1.0, 1.001]) if law == "table" else 1.001
    other = replace(train, laws=replace(train.laws, **{law: numbers}))
    assert abs(energy(replace(response, train=other), lift).residual_relative) > 10 * CLOSED


def test_a_record_under_another_gas_force_does_not_balance():
    response, lift = real_revolution(4000)
    (gas,) = response.train.forcing
    other = replace(response.train, forcing=(replace(gas, force=1.001 * gas.force),))
    assert abs(energy(replace(response, train=other), lift).residual_relative) > 10 * CLOSED


def test_the_residual_of_a_real_train_falls_with_the_steps_of_a_method():
    def residual(steps):
        runs = [real_revolution(4000, rkg, steps + more) for more in range(1, 6)]
        return np.mean([abs(energy(*run).residual_relative) for run in runs])

    coarse, fine = residual(3600), residual(57_600)
    assert fine < 2 / 16 * coarse  # order 1 across a damped closing


LOSSY = {"law": "hunt-crossley", "dissipation_s_per_m": 0.3, "damping_N_s_per_m": 0.0}


@pytest.mark.parametrize("changes", [{}, LOSSY], ids=["hertz", "hunt-crossley"])
def test_balance_closes_with_curved_contacts(changes):
    scene = load_scene("kodama-hertz")
    curved = [e.law == "hertz" for e in scene.element]
    scene = with_elements(scene, **{e.name: changes for e in scene.element if e.law == "hertz"})
    case, rest = from_rest(scene, 6000, lambda _: polydyne(load_scene("kodama")))
    found = energy(dop853.prepare(*case, 7200)(rest), case[1])
    assert abs(found.residual_relative) < CLOSED
    assert np.all((found.damped[curved] if changes else found.left.sum()) > 1e3 * CLOSED * found.stored.max())


def test_balance_closes_with_a_preloaded_progressive_seat():
    rows, preload, fall = np.array([[-1e-3, 3e4], [2e-4, 3e4], [6e-3, 9e4]]), 8.0, 0.05
    train = ball_on_seat(3e4, 60.0)
    train = replace(train, preload=np.array([preload]), laws=laws([PROGRESSIVE], 3e4, table=rows))
    response = dop853.prepare(train, no_lift(), 2 * np.pi / 0.4, 7200)(np.array([fall, 0.0]))
    found = energy(response, no_lift())
    assert response.force.max() > 20 * preload and found.damped.sum() > 0.1 * found.stored.max()
    assert abs(found.residual_relative) < CLOSED


def test_what_an_oil_column_loses_is_known_from_few_samples():
    """Held at d it loses k d^2 (1 - exp(-2 k t / leak)) / 2; here a step is a fifth of leak / k."""
    k, leak, d, steps = 1e6, 1e3, 1e-3, 20
    oil = laws([OIL], [k], leak=leak)
    held = train([1e12], [(0, GROUND, False, False, k, 0.0, 0.0, 0.0)], laws=oil)  # no force moves such a mass
    angle, end = np.linspace(-np.pi, np.pi, steps + 1), steps / 5 * leak / k
    time, still = (angle + np.pi) / (2 * np.pi) * end, np.zeros((steps + 1, 1))
    z = d * (1 - np.exp(-k * time / leak))[:, None]
    record = Response(held, 2 * np.pi / end, angle, still[:, 0], still + d, still, k * (d - z), z)
    lost = k * d**2 / 2 * (1 - np.exp(-2 * k * end / leak))
    assert energy(record, no_lift()).damped == pytest.approx([lost], rel=1e-5)


COMPRESSION = np.linspace(-2e-4, 2e-4, 401)


def test_a_hertz_contact_pushes_with_the_power_of_its_compression_from_the_touch():
    scene = load_scene("kodama-hertz")
    train = build_train(scene)
    e = next(i for i, element in enumerate(scene.element) if element.law == "hertz")
    element = scene.element[e]
    force = Elastic(train).force(np.repeat(COMPRESSION[:, None], len(train.a), axis=1))[:, e]
    k, p = element.stiffness_N_per_m, element.exponent or 1.5
    expected = k * np.maximum(0.0, COMPRESSION + (element.preload_N / k) ** (1.0 / p)) ** p
    np.testing.assert_allclose(force, expected, rtol=1e-12, atol=1e-12)
    assert force.max() > 1.0


@pytest.mark.parametrize("name", ["kodama-hertz", "kodama"])
def test_the_energy_is_the_integral_of_the_force(name):
    train = build_train(load_scene(name))
    elastic, d = Elastic(train), np.repeat(COMPRESSION[:, None], len(train.a), axis=1)
    memory = np.zeros((len(d), len(train.memory)))
    change = np.diff(elastic.stored(d, memory), axis=0)
    pushed = np.where(train.contact, np.maximum(elastic.force(d), 0.0), elastic.force(d))
    middle = 0.5 * (pushed[1:] + pushed[:-1]) * np.diff(d, axis=0)
    scale = np.abs(change).max(axis=0)
    np.testing.assert_allclose(change, middle, atol=1e-3 * scale.max())  # trapezoids of 1 um
