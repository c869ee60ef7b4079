"""Metrics of motions put together by hand, with answers worked out by hand."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from camopt.cam.families.polydyne import polydyne
from camopt.measure.hermite import Hermite
from camopt.measure.metrics import SERIES, _force_extremes, measure, measure_first
from camopt.scene import QUANTITIES, Response, load_scene
from camopt.scene.laws import LINEAR, OIL
from camopt.scene.response import joined
from camopt.scene.train import GROUND
from camopt.scene.units import DEG, MM
from tests.verifier.trains import laws, train

TURN = 2 * np.pi
SPEED = 300.0  # rad/s
LASH = 0.1 * MM
TOUCH = 2e-6  # position of the valve at which the seat touches: preload over stiffness
ELEMENTS = [
    (GROUND, 0, True, True, 1e8, 50.0, 0.0, 0.0),
    (0, 1, True, False, 1e8, 50.0, 0.0, LASH),
    (GROUND, 1, True, False, 1e8, 500.0, 200.0, 0.0),
]
TRAIN = train([0.1, 0.1], ELEMENTS, valve=1, seat=2, cam_side=(0, 1))


@cache
def lift():
    return polydyne(load_scene("kodama"))


def angles(revolutions, kinks=(), count=7001):
    """Sample angles with a pair of samples 2e-9 rad apart about every kink, so that a slope may jump there."""
    even = np.linspace(-np.pi, -np.pi + TURN * revolutions, count)
    pairs = np.ravel(np.asarray(kinks)[:, None] + [-1e-9, 1e-9]) if len(kinks) else []
    return np.unique(np.concatenate([even, pairs]))


def parabola(angle, start, end, height):
    """A hop of `height` over [start, end]: value and slope by angle, zero elsewhere."""
    u = (angle - start) / (end - start)
    inside = (u > 0) & (u < 1)
    return inside * 4 * height * u * (1 - u), inside * 4 * height * (1 - 2 * u) / (end - start)


def record(angle, s, s_rate, follower=None, force=None):
    """A response whose valve is `s` above its seat touch; the follower keeps to the cam unless given."""
    cam = lift()(angle)
    follower = (cam, lift()(angle, 1)) if follower is None else follower
    x = np.stack([follower[0], s + TOUCH], axis=1)
    v = np.stack([follower[1], s_rate], axis=1) * SPEED
    force = np.full((len(angle), 3), 100.0) if force is None else force
    return Response(TRAIN, SPEED, angle, cam, x, v, force)


REST = 1e-7
"""How far a seated valve is pressed below its touch [m]."""


def hops(revolutions, parts, count=7001):
    """A valve that flies the parabolas (start, end, height), from touch to touch, and is seated otherwise."""
    overlap = [0.5 * (np.sqrt(1 + REST / height) - 1) * (end - start) for start, end, height in parts]
    longer = [(start - o, end + o, h + REST) for (start, end, h), o in zip(parts, overlap, strict=True)]
    angle = angles(revolutions, [k for p in longer for k in p[:2]], count)
    pieces = [parabola(angle, *p) for p in longer]
    return record(angle, sum(p[0] for p in pieces) - REST, sum(p[1] for p in pieces))


def event(revolution, end=1.0):
    """The valve's main lift: 8 mm over [-end, end] about the nose."""
    nose = TURN * revolution
    return nose - end, nose + end, 8 * MM


def test_every_declared_quantity_is_measured():
    figures = measure(hops(3, [event(0), event(1), event(2)]), lift())
    assert set(figures) == set(QUANTITIES)
    assert all(values.shape == (2,) for values in figures.values())


@pytest.mark.parametrize("count", [7001, 2003])
def test_bounce_seating_and_impact_by_revolution(count):
    parts = [
        event(0),
        event(1),
        event(2),
        (1.1, 1.3, 0.3 * MM),
        (1.5, 1.52, 0.05 * MM),
        (TURN + 1.4, TURN + 1.6, 0.5 * MM),
    ]
    figures = measure(hops(3, parts, count), lift())
    assert figures["bounce_mm"] == pytest.approx([0.3, 0.5], rel=1e-6)
    seating = 4 * 8 * MM / 2.0 * SPEED
    assert figures["seating_velocity_m_per_s"] == pytest.approx([seating, seating], rel=1e-6)
    assert figures["impact_velocity_m_per_s"] == pytest.approx([seating, seating], rel=1e-6)


