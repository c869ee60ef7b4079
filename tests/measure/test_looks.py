"""Shares that are counted in looks: the interval covers what it says, and counting ends where a look decides."""

from functools import cache

import numpy as np
import pytest
from scipy.stats import binomtest

from camopt.measure.yields import EARLY, Looks, share_of
from camopt.optimizer.accuracy import ACCURACIES
from camopt.optimizer.as_built.statement import looks_of
from camopt.scene import load_scene

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
    assert PLANS["standard 0.99"].trains == (600, 2000, 4000) and PLANS["standard None"].trains == (150, 500, 1000)
    low, high = PLANS["standard 0.99"].interval(3960, 4000)
    assert high - low < 0.0066
