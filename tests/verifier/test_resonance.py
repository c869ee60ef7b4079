"""Lightly damped trains: resonances between the speeds of a grid, and motions that take hundreds of revolutions."""

from dataclasses import replace

import numpy as np
import pytest

from camopt.cam.families.polydyne import polydyne
from camopt.exact import engine, settled_metrics
from camopt.measure.resonance import Resonance, _linearised, _nearest, _pairs, resonances
from camopt.measure.settling import decay_per_revolution, settle, settled_from_rest
from camopt.measure.sweep import at_speeds
from camopt.scene import build_train, load_scene
from camopt.scene.laws import LINEAR, PROGRESSIVE
from camopt.scene.train import GROUND
from camopt.verifier import verdict
from camopt.verifier.convergence import Tolerances
from camopt.verifier.verdict import verdict_on
from tests.verifier.scenes import FREQUENCY_HZ, coil_scene, from_rest, with_elements
from tests.verifier.trains import laws, smooth_lift, train

BOUNCE_ALONE = {"jump_max_mm": None, "seating_velocity_max_m_per_s": None}


def test_a_lightly_damped_coil_resonates_at_harmonics_of_the_cam():
    scene = coil_scene((5000.0, 7000.0))
    found, left_out = resonances(scene, polydyne(scene), 20.0)
    assert [r.harmonic for r in found] == [8, 7] and left_out == 0
    for r in found:
        # two crankshaft revolutions to one of the cam; 0.1 %: the valve's ends of the spring give a little
        assert r.speed_rpm == pytest.approx(120 * FREQUENCY_HZ / r.harmonic, rel=1e-3)
        assert r.half_width_rpm == pytest.approx(5e-4 * r.speed_rpm, rel=0.01)
        assert [r.low_rpm, r.high_rpm, 120 * r.frequency_Hz / r.harmonic] == pytest.approx([r.speed_rpm] * 3, rel=1e-4)
        assert np.diff(r.speeds_rpm()).max() <= r.half_width_rpm
    narrow = Resonance(6447.0, 6446.0, 6448.0, 0.5, 7, 376.0, 1e-3)
    assert narrow.speeds_rpm() == pytest.approx(np.arange(6445.5, 6448.6, 0.5))
    damped = coil_scene((5000.0, 7000.0), damping_ratio=0.02)  # half widths of 100 r/min, which steps of 20 resolve
    assert resonances(damped, polydyne(damped), 20.0) == ([], 0)
    assert resonances(load_scene("kodama"), polydyne(load_scene("kodama")), 20.0) == ([], 0)


def test_a_mass_on_an_overdamped_seat_has_no_mode_that_goes_on_through_the_revolution():
    """A verdict on such a train ended in a defect, the largest of an empty list."""
    scene = load_scene("motori-1")
    # beyond twice the root of stiffness times mass, 1.8e4
    overdamped = with_elements(scene, seat={"damping_N_s_per_m": 4e4})
    assert resonances(overdamped, polydyne(scene), 20.0) == ([], 0)
    assert _pairs(build_train(overdamped), polydyne(scene)) == []
    assert len(_pairs(build_train(scene), polydyne(scene))) == 1  # its own seat lets it oscillate


def test_a_mode_is_most_similar_to_itself_in_any_size_and_direction():
    """Modes are orthogonal only with the masses as weights."""
    random, numbers = np.random.default_rng(0), np.arange(4.0)
    mass = random.uniform(0.01, 1.0, 4)
    shapes = np.linalg.qr(random.normal(size=(4, 4)))[0] / np.sqrt(mass)
    modes = 100.0 * numbers, 0.1 * numbers, (1.0 + numbers)[:, None] * shapes
    for i, size in np.ndindex(4, 4):
        assert _nearest((-2.0) ** size * shapes[i], modes, mass) == pytest.approx((100.0 * i, 0.1 * i))


def test_a_spring_by_a_table_is_as_stiff_as_its_compression_at_rest_and_at_full_lift_asks():
    """The cam moves the mass by its lift through an element so stiff that it gives way by a micrometre at most."""
    elements = [(GROUND, 0, False, True, 1e9, 0.0, 0.0, 0.0), (0, GROUND, False, False, 1e4, 0.0, 50.0, 0.0)]
    table = [[0.0, 1e4], [0.01, 3e4]]
    sprung = train([0.1], elements, laws=laws([LINEAR, PROGRESSIVE], [1e9, 1e4], table=table))
    found = _linearised(sprung, smooth_lift(0.008))
    expected = [[1e9, np.interp(compression, *np.transpose(table))] for compression in (0.0, 0.008)]
    np.testing.assert_allclose([one.stiffness for one in found], expected, rtol=1e-3)
    assert _linearised(replace(sprung, laws=None), smooth_lift(0.008))[0].stiffness == pytest.approx(sprung.stiffness)


