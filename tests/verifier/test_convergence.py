"""Step halving, on a method whose answer is a known function of its steps."""

from types import SimpleNamespace

import numpy as np
import pytest

from camopt.exact.engine import prepare
from camopt.exact.settled import settled_metrics
from camopt.measure.settling import Figures
from camopt.scene import QUANTITIES, MotionRefused
from camopt.scene.settled import APERIODIC, RANGED
from camopt.scene.train import GROUND
from camopt.verifier import convergence as module
from camopt.verifier.convergence import FEWEST_STEPS, FINEST, StepRefinement, Tolerances, first_steps
from camopt.verifier.methods import rkg, tmm
from tests.verifier.scenes import from_rest
from tests.verifier.trains import no_lift, train, two_springs

SLOW = train([1.0], [(GROUND, 0, False, False, 100.0, 0.0, 0.0, 0.0)])


def steps(halving: int) -> int:
    return (FEWEST_STEPS << halving) + halving


@pytest.fixture
def answers(monkeypatch):
    """Runs converge on figures(steps) -> values by revolution; steps are counted in units of the first."""

    def run(figures, periodic=True, halvings=4):
        def settled(steps, state, *_, **__):
            values = figures(steps // FEWEST_STEPS)
            if values is None:
                raise MotionRefused("too coarse")
            by_metric = values if isinstance(values, dict) else {}
            values = [0.0] if isinstance(values, dict) else values
            by_name = Figures({name: np.asarray(by_metric.get(name, values), dtype=float) for name in QUANTITIES})
            return SimpleNamespace(state=state + 1, revolutions=7, periodic=periodic, faded=True, figures=by_name)

        monkeypatch.setattr(module, "settle_and_measure", settled)
        prepare = lambda train, lift, cam_speed, steps: steps  # noqa: E731
        return StepRefinement(prepare, SLOW, no_lift(), 1.0, np.zeros(2), Tolerances(2.0, halvings)).answer()

    return run


def test_first_steps_follow_the_fastest_rate():
    assert first_steps(SLOW, 1.0) == FEWEST_STEPS
    stiff = train([0.25], [(GROUND, 0, False, False, 1e8, 0.0, 0.0, 0.0)])  # 20 000 rad/s
    assert first_steps(stiff, 100.0) == int(np.ceil(2 * np.pi * 20_000 / 100 / 0.6))
    heavy = train([1.0], [(GROUND, 0, False, False, 1.0, 5e4, 0.0, 0.0)])  # over-damped: rate c/m
    assert first_steps(heavy, 100.0) == int(np.ceil(2 * np.pi * 5e4 / 100 / 0.6))
    assert first_steps(two_springs(), 1e-3) > FEWEST_STEPS


def test_stands_after_two_halvings_that_change_nothing(answers):
    done = answers(lambda n: [0.1, 0.1])
    assert done.converged and done.steps_per_revolution == steps(2)
    assert done.error["bounce_mm"] == FINEST["bounce_mm"]
    assert done.revolutions == 3 * 7 + 2 * (2 + 1)  # all that were run before the last measured ones
    assert np.all(done.state == 3.0)  # each finer step went on from the coarser one's state


@pytest.mark.parametrize(("reported", "spread"), [(False, (0.1, 0.3)), (True, (0.05, 0.4))])
def test_the_range_of_a_wandering_motion_is_that_of_many_revolutions_where_it_is_stated(monkeypatch, reported, spread):
    """At the last step, from where it had come to; its doubt is then the width of the range."""
    ran = []

    def settled(steps, state, lift, most, *, aperiodic=APERIODIC, **_):
        ran.append((steps, most, aperiodic))
        values = np.array([0.05, 0.4] if aperiodic == RANGED else [0.1, 0.3])
        figures = Figures(dict.fromkeys(QUANTITIES, values))
        return SimpleNamespace(state=state, revolutions=40, periodic=False, faded=True, figures=figures)

    monkeypatch.setattr(module, "settle_and_measure", settled)
    tolerances = Tolerances(2.0, 4, reported=reported)
    start = np.zeros(2)
    done = StepRefinement(lambda train, lift, speed, steps: steps, SLOW, no_lift(), 1.0, start, tolerances).answer()
    assert done.converged and not done.periodic and done.range["bounce_mm"] == spread
    assert done.doubt("bounce_mm") == done.error["bounce_mm"] + spread[1] - spread[0]
    assert reported == (ran[-1] == (done.steps_per_revolution, 0, RANGED))


def test_the_range_of_a_wandering_motion_is_the_same_with_samples_and_without(monkeypatch):
    """To a tenth of its width, since both follow a motion that multiplies their roundings. Ranges of 40 revolutions
    differ by an eighth on some processors, those of 160 by a hundredth."""
    monkeypatch.setattr(module, "RANGED", 160)
    (case, rest), tolerances = from_rest("kodama", 5800.0), Tolerances(5.0, 1, unchanged_halvings=1, reported=True)
    both = (None, settled_metrics)
    sampled, without = (StepRefinement(prepare, *case, rest, tolerances, many).answer() for many in both)
    assert not sampled.periodic and not np.array_equal([*without.range.values()], [*sampled.range.values()])
    for name in ("bounce_mm", "jump_mm", "contact_force_max_N", "seating_velocity_m_per_s"):
        low, high = sampled.range[name]
        assert without.range[name] == pytest.approx((low, high), rel=0, abs=0.1 * (high - low)) and high > low


def test_error_is_twice_the_distance_to_the_coarser_answers(answers):
    # 0.1 + 0.008/n: changes 0.004, 0.002, 0.001, 0.0005 against 0.002 + 1 % of the value
    done = answers(lambda n: [0.1 + 0.008 / n])
    assert done.converged and done.steps_per_revolution == steps(3)
    assert done.worst["bounce_mm"] == pytest.approx(0.101)
    assert done.error["bounce_mm"] == pytest.approx(2 * 0.007)  # from the value three halvings earlier


def test_an_erratic_error_of_order_one_is_rarely_larger_than_its_estimate(answers):
    """Late at every closing by a share of the step that is as good as drawn anew: 1 in 250 with three coarser answers,
    1 in 24 where two are all that there is; the larger of two distances alone would miss 1 in 6."""
    draws, rng = 400, np.random.default_rng(3)
    missed = 0
    for _ in range(draws):
        late = rng.uniform(0.0, 1e-4, 9)  # mm at the first step: every halving stands at once
        done = answers(lambda n, late=late: [0.1 + late[n.bit_length()] / n], halvings=2)
        missed += abs(done.worst["bounce_mm"] - 0.1) > done.error["bounce_mm"]
    assert missed / draws < 0.08  # 1 in 24, and four standard deviations of 400 draws


def test_what_keeps_moving_is_not_converged(answers):
    done = answers(lambda n: [0.1 * n])
    assert not done.converged and done.steps_per_revolution == steps(4)
    assert done.error["bounce_mm"] == pytest.approx(2 * 1.4)
    assert not answers(lambda n: [0.1 * max(n, 2)]).converged  # each is held against the one before it


def test_an_aperiodic_motion_may_move_within_its_range(answers):
    wander = {1: 0.0, 2: 0.05, 4: 0.0, 8: 0.05, 16: 0.0}
    assert not answers(lambda n: [0.5 + wander[n], 0.4 + wander[n]], periodic=True).converged
    assert answers(lambda n: [0.5 + wander[n], 0.4 + wander[n]], periodic=False).converged
    assert not answers(lambda n: [0.5 + 4 * wander[n], 0.4 + 4 * wander[n]], periodic=False).converged


def test_a_refused_step_is_halved_on_and_begins_again_from_rest(answers):
    done = answers(lambda n: None if n < 4 else [0.1])
    assert done.converged and done.steps_per_revolution == steps(4)
    assert np.all(done.state == 3.0)
    lost = answers(lambda n: None)
    assert not lost.converged and lost.state is None and np.isnan(lost.worst["bounce_mm"])


def test_nothing_converges_before_the_fastest_rate_is_resolved(answers, monkeypatch):
    monkeypatch.setattr(module, "FINEST_STEPS", 4 * FEWEST_STEPS)
    monkeypatch.setattr(module, "first_steps", lambda train, cam_speed: steps(2) + 1)
    done = answers(lambda n: [0.1])
    assert done.steps_per_revolution == steps(2) and not done.converged
    monkeypatch.setattr(module, "first_steps", lambda train, cam_speed: steps(2))
    assert answers(lambda n: [0.1]).converged


def test_a_first_revolution_is_measured_from_the_start_at_every_step():
    case, rest = from_rest("motori-1", 6000)
    done, again = (
        StepRefinement(rkg.prepare, *case, rest, Tolerances(2.0, n, settled=False, steps=steps)).answer()
        for n, steps in ((2, 5760), (0, 4 * 5760 + 2))
    )
    assert done.worst == again.worst and done.steps_per_revolution == 4 * 5760 + 2


def test_not_seating_at_every_step_stands(answers):
    assert answers(lambda n: [np.nan]).converged
    erratic = answers(lambda n: {"bounce_mm": [np.nan], "jump_mm": [0.1 * n]})
    assert erratic.converged and erratic.steps_per_revolution == steps(2) and erratic.error["jump_mm"] > 0.3
    assert not answers(lambda n: [np.nan if n % 3 == 1 else 0.1]).converged


def test_a_halved_step_that_repeats_the_coarser_ones_delay_is_seen():
    """A closing just before a sample of the coarsest grid: at nested grids the force overshoots by the same each time.

    Drawn at random (number 1961 of experiments/random_scenes.py): the printed transition matrix method found 93 640 N
    at three steps, and 91 671 N are right.
    """
    fall, stiffness, damping = 0.2, 2.5e9, 5e4
    ball = train([0.2], [(GROUND, 0, True, False, stiffness, damping, 0.0, 0.0)], force=-2.0, valve=0, seat=0)
    speed, touch = 10.0 * fall, fall
    late = 0.2e-6  # the first sample comes this long after the touch, at every nested grid
    period = (touch + late) * 2
    height = 5.0 * fall**2
    peaks = []
    for steps in (FEWEST_STEPS << 6, FEWEST_STEPS << 7, (FEWEST_STEPS << 7) + 1):
        motion = tmm.prepare(ball, no_lift(), 2 * np.pi / period, steps)(np.array([height, 0.0]))
        peaks.append(motion.force.max())
    assert peaks[0] == pytest.approx(peaks[1], rel=1e-9) and peaks[0] > 1.004 * damping * speed
    assert abs(peaks[2] - peaks[0]) > 1e-3 * peaks[0]


def test_micrometres_that_are_asked_for_are_the_tolerance_of_bounce_and_jump():
    found = Tolerances(5.0).absolute
    assert (found["bounce_mm"], found["jump_mm"]) == pytest.approx((0.005, 0.005))
