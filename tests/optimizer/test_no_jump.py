"""The no-jump program: its linear motion against brute force and event-exact, its rows, prices and known areas."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from camopt.cam.families.free import free_cam
from camopt.optimizer.program import no_jump, periodic
from camopt.optimizer.program.force_rows import OPENING, PEAK, SEAT, Box, SpeedRows, averaged
from camopt.optimizer.program.kinematic import (
    PEAK_STEP,
    area_ratio_row,
    kinematic_optimum,
    peak_angle,
    spline_rows,
    with_lift_reached,
)
from camopt.optimizer.program.linear_program import maximise
from camopt.optimizer.program.no_jump import NoCamHoldsContact, no_jump_program
from camopt.optimizer.program.periodic import periodic_response, sample_cam
from camopt.optimizer.program.phases import Angles, phase_contacts, static_angles
from camopt.optimizer.program.relocation import NoLoadTransfer, located_angles, relocate, settled_revolution
from camopt.scene import InputError, build_train, load_scene
from camopt.scene.units import DEG, MM

SCENE = load_scene("kodama")
TRAIN = build_train(SCENE)
DESIGN = SCENE.design.model_copy(update={"nose_deg": None})
SPEEDS = [SCENE.cam_speed(rpm) for rpm in (5000, 6000, 6500, 7000)]


@cache
def program(jerk=0.003, knot_deg=3.0):
    design = DESIGN.model_copy(update={"jerk_max_mm_per_deg3": jerk})
    return no_jump_program(TRAIN, design, free_cam(design, knot_deg), SPEEDS)


@cache
def optimum(margin=20.0):
    return program().solve(margin)


def held_motion(train, lift, cam_speed, angles, start, revolutions):
    """State at the end, by an adaptive integrator, of contacts that stay closed in each phase whatever they pull."""
    n = len(train.mass)
    ends = [-np.pi, angles.lash_closes, angles.seat_opens, angles.seat_closes, angles.lash_opens, np.pi]
    sets = phase_contacts(train)[[0, 1, 2, 1, 0]]
    padded = np.zeros(n + 1)

    def rate(theta, state, closed):
        x, v = state[:n], state[n:]
        force = -train.mass_damping * v + train.mass_force
        d = train.compression(x, lift(theta))
        d_dt = train.compression(v, lift(theta, 1) * cam_speed) + train.gap
        f = np.where(closed, train.preload + train.stiffness * d + train.damping * d_dt, 0.0)
        padded[:] = 0.0
        np.subtract.at(padded, train.a, f)
        np.add.at(padded, train.b, f)
        return np.concatenate([v, (force + padded[:n]) / train.mass]) / cam_speed

    state = start
    for _ in range(revolutions):
        for low, high, closed in zip(ends[:-1], ends[1:], sets, strict=True):
            done = solve_ivp(rate, (low, high), state, "DOP853", args=(closed,), rtol=1e-9, atol=1e-11)
            state = done.y[:, -1]
    return state


def test_static_angles_are_where_the_load_moves():
    angles = static_angles(TRAIN, free_cam(DESIGN))
    degrees = np.array([angles.lash_closes, angles.seat_opens, angles.seat_closes, angles.lash_opens]) / DEG
    np.testing.assert_allclose(degrees, [-81.04, -79.91, 79.91, 81.04], atol=0.005)  # two decimals are known


def test_static_angles_follow_each_side_s_ramp():
    skew = DESIGN.model_copy(update={"closing_ramp_height_mm": 0.4, "closing_ramp_velocity_mm_per_deg": 0.02})
    cam = free_cam(skew)
    angles = static_angles(TRAIN, cam)
    lift = cam.lift(np.zeros(cam.Z.shape[1]))
    assert angles.seat_opens == pytest.approx(static_angles(TRAIN, free_cam(DESIGN)).seat_opens, abs=1e-12)
    assert lift(angles.seat_closes) == pytest.approx(lift(angles.seat_opens), rel=1e-10)
    assert lift(angles.lash_opens) == pytest.approx(lift(angles.lash_closes), rel=1e-10)


def test_a_ramp_below_the_lash_is_refused():
    low = DESIGN.model_copy(update={"ramp_height_mm": 0.1})
    with pytest.raises(
        InputError, match=r"between 0 and 0\.1 mm: give \w+ a smaller gap_mm, or the scene a higher ramp_height_mm"
    ):
        static_angles(TRAIN, free_cam(low))


@pytest.mark.parametrize("scene_name", ["motori-1", "kodama"])
def test_periodic_response_is_what_a_long_simulation_settles_to(scene_name):
    """From another start the held motion must fall into the periodic one at the map's own rate."""
    scene = load_scene(scene_name)
    train, cam = build_train(scene), free_cam(scene.design)
    angles = static_angles(train, cam)
    speed = scene.cam_speed(scene.operation.speeds_rpm[-1])
    response = periodic_response(train, sample_cam(cam, angles), speed, angles)
    z = kinematic_optimum(scene.design, cam).z
    periodic = response.state[0] @ np.append(1.0, z)
    np.testing.assert_allclose(response.state[-1] @ np.append(1.0, z), periodic, rtol=1e-9, atol=1e-12)
    n = len(train.mass)
    start = periodic + np.append(np.full(n, 1e-6), np.zeros(n))
    end = held_motion(train, cam.lift(z), speed, angles, start, 1)
    expected = periodic + response.map @ (start - periodic)
    # a thousandth of the disturbance; the integrator's own error is far below
    np.testing.assert_allclose(end[:n], expected[:n], atol=1e-9)
    np.testing.assert_allclose(end[n:], expected[n:], atol=1e-9 * np.sqrt(np.max(train.stiffness) / np.min(train.mass)))