def test_the_response_is_largest_where_the_resonance_is_said_to_be():
    scene = coil_scene(preload_N=20_000.0)  # no contact parts: the train is linear but for the seat
    lift = polydyne(scene)
    (one,), _ = resonances(scene, lift, 20.0)
    speeds = one.speed_rpm + one.half_width_rpm * np.array([-3.0, -2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0, 3.0])
    lowest = [row["contact_force_min_N"] for row in at_speeds(settled_metrics, scene, lift, speeds)]
    assert abs(int(np.argmin(lowest)) - 4) <= 1
    gone = max(lowest[0], lowest[-1]) - np.array(lowest)  # how much the resonance takes off the least force
    assert gone[4] > 2 * max(gone[0], gone[-1])


def test_a_cam_that_bounces_between_the_speeds_of_the_grid_is_not_confirmed():
    """Between 6149 and 6163 r/min alone the valve bounces by more than is allowed: steps of 60 r/min confirmed it."""
    scene = coil_scene(**BOUNCE_ALONE)
    lift = polydyne(scene)
    plain = at_speeds(settled_metrics, scene, lift, np.arange(6065.0, 6246.0, 60.0))
    assert max(row["bounce_mm"] for row in plain) < 0.05  # steps of 60 r/min alone see nothing
    result = verdict_on(scene, lift, (6065.0,), ("event", "rkg"), 60.0, Tolerances(halvings=4))
    assert result.verdict != "confirmed"
    assert result.band.worst("bounce_mm")[1] > 0.1
    assert result.first_bounce_rpm < 6165  # below the band, at the harmonic 8, the cam bounces too
    data = result.as_dict()["band"]
    assert data["resonances"][0]["harmonic"] == 7 and data["resonances_left_out"] == 0
    assert data["worst"]["bounce_mm"]["value"] == max(data["curves"]["bounce_mm"])
    inside = [s for s in result.worst_in_band if 6149 <= s.speed_rpm <= 6163]
    assert inside and all(s.verdict != "confirmed" for s in inside)


def test_what_the_search_for_the_first_bounce_finds_inside_the_band_is_judged(monkeypatch):
    scene = coil_scene(**BOUNCE_ALONE)
    monkeypatch.setattr(verdict, "resonances", lambda *_: ([], 0))
    monkeypatch.setattr(verdict, "sweep", lambda swept, *_, **__: swept([6065.0, 6245.0]))  # a band that sees nothing
    monkeypatch.setattr(verdict, "first_exceeding", lambda *_: {"bounce_mm": 6155.0, "jump_mm": 6160.0})
    result = verdict_on(scene, polydyne(scene), (6065.0,), ("event", "rkg"), 20.0, Tolerances(halvings=3))
    assert 6155.0 in [s.speed_rpm for s in result.worst_in_band]
    assert 6160.0 not in [s.speed_rpm for s in result.worst_in_band]  # the scene does not limit jump
    assert result.verdict != "confirmed"


def test_a_lightly_damped_motion_is_run_until_it_stands():
    """Forty revolutions from rest leave half a millimetre of surge; the settled motion is what 2000 plain ones give."""
    case, rest = from_rest(coil_scene(), 6100.0)
    revolve = engine.prepare(*case)
    truth = settle(revolve, rest, most=2000, position=1e-9)
    found = settled_from_rest(engine.prepare, *case)
    assert found.periodic and found.faded and found.revolutions < 200
    assert np.abs(found.response.x[0] - truth.response.x[0]).max() < 1e-6
    train, _, cam_speed = case
    early = settle(revolve, rest, most=40, decay=decay_per_revolution(train, cam_speed))
    assert not early.periodic and not early.faded
    assert np.abs(early.response.x[0] - truth.response.x[0]).max() > 1e-5


def test_a_motion_that_had_no_time_to_settle_is_not_converged():
    """An undamped coil: the transient of the start never dies out, so no figure is the settled motion's."""
    scene = coil_scene(damping_ratio=0.0, **BOUNCE_ALONE)
    for tolerances in (Tolerances(halvings=2), Tolerances(halvings=2, unchanged_halvings=1, spot_checks=True)):
        result = verdict_on(scene, polydyne(scene), (6065.0,), band_step_rpm=None, tolerances=tolerances)
        assert result.verdict == "not converged"