def test_a_later_impact_may_be_the_hardest():
    gentle, hard = (-1.0, 1.0, 0.4 * MM), (1.2, 1.21, 0.2 * MM)
    figures = measure(hops(2, [gentle, hard]), lift())
    assert figures["seating_velocity_m_per_s"] == pytest.approx([4 * 0.4 * MM / 2.0 * SPEED], rel=1e-6)
    assert figures["impact_velocity_m_per_s"] == pytest.approx([4 * 0.2 * MM / 0.01 * SPEED], rel=1e-6)


def test_the_window_runs_to_the_next_opening_foot_and_no_further():
    foot = TURN + lift().opening_foot
    before = hops(2, [event(0), (foot - 0.3, foot - 0.1, 0.7 * MM), event(1)])
    after = hops(2, [event(0), (foot + 0.1, foot + 0.3, 0.7 * MM), event(1)])
    assert foot - 0.3 > np.pi  # across the revolution's end
    assert measure(before, lift())["bounce_mm"] == pytest.approx([0.7], rel=1e-6)
    assert measure(after, lift())["bounce_mm"] == pytest.approx([0.0], abs=1e-9)


def test_a_late_touch_counts_from_the_nominal_closing():
    nominal = lift().closing_angle(LASH)
    late = nominal + 0.2
    figures = measure(hops(2, [event(0, late)]), lift())
    assert figures["bounce_mm"] == pytest.approx([8 * (1 - (nominal / late) ** 2)], rel=1e-6)
    assert figures["seating_velocity_m_per_s"] == pytest.approx([2 * 8 * MM / late * SPEED], rel=1e-6)


@pytest.mark.parametrize("leaked", [0.05 * MM, -0.05 * MM])
def test_what_an_adjuster_has_leaked_is_lash_at_the_nominal_closing(leaked):
    """An adjuster that has filled instead leaves the nominal closing where the lash has it."""
    elements = [*ELEMENTS, (0, 1, False, False, 1e7, 0.0, 0.0, 0.0)]
    law = laws([LINEAR] * 3 + [OIL], [e[4] for e in elements], leak=[0.0, 0.0, 0.0, 1e6])
    hydraulic = train([0.1, 0.1], elements, valve=1, seat=2, cam_side=(0, 1), laws=law, adjusters=(3,))
    nominal = lift().closing_angle(LASH + max(0.0, leaked))
    late = nominal + 0.2
    motion = hops(2, [event(0, late)])
    since_opening = np.interp(motion.angle, [lift().opening_foot + 0.1, 0.0, np.pi, 3.5], [0.0, 1.0, 1.0, 0.0])
    force = np.pad(motion.force, ((0, 0), (0, 1)))
    motion = replace(motion, train=hydraulic, force=force, memory=3e-4 + leaked * since_opening[:, None])
    figures = measure(motion, lift())
    assert figures["bounce_mm"] == pytest.approx([8 * (1 - (nominal / late) ** 2)], rel=1e-5)


def test_a_hop_before_the_greatest_lift_is_no_touch():
    figures = measure(hops(2, [(-1.4, -1.3, 0.5 * MM), event(0)]), lift())
    assert figures["bounce_mm"] == pytest.approx([0.0], abs=1e-9)
    assert figures["seating_velocity_m_per_s"] == pytest.approx([2 * 8 * MM * SPEED], rel=1e-6)


def test_never_seats_and_never_leaves():
    angle = angles(2)
    floats = measure(record(angle, 2 * MM + MM * np.cos(angle), -MM * np.sin(angle)), lift())
    assert all(np.isnan(floats[k][0]) for k in ("bounce_mm", "seating_velocity_m_per_s", "impact_velocity_m_per_s"))
    rests = measure(record(angle, np.full_like(angle, -1e-6), 0 * angle), lift())
    assert rests["bounce_mm"][0] == rests["seating_velocity_m_per_s"][0] == rests["dynamic_area_mm_deg"][0] == 0.0