@pytest.mark.parametrize("scene_name", ["motori-1", "kodama"])
def test_blocks_of_steps_give_what_single_steps_give(scene_name, monkeypatch):
    """Differences are of round-off: 1e-10 of the largest force, in every coefficient."""
    scene = load_scene(scene_name)
    train, cam = build_train(scene), free_cam(scene.design)
    angles, speed = static_angles(train, cam), scene.cam_speed(6000)
    at_once = periodic_response(train, sample_cam(cam, angles), speed, angles)
    monkeypatch.setattr(periodic, "LONGEST", 1)
    singly = periodic_response(train, sample_cam(cam, angles), speed, angles)
    assert len(at_once.samples.first) < len(singly.samples.first) / 8 == (len(singly.samples.edges) - 1) / 8
    assert np.diff(singly.samples.edges).max() < periodic.SAMPLE + 1e-12
    at = np.sort(np.random.default_rng(1).choice(len(singly.samples.edges), 300, replace=False))
    for e in (train.seat, *train.cam_side):
        forces = singly.force(e, at)
        for count in (np.searchsorted(at, at_once.samples.first[2]), 300):  # edges of the first two blocks, and all
            found = at_once.force(e, at[:count])
            np.testing.assert_allclose(found, forces[:count], rtol=0, atol=1e-10 * np.abs(forces).max())
    np.testing.assert_allclose(at_once.map, singly.map, rtol=0, atol=1e-10 * np.abs(singly.map).max())


def test_linear_motion_and_forces_agree_with_event_exact_without_contact_loss():
    """At the angles of the real motion the linear model is the real motion, but for rattle on the ramps."""
    found = optimum()
    real = settled_revolution(TRAIN, found.lift, SPEEDS[0], 20)
    angles = located_angles(real)
    response = periodic_response(TRAIN, sample_cam(program().cam, angles), SPEEDS[0], angles)
    at = np.flatnonzero(np.abs(response.samples.edges) < 60 * DEG)  # rattle on the ramps has died down
    theta = response.samples.edges[at]
    one_z = np.append(1.0, found.z)
    valve = response.state[at, TRAIN.valve] @ one_z
    np.testing.assert_allclose(valve, np.interp(theta, real.angle, real.x[:, TRAIN.valve]), atol=2e-6)  # 9 mm of lift
    for e in TRAIN.cam_side:
        force = response.force(e, at) @ one_z
        assert force.max() > 500.0
        np.testing.assert_allclose(force, np.interp(theta, real.angle, real.force[:, e]), atol=10.0)  # of 1000


