"""The steps of the search for a yield, with programs and trains of which it is told what they do."""

from types import SimpleNamespace

import numpy as np
import pytest

from camopt.highs import Infeasible
from camopt.optimizer.as_built import steps
from camopt.optimizer.as_built.steps import YieldSearch, first_level, smaller_cams
from camopt.scene import parse_scene
from camopt.scene.errors import NoCamFound
from tests.scene.test_load import EXAMPLE

SCENE = parse_scene(EXAMPLE, "mine.toml")


class Priced:
    """A program whose cams are the larger the lower the price, and of whose trains the more fail the larger the cam."""

    def __init__(self, trains: int, error: Exception | None = None):
        self.drawn, self.prices, self.farther, self._error = Failing(trains), [], [], error

    def step(self, price, farther):
        if self._error:
            raise self._error
        self.prices.append(price)
        self.farther.append(farther)
        self.cam = self.mean = self.cam_of((0.5 - 0.05 * np.log10(price)) * ONE)
        self.drawn.judge_area(self.cam.area_ratio)

    def cam_of(self, z):
        """A cam whose area ratio is its coefficient."""
        return SimpleNamespace(area_ratio=z.item(), z=z, lift=SimpleNamespace(area=z.item()))


class Failing:
    """Trains of which a tenth fail with an area ratio of 0.52, and a tenth more with every hundredth."""

    has_memory = False

    def __init__(self, trains: int):
        self.trains, self.used = [None] * trains, np.zeros((trains, 1, 2))

    @property
    def failing(self):
        return int(np.sum(self.used[:, 0, 0] > 1.0))

    def judge_area(self, area_ratio):
        self.used[:] = np.where(np.arange(len(self.trains)) < 1000.0 * (area_ratio - 0.51), 2.0, 0.5)[:, None, None]
        return np.ones(self.used.shape[::2], dtype=bool)


ONE = np.ones((1, 1))


def priced(monkeypatch, slopes: Priced) -> YieldSearch:
    search = YieldSearch(0.9, slopes, Failing(100), 100)
    monkeypatch.setattr(search, "_judge", lambda lift: search.unseen.judge_area(lift.area))
    return search


def test_the_price_leads_to_the_largest_cam_that_holds(monkeypatch):
    slopes = Priced(100)
    search = priced(monkeypatch, slopes)
    search.follow_gradients()
    most = 0.51 + search.permitted_failures(100) / 1000.0
    assert most - steps.NEAR_ENOUGH < search.best.area_ratio <= most < search.nearest_rejected.area_ratio
    assert steps.STEPS < len(slopes.prices) < steps.STEPS + steps.JUDGED
    assert slopes.farther == [*[False] * steps.STEPS, *[True] * (len(slopes.prices) - steps.STEPS)]


@pytest.mark.parametrize("failing, change", [(100, 2.0), (50, 1.77), (5, 1.037), (0, 0.663)])
def test_the_price_follows_how_many_trains_fail(monkeypatch, failing, change):
    """Of a hundred 6 may fail, and of those that shape the cam 4.2: it changes by the fourth root, twofold at most."""
    slopes = Priced(100)
    search = priced(monkeypatch, slopes)
    slopes.cam_of = lambda z: SimpleNamespace(
        area_ratio=0.51 + (failing - 0.5) / 1000.0, z=z, lift=SimpleNamespace(area=0.0)
    )
    monkeypatch.setattr(steps, "JUDGED", 0)
    search.follow_gradients()
    assert np.array(slopes.prices[1:]) / slopes.prices[:-1] == pytest.approx(change, abs=1e-3)


@pytest.mark.parametrize(
    "failing, change, judged",
    [(7, steps.LEAST_JUDGED, steps.JUDGED), (6, 1.0 / steps.LEAST_JUDGED, 1 + steps.IDLE), (50, 1.642, steps.JUDGED)],
)
def test_once_unseen_trains_judge_the_price_moves_until_a_cam_is_on_the_other_side(
    monkeypatch, failing, change, judged
):
    """It does not where cams that hold are no larger any more: limits on the shape bind alone."""
    slopes = Priced(100)
    search = priced(monkeypatch, slopes)
    slopes.cam_of = lambda z: SimpleNamespace(
        area_ratio=0.51 + (failing - 0.5) / 1000.0, z=z, lift=SimpleNamespace(area=0.0)
    )
    monkeypatch.setattr(search, "_judge", lambda lift: search.unseen.judge_area(0.51 + (failing - 0.5) / 1000.0))
    search.follow_gradients()
    prices = np.array(slopes.prices[steps.STEPS :])
    assert len(prices) == judged and prices[1:] / prices[:-1] == pytest.approx(change, abs=1e-3)


def in_turn(monkeypatch, areas: list[float]) -> YieldSearch:
    """A search whose steps have cams of these area ratios once unseen trains judge them."""
    slopes = Priced(100)
    search, sizes = priced(monkeypatch, slopes), iter([*[0.5] * steps.STEPS, *areas])

    def step(price, farther):
        slopes.cam = slopes.mean = slopes.cam_of(next(sizes) * ONE)

    monkeypatch.setattr(slopes, "step", step)
    return search


