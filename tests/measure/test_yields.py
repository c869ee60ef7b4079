"""Trains as built and what they tell: common draws, the interval's coverage, what breaks first, blame.

Where shares are counted in looks the interval covers what it says, and counting ends where a look decides.
"""

import re
from functools import cache

import numpy as np
import pytest
from scipy.stats import binomtest, norm

import camopt
from camopt.measure.as_built import drawn_waves
from camopt.measure.yields import EARLY, Looks, UsedLimits, counted, rank_correlation_shares, share_of, yield_record
from camopt.optimizer.accuracy import ACCURACIES
from camopt.optimizer.as_built.statement import looks_of
from camopt.scene import InputError, load_scene, parse_scene
from camopt.scene.as_built import deviates
from tests.scene.test_load import EXAMPLE

MASS = '\n[[tolerance]]\nof = "valve.mass_kg"\nrelative = 0.05\n'
GROUND = "\n[grinding]\nerror_um = 2.0\n"


def scene(added: str = MASS + GROUND):
    return parse_scene(EXAMPLE + added, "mine.toml")


def test_a_longer_list_begins_with_the_shorter_one():
    lift = camopt.polydyne(scene())
    few, more = camopt.trains_as_built(scene(), 3, seed=4), camopt.trains_as_built(scene(), 5, seed=4)
    (last,) = camopt.trains_as_built(scene(), 1, seed=4, first=4)
    for one, other in [*zip(few, more[:3], strict=True), (last, more[4])]:
        assert one.train.mass[0] == other.train.mass[0] and one.number == other.number
        np.testing.assert_array_equal(one.cam(lift).coefficients, other.cam(lift).coefficients)
    assert len({one.train.mass[0] for one in more}) == 5
    assert camopt.trains_as_built(scene(), 1, seed=5)[0].train.mass[0] != few[0].train.mass[0]


def test_the_ground_cam_is_off_by_the_stated_error_and_half_of_it():
    (one,), lift, angle = camopt.trains_as_built(scene(), 1), camopt.polydyne(scene()), np.linspace(-3.0, 3.0, 20_001)
    (half,) = camopt.trains_as_built(scene(MASS + GROUND.replace("2.0", "1.0")), 1)
    error = one.cam(lift)(angle) - lift(angle)
    assert np.abs(error).max() == pytest.approx(2e-6, rel=1e-2)
    np.testing.assert_allclose(half.cam(lift)(angle) - lift(angle), 0.5 * error, atol=1e-12)
    (without,) = camopt.trains_as_built(scene(MASS), 1)
    assert without.cam(lift) is lift and list(without.draws) == ["valve.mass_kg"]


def test_waves_of_grinding_have_one_expected_size_and_any_phase():
    """A hundredth is three standard deviations of these means."""
    parts = drawn_waves(3, (1, 100_000)).reshape(2, -1)
    np.testing.assert_allclose(parts @ parts.T / 100_000, 0.5 * np.eye(2), atol=0.01)


def test_bad_counts_are_refused():
    with pytest.raises(InputError, match="at least one"):
        camopt.trains_as_built(scene(), 0)
    with pytest.raises(InputError, match="no train was measured"):
        share_of(np.array([], bool))


def test_the_interval_holds_a_known_yield_as_often_as_it_says():
    """A train holds where its mass is drawn no more than one standard deviation too heavy: the yield is Phi(1).

    The exact interval covers at least 95 %; 400 repetitions of 200 trains resolve that to about one per cent.
    """
    true, inside, drawn = norm.cdf(1.0), 0, scene(MASS)
    draws = np.array([deviates(drawn, 0, i)["valve.mass_kg"][0] for i in range(80_000)]).reshape(400, 200)
    for repetition in draws:
        found = share_of(repetition <= 1.0)
        inside += found.low <= true <= found.high
    assert inside / len(draws) >= 0.95 - 2 * np.sqrt(0.05 * 0.95 / len(draws))
    assert share_of(draws.ravel() <= 1.0).share == pytest.approx(true, abs=3 * np.sqrt(true * (1 - true) / draws.size))


def used(*trains) -> UsedLimits:
    return UsedLimits(("bounce_max_mm", "jump_max_mm"), np.array([5000.0, 6000.0]), np.array(trains))


def test_what_breaks_first_is_counted_by_limit_and_speed():
    found = used(
        [[0.2, 0.9], [0.1, 1.0]],
        [[0.2, 1.3], [0.1, 1.2]],
        [[0.2, 1.3], [1.1, 1.2]],
        [[0.2, 1.1], [0.1, np.inf]],
    )
    assert found.holds.tolist() == [True, False, False, False]
    assert counted(found) == {
        "jump_max_mm": {"trains": 2, "speeds_rpm": {"5000": 1, "6000": 1}},
        "bounce_max_mm": {"trains": 1, "speeds_rpm": {"6000": 1}},
    }


def test_blame_goes_to_what_moves_the_worst_part():
    random = np.random.default_rng(0)
    draws = {
        "a": random.normal(size=(500, 1)),
        "b": random.normal(size=(500, 3)),
        "idle": random.normal(size=(500, 20)),
    }
    worst = np.exp(2.0 * draws["a"][:, 0] - draws["b"].sum(axis=1) / np.sqrt(3.0))
    worst[:3] = np.inf
    found = rank_correlation_shares(draws, worst)
    assert list(found) == ["a", "b", "idle"]
    assert found["a"] == pytest.approx(0.8, abs=0.06) and found["b"] == pytest.approx(0.2, abs=0.06)
    assert found["idle"] < 0.03
    assert rank_correlation_shares(draws, np.ones(500)) == dict.fromkeys(draws, 0.0)