@pytest.mark.parametrize(
    ("jerk", "margin", "area_ratio"), [(0.003, 20.0, 0.5424), (0.01, 20.0, 0.5656), (0.003, 0.0, 0.5600)]
)
def test_area_of_the_four_speed_program(jerk, margin, area_ratio):
    """Areas of an earlier computation, with sampled lift cap and other control-point bounds: hence 0.0006."""
    found = program(jerk).solve(margin)
    assert found.area_ratio == pytest.approx(area_ratio, abs=6e-4)
    assert found.lift.area_ratio(9.4 * MM) == pytest.approx(found.area_ratio, abs=1e-12)
    assert found.lift.max_lift <= 9.4 * MM


def test_forces_of_the_answer_keep_the_margins_between_the_samples_too():
    found = optimum()
    p = found.program
    least = np.full(len(p.kind), 20.0)
    assert np.all(p.forces(found.z) >= least - 1e-6)
    assert np.min(p.forces(found.z)) < 20.0 + 1e-6  # and some are exactly at them
    angles, speed = p.blocks[-1].angles, SPEEDS[-1]
    fine = periodic_response(TRAIN, sample_cam(p.cam, angles, 0.05 * DEG), speed, angles)
    theta = fine.samples.edges
    at = np.flatnonzero((theta > -70 * DEG) & (theta < angles.seat_closes - 4 * DEG))
    for e in TRAIN.cam_side:
        assert np.min(fine.force(e, at) @ np.append(1.0, found.z)) > 19.0  # a twentieth of the margin at most


def test_windows_and_kinds_of_rows():
    block = program().blocks[0]
    seat = block.kind == SEAT
    cam_side = block.angle[~seat] / DEG
    assert cam_side.min() == pytest.approx(-70.0, abs=1e-9)
    assert 75.5 < cam_side.max() <= 79.92 - 4
    assert set(block.element[seat]) == {TRAIN.seat}
    assert set(block.element[~seat]) == set(TRAIN.cam_side)
    closed = block.angle[seat] / DEG
    assert not np.any((closed > -87.04) & (closed < 91.91))
    assert np.all((block.kind[~seat] == OPENING) == (cam_side < 0))


@pytest.mark.parametrize("kind", range(3), ids=["opening", "closing", "seat"])
def test_prices_are_the_slope_of_the_program(kind):
    p = program()
    found = p.solve((21.0, 13.0, 37.0))
    speed = int(np.argmin(found.margin_prices[kind]))
    step = np.zeros((3, 4))
    step[kind, speed] = 1e-4
    up, down = (p.solve(found.margins + sign * step) for sign in (1, -1))
    slope = (up.area_ratio - down.area_ratio) / 2e-4
    assert found.margin_prices[kind, speed] == pytest.approx(slope, rel=1e-4, abs=1e-11)


def test_impossible_margins_say_by_how_much():
    with pytest.raises(
        NoCamHoldsContact,
        match=r"^keeping 20 to 500 N in the contacts at all of the \d speeds is impossible: lower by \d+ N each is",
    ) as error:
        program().solve((500.0, 500.0, 20.0))
    shortfall = error.value.shortfall_N
    fall = np.array([500.0, 500.0, 20.0]) - shortfall
    program().solve(fall - 0.01)
    with pytest.raises(NoCamHoldsContact):
        program().solve(fall + 0.01 * shortfall)


@pytest.mark.parametrize("unit", [1.0, 100.0])
def test_one_margin_for_all_says_how_much_may_be_kept(monkeypatch, unit):
    """Whatever the order of magnitude in which the solver looks for it."""
    monkeypatch.setattr(no_jump, "force_unit", lambda train: unit)
    with pytest.raises(NoCamHoldsContact, match="keeping 500 N in the contacts at all") as error:
        program().solve(500.0)
    most = 500.0 - error.value.shortfall_N
    expected = f"{most:.4g} N is the most" if most > 0 else f"needs contacts that pull with {-most:.3g} N"
    assert str(error.value).endswith(expected)


def test_largest_contact_force_is_limited_where_the_design_says_so():
    free = optimum(0.0)
    largest = np.max(free.program.forces(free.z)[free.program.kind != SEAT])
    limited = DESIGN.model_copy(update={"contact_force_max_N": 0.97 * float(largest)})
    p = no_jump_program(TRAIN, limited, program().cam, SPEEDS)
    found = p.solve(0.0)
    assert np.max(p.forces(found.z)[p.kind == PEAK]) == pytest.approx(0.97 * largest, rel=1e-6)
    assert found.area_ratio < free.area_ratio
    weak = replace(p, design=DESIGN.model_copy(update={"contact_force_max_N": 1.0}))
    with pytest.raises(NoCamHoldsContact, match="whatever the margins: raise contact_force_max_N"):
        weak.solve(0.0)