@pytest.mark.parametrize(
    "cams, best, nearest_rejected",
    [([(0.52, False), (0.53, False), (0.525, True)], 0.525, 0.53),
     ([(0.52, False), (0.55, False), (0.51, True)], 0.51, 0.52),
     ([(0.51, True), (0.505, False), (0.512, True), (0.511, False), (0.53, False)], 0.512, 0.53)],
)  # fmt: skip
def test_the_steps_end_at_a_larger_cam_that_does_not_hold(monkeypatch, cams, best, nearest_rejected):
    """Trains may fail with a cam while the mean still settles, and hold a larger one after it."""
    search, holds = in_turn(monkeypatch, [area for area, _ in cams]), dict(cams)
    monkeypatch.setattr(search, "_judge", lambda lift: search.unseen.judge_area(0.5 if holds[lift.area] else 0.6))
    monkeypatch.setattr(search, "bisect", lambda: None)
    search.follow_gradients()
    assert (search.best.area_ratio, search.nearest_rejected.area_ratio) == (best, nearest_rejected)
    assert search.steps == steps.STEPS + len(cams)


def test_between_a_cam_that_holds_and_a_larger_one_that_does_not_their_means_are_judged(monkeypatch):
    """The program swings about the price at which as many trains fail as may: its next cam may be far off."""
    search = in_turn(monkeypatch, [0.5, 0.55])
    search.follow_gradients()
    assert search.steps == steps.STEPS + 2 + 6  # 0.05 is halved six times
    assert steps.NEAR_ENOUGH / 2.0 < search.nearest_rejected.area_ratio - search.best.area_ratio < steps.NEAR_ENOUGH
    assert search.best.area_ratio <= 0.51 + search.permitted_failures(100) / 1000.0 < search.nearest_rejected.area_ratio


def test_the_way_leads_to_the_cam_with_which_fewest_trains_fail(monkeypatch):
    """Of cams of two programs a much larger one may nearly hold, and smaller ones of the other not at all."""
    search = priced(monkeypatch, Priced(100))
    small, near, far = (search.slopes.cam_of(area * ONE) for area in (0.4, 0.45, 0.54))
    search.held, search.rejected = [small], [(30, near), (9, far)]
    assert search.nearest_rejected is far
    search.bisect()
    most = 0.51 + search.permitted_failures(100) / 1000.0
    assert most - steps.NEAR_ENOUGH < search.best.area_ratio <= most


def test_where_slopes_lead_to_no_cam_smaller_openings_do(monkeypatch):
    def judged(most: float) -> list[float]:
        slopes, areas = SimpleNamespace(cam_of=lambda z: SimpleNamespace(area_ratio=z)), []
        search = YieldSearch(0.9, slopes, Failing(100), 100)

        def evaluate(cam, stage):
            areas.append(cam.area_ratio)
            search.held += [cam] if cam.area_ratio <= most else []
            return 7

        monkeypatch.setattr(search, "evaluate", evaluate)
        smaller_cams(search, lambda level, z: level, 0.4, None)
        return areas

    levels = [*(0.4 / 2.0**k for k in range(6)), 0.0, -0.1, -0.2]
    assert [judged(most) for most in (0.1, 0.0, -0.2)] == [levels[:3], levels[:7], levels]
    with pytest.raises(NoCamFound, match="90 % of the drawn trains hold no cam that was tried: of 100 trains 7 fail"):
        judged(-0.9)


@pytest.mark.parametrize("error", [Infeasible(""), ArithmeticError()])
def test_a_program_that_is_not_solved_leaves_the_cams_that_hold(monkeypatch, error):
    slopes = Priced(100, error)
    search = priced(monkeypatch, slopes)
    search.held = known = [SimpleNamespace(area_ratio=0.5)]
    search.follow_gradients()
    assert search.held is known and search.steps == 0


@pytest.mark.parametrize(
    "fails, levels, ends",
    [({0.4: 2.0}, [0.4], 0.4), ({0.4: 9.0, 0.2: 4.0, 0.1: 0.0}, [0.4, 0.2, 0.1], 0.1),
     ({0.4: 0.0, 0.8: 0.4, 1.6: 9.0}, [0.4, 0.8, 1.6, 0.8], 0.8), ({0.4: 0.0, 0.8: 0.6}, [0.4, 0.8], 0.8),
     (dict.fromkeys([0.4, 0.8, 1.6, 3.2], 0.0), [0.4, 0.8, 1.6, 3.2], 3.2)],
)  # fmt: skip
def test_slopes_begin_where_some_more_trains_fail_than_may(fails, levels, ends):
    """From a level of 1.6 on the limits bind no more."""
    tried, slopes = [], SimpleNamespace(drawn=Failing(10))

    def move_to(z):
        tried.append(z)
        slopes.cam = SimpleNamespace(area_ratio=min(z, 1.6), z=z)
        return fails[z]

    slopes.move_to = move_to
    search = SimpleNamespace(slopes=slopes, report=lambda *_: None)
    level = first_level(search, lambda level, z: level, None)
    assert tried == levels and tried[-1] == level == ends