def test_dynamic_area():
    parts = [event(0), event(1), (1.1, 1.3, 0.3 * MM)]
    figures = measure(hops(3, parts), lift())
    main, hop = 2 / 3 * 8 * 2.0 / DEG, 2 / 3 * 0.3 * 0.2 / DEG
    assert figures["dynamic_area_mm_deg"] == pytest.approx([main + hop, main], rel=1e-6)


def separated(parts_cam, parts_tip, revolutions=2):
    """Follower off the cam and valve off the follower by the given hops; both pressed 2 um together elsewhere."""
    angle = angles(revolutions, [k for p in (*parts_cam, *parts_tip) for k in p[:2]])
    pressed = np.stack([0 * angle - 2e-6, 0 * angle])
    gap, tip = (pressed + sum(np.stack(parabola(angle, *part)) for part in parts) for parts in (parts_cam, parts_tip))
    follower = np.stack([lift()(angle), lift()(angle, 1)]) + gap
    return record(angle, follower[0] - LASH + tip[0] - TOUCH, follower[1] + tip[1], follower)


def hop_width(width, height):
    """Angle over which a parabola of `height` stands above 2 um [deg]."""
    return width * np.sqrt(1 - 2e-6 / height) / DEG


def test_jump_is_the_largest_of_a_contact_and_its_total_angle():
    hops_of_cam = [(0.2, 0.5, 0.4 * MM), (-0.6, -0.5, 0.1 * MM)]
    figures = measure(separated(hops_of_cam, [(0.7, 1.05, 0.3 * MM)]), lift())
    assert figures["jump_mm"] == pytest.approx([0.4 - 0.002], rel=1e-6)
    cam = hop_width(0.3, 0.4 * MM) + hop_width(0.1, 0.1 * MM)
    assert figures["jump_deg"] == pytest.approx([cam], rel=1e-6)
    swapped = measure(separated([(0.7, 1.05, 0.3 * MM)], [(0.2, 0.5, 0.4 * MM)]), lift())
    assert swapped["jump_mm"] == pytest.approx([0.398], rel=1e-6)
    assert swapped["jump_deg"] == pytest.approx([hop_width(0.35, 0.3 * MM)], rel=1e-6)


def test_a_preloaded_contact_separates_later():
    motion = separated([], [(0.2, 0.5, 0.4 * MM)])
    preloaded = replace(motion, train=replace(TRAIN, preload=np.array([0.0, 300.0, 200.0])))
    assert measure(preloaded, lift())["jump_mm"] == pytest.approx([0.398 - 0.003], rel=1e-6)


def test_separation_outside_the_duration_is_lash_not_jump():
    figures = measure(separated([(1.3, 1.5, 0.4 * MM)], [(-1.6, -1.3, 0.3 * MM)]), lift())
    assert figures["jump_mm"][0] == 0.0 and figures["jump_deg"][0] == 0.0
    half = lift().half_duration
    across = measure(separated([(half - 0.1, half + 0.1, 0.4 * MM)], []), lift())
    assert across["jump_deg"][0] == pytest.approx(hop_width(0.2, 0.4 * MM) / 2, rel=1e-6)


def test_excess_lift():
    figures = measure(separated([(0.2, 0.5, 0.4 * MM)], [(0.2, 0.5, 0.1 * MM)]), lift())
    assert figures["excess_lift_mm"] == pytest.approx([0.5 - 0.004 - TOUCH / MM], rel=1e-6)
    below_lash = measure(hops(2, [event(0, 0.5), (2.0, 2.2, 0.6 * MM)]), lift())
    assert below_lash["excess_lift_mm"] == pytest.approx([0.6], rel=1e-6)


def test_contact_forces_of_both_contacts_inside_the_duration_only():
    angle = angles(2, count=2003)
    force = np.full((len(angle), 3), 500.0)
    inside = np.abs(angle) <= lift().half_duration + 0.02  # outside, but for more than a sample's width
    force[:, 0] = np.where(inside, 500 + 300 * np.sin(7 * angle + 0.1), 9000.0)
    force[:, 1] = np.where(inside, 450 + 400 * np.sin(6 * angle), 0.0)
    force[:, 2] = 99_000.0
    figures = measure(record(angle, *parabola(angle, *event(0)), force=force), lift())
    # the parabola through three samples of a sine, against the largest sample's 0.02 N
    assert figures["contact_force_max_N"] == pytest.approx([850.0], abs=1e-3)
    assert figures["contact_force_min_N"] == pytest.approx([50.0], abs=1e-3)