def test_full_lift_is_reached_where_the_design_wants_it():
    design = DESIGN.model_copy(update={"reach_max_lift": True, "jerk_max_mm_per_deg3": 0.01})
    p = no_jump_program(TRAIN, design, free_cam(design), SPEEDS)
    found = p.solve()
    assert found.lift.max_lift / MM == pytest.approx(9.4, abs=1e-4)
    assert found.area_ratio == pytest.approx(0.5673, abs=2e-3)  # known for angles once re-located


def test_within_a_box_the_lift_may_be_reached_where_its_own_cam_reaches_it():
    """No cam keeps such a margin; how far it is missed is told with the lift reached beside the middle."""
    design = DESIGN.model_copy(update={"reach_max_lift": True})
    p = no_jump_program(TRAIN, design, free_cam(design), SPEEDS)
    rows, bound = with_lift_reached(p.cam, design, p.rows.matrix, p.bound(-1e5), 3 * PEAK_STEP)
    beside = maximise(area_ratio_row(design, p.cam)[0], spline_rows(rows), bound, p.first_working()).z
    assert peak_angle(p.cam.lift(beside)) > 2 * PEAK_STEP
    with pytest.raises(NoCamHoldsContact) as short:
        p.within(Box(beside, 1e-9)).solve(1e4)
    assert np.isfinite(short.value.shortfall_N)


def test_relocated_angles_are_those_of_the_motion_and_the_program_moves_with_them():
    found = optimum()
    moved = relocate(program(), found.lift)
    for block, speed in zip(moved.blocks, SPEEDS, strict=True):
        real = settled_revolution(TRAIN, found.lift, speed)
        seat = real.force[:, TRAIN.seat] > 0
        inside = (real.angle > block.angles.seat_opens + 1e-6) & (real.angle < block.angles.seat_closes - 1e-6)
        assert not np.any(seat[inside])
        assert abs(block.angles.seat_opens / DEG + 79.9) < 0.6
        assert abs(block.angles.lash_closes / DEG + 81.0) < 0.6
    again = moved.solve()
    assert again.area_ratio == pytest.approx(0.5430, abs=1.5e-3)  # known -70 deg rows, angles once re-located


def test_a_motion_that_never_opens_has_no_load_transfer():
    cam = program().cam
    real = settled_revolution(TRAIN, cam.lift(np.zeros(cam.Z.shape[1])), SPEEDS[0], 1)
    still = type(real)(TRAIN, SPEEDS[0], real.angle, real.lift * 0, real.x * 0 + real.x[0], real.v * 0, real.force)
    with pytest.raises(NoLoadTransfer, match="the seat opens"):
        located_angles(still)


def test_switching_angles_must_ascend():
    with pytest.raises(ValueError, match="must ascend"):
        Angles(-1.4, -1.5, 1.4, 1.5)


def test_forces_are_averaged_within_a_contact_and_not_over_the_angles_between_its_rows():
    first, later = np.arange(4) * 0.5 * DEG, (np.arange(3) * 0.5 + 10) * DEG
    angle = np.concatenate([first, first, [*first[:2], *later]])
    kind = np.repeat([OPENING, PEAK, SEAT], [4, 4, 5])
    element = np.repeat([0, 0, 1], [4, 4, 5])
    force = np.array([0.0, 3.0, 0.0, 6.0, 0.0, 3.0, 0.0, 6.0, 9.0, 0.0, 1.0, 1.0, 1.0])
    block = SpeedRows(100.0, Angles(-1.0, -1.0, 1.0, 1.0), np.outer(force, [1.0, -2.0]), force, kind, element, angle)
    mean = [1.0, 1.0, 3.0, 4.0, 0.0, 3.0, 0.0, 6.0, 6.0, 3.0, 1.0, 1.0, 1.0]  # (2 * 0 + 3) / 3 at the first
    of_means = averaged(block, 1)
    np.testing.assert_allclose(of_means.offset, mean, atol=1e-12)
    np.testing.assert_allclose(of_means.matrix, np.outer(mean, [1.0, -2.0]), atol=1e-12)
    np.testing.assert_array_equal(block.offset, force)