@pytest.mark.parametrize(("blame", "rest"), [({}, 1.0), ({"a": 0.75}, 0.25), ({"a": 0.75, "b": 0.5}, 0.0)])
def test_what_no_tolerance_explains_is_never_below_nothing(blame, rest):
    """The shares of correlated draws can sum up to more than the whole."""
    assert yield_record(used([[0.5, 0.5], [0.5, 0.5]]), share_of(np.ones(1)), 0, blame)["unexplained"] == rest


def test_a_share_is_shown_in_per_cent_with_its_interval():
    found = share_of(np.array([True, False, False, False]))
    shown, low, high = (float(number) for number in re.findall(r"\d+\.\d", str(found)))
    assert shown == 25.0
    assert (low, high) == pytest.approx((100 * found.low, 100 * found.high), abs=0.05)


KODAMA = load_scene("kodama")
ASKED = (("draft", None), ("standard", None), ("standard", 0.9), ("standard", 0.99))
PLANS = {f"{name} {wanted}": looks_of(ACCURACIES[name], KODAMA, wanted) for name, wanted in ASKED}


def ended(looks: Looks, trains: np.ndarray) -> np.ndarray:
    """The trains (t) up to the look after which counting ends."""
    return next(trains[:n] for n in looks.trains if looks.ends(int(trains[:n].sum()), n))


@pytest.mark.parametrize("holding", [0, 1, 44, 190, 199, 200])
def test_one_look_is_the_interval_of_clopper_and_pearson(holding):
    exact = binomtest(holding, 200).proportion_ci(0.95, method="exact")
    assert Looks((200,)).interval(holding, 200) == pytest.approx((exact.low, exact.high), abs=1e-12)


@pytest.mark.parametrize("true", [0.3, 0.9, 0.94, 0.96, 0.98])
def test_repeated_statements_cover_a_known_share_as_often_as_they_say(true):
    """200 repetitions at a small size. By chance alone so many of them cover 92 to 98 % of the time where 95 are right.

    The exact interval covers a little more than 95 %, which the exact sum below tells without chance.
    """
    looks, random = Looks((40, 100, 200), 0.95), np.random.default_rng(3)
    covered, interval = 0, cache(lambda holding, trains: looks.interval(holding, trains))
    for _ in range(200):
        holds = ended(looks, random.random(200) < true)
        low, high = interval(int(holds.sum()), len(holds))
        covered += low <= true <= high
    found = share_of(holds, looks)
    assert (found.low, found.high, found.trains) == (low, high, len(holds))
    assert 0.93 <= covered / 200 <= 0.99
    assert looks.coverage(true) == pytest.approx(covered / 200, abs=3 * np.sqrt(0.05 * 0.95 / 200))


@pytest.mark.parametrize("name", PLANS)
def test_the_plans_of_all_accuracies_cover_by_the_exact_sum(name):
    """At least 95 % whatever the share is. Where 20 trains and more fail, it is 97 % on the average, and at most 98 %:
    whole trains are counted. Where a handful fail, the next count is far away, and an interval covers more."""
    looks, resolved = PLANS[name], []
    for true in (0.05, 0.3, 0.5, 0.8, 0.9, 0.95, 0.97, 0.99, 0.995):
        covered = looks.coverage(true)
        assert covered >= 0.95 - 1e-9, true
        if sum(n * mass.sum() for n, mass in looks.ended(true)) * min(true, 1.0 - true) >= 20:
            resolved.append(covered)
    assert len(resolved) >= 3 and max(resolved) <= 0.98 and np.mean(resolved) <= 0.97


def test_half_is_decided_for_and_against_alike():
    decided = [Looks((20, 40)).ends(holding, 20) for holding in range(21)]
    assert decided == decided[::-1] and decided[0] and not decided[10]


def test_what_is_not_known_of_the_looks_spoils_the_interval():
    """Clopper and Pearson's interval of the count that ended a statement does not cover 95 %: the looks matter."""
    looks, true = Looks(tuple(range(10, 200, 10)), 0.95), 0.93
    missed = 0.0
    for n, mass in looks.ended(true):
        for holding in np.flatnonzero(mass > 1e-12):
            exact = binomtest(int(holding), n).proportion_ci(0.95, method="exact")
            missed += mass[holding] * (not exact.low <= true <= exact.high)
    assert looks.coverage(true) >= 0.95 > 1.0 - missed - 1e-3


def test_few_trains_decide_what_is_far_from_the_wanted_share():
    looks = Looks((150, 500, 1000), 0.95)
    expected = {p: sum(n * mass.sum() for n, mass in looks.ended(p)) for p in (0.2, 0.95, 0.9999)}
    assert expected[0.2] == pytest.approx(150, abs=1e-6) and expected[0.95] > 990 and expected[0.9999] < 300
    early = sum(mass.sum() for n, mass in looks.ended(0.95) if n < 1000)
    assert early <= 2 * EARLY
    assert sum(mass.sum() for _, mass in looks.ended(0.93)) == pytest.approx(1.0, abs=1e-12)


def test_a_share_of_99_per_cent_is_known_by_4000_trains():
    assert PLANS["standard 0.99"].trains == (600, 2000, 2500, 3000, 3500, 4000)
    assert PLANS["standard None"].trains == (150, 500, 625, 750, 875, 1000)
    low, high = PLANS["standard 0.99"].interval(3960, 4000)
    assert high - low < 0.0066