@pytest.mark.parametrize(("high", "largest"), [(2.5, 100.0), (2.3, 100.0 - 0.4**2)])
def test_the_vertex_between_two_samples_counts_where_it_is_inside(high, largest):
    """A parabola with its top at 2.4, of which the nearest sample is at 2."""
    angle = np.arange(5.0)
    assert _force_extremes(angle, 100.0 - (angle - 2.4) ** 2, 1.0, high)[1] == pytest.approx(largest)


def test_doubled_samples_change_nothing():
    motion = hops(2, [event(0), (1.1, 1.3, 0.3 * MM)], 2003)
    doubled = np.sort(np.concatenate([np.arange(len(motion.angle)), np.arange(0, len(motion.angle), 7)]))
    fields = (getattr(motion, k)[doubled] for k in ("angle", "lift", "x", "v", "force"))
    plain, twice = measure(motion, lift()), measure(Response(TRAIN, SPEED, *fields), lift())
    for name in QUANTITIES:
        assert twice[name] == pytest.approx(plain[name], rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("seed", range(8))
def test_a_revolution_is_measured_as_in_the_record_with_the_next_one(seed):
    """Bit by bit, on a motion that trembles everywhere, over the span that each metric reads."""
    rng = np.random.default_rng(seed)
    motion = hops(2, [event(0), (2.2, TURN - 1.9, 0.3 * MM), event(1)], 1001 + 2 * seed)
    x, v, force = (getattr(motion, k) * rng.uniform(0.9, 1.1, getattr(motion, k).shape) for k in ("x", "v", "force"))
    middle = np.searchsorted(motion.angle, np.pi)
    motion = replace(motion, x=x + 0.1 * MM * rng.normal(size=x.shape), v=v, force=force)
    halves = [slice(None, middle + 1), slice(middle, None)]
    one, after = (replace(motion, **{k: getattr(motion, k)[at] for k in SERIES if k != "memory"}) for at in halves)
    after = replace(after, angle=after.angle - TURN)
    together = measure(joined([one, after]), lift())
    assert measure_first(one, after, lift()) == together and together["bounce_mm"] > 0


def test_one_revolution_is_too_short():
    with pytest.raises(ValueError, match="two revolutions"):
        measure(hops(1, [event(0)]), lift())


def test_hermite_is_exact_for_a_cubic():
    cubic = np.polynomial.Polynomial([0.3, -1.0, -0.2, 0.5])
    angle = np.array([-2.0, -0.4, -0.4, 0.7, 2.0])
    curve = Hermite(angle, cubic(angle), cubic.deriv()(angle))
    at = np.linspace(-2, 2, 33)
    assert np.allclose(curve(at), cubic(at), atol=1e-14)
    assert np.allclose(curve.slope(at), cubic.deriv()(at), atol=1e-13)
    roots, peak = np.sort(cubic.roots()), np.min(cubic.deriv().roots())
    assert curve.maximum(-2, 1.5) == pytest.approx(cubic(peak))
    assert curve.falls_through_zero(-2, 2) == pytest.approx(roots[1:2])
    assert curve.positive_spans(-2, 2) == pytest.approx(np.array([roots[:2], [roots[2], 2.0]]))
    whole = cubic.integ()
    assert curve.integral(-1.3, 1.1) == pytest.approx(whole(1.1) - whole(-1.3))


def test_hermite_goes_on_by_its_first_and_last_piece():
    curve = Hermite(np.arange(3.0), np.array([0.0, 1.0, 5.0]), np.array([1.0, 1.0, 7.0]))
    assert curve(np.array([-1e-12, 2.0 + 1e-12])) == pytest.approx([0.0, 5.0], abs=1e-10)
    assert curve.slope(np.array([-1e-12, 2.0 + 1e-12])) == pytest.approx([1.0, 7.0], abs=1e-10)
