"""Cams that hold only at the speeds at which they were searched are dropped, the largest first; the last one stays."""

from types import SimpleNamespace

import numpy as np
import pytest

from camopt.optimizer.search.journal import Journal
from camopt.optimizer.search.no_jump_stage import Search
from camopt.optimizer.search.search import BETWEEN_SHARE, hold_between


@pytest.mark.parametrize(
    ("used", "stays"),
    [
        ([0.5, 0.7, BETWEEN_SHARE], 3),
        ([0.5, 0.7, BETWEEN_SHARE + 1e-9], 2),
        ([0.5, 1.2, np.inf], 1),
        ([2.0, 1.2, 3.0], 1),
        ([0.5, 3.0, 0.7], 3),
    ],
)
def test_largest_that_holds_between(used, stays):
    def judge(share):
        return SimpleNamespace(share=np.array([[0.1, share]]))

    search = Search(judge, Journal(None), confirmed=[SimpleNamespace(lift=share) for share in used])
    search.best_judged = before = SimpleNamespace(holds=True)
    hold_between(search, judge)
    assert [cam.lift for cam in search.confirmed] == used[:stays]
    if stays == len(used):
        assert search.best_judged is before
    else:
        assert search.best_judged.share[0, 1] == used[stays - 1]


def test_nothing_is_asked_at_listed_speeds():
    search = Search(None, Journal(None), confirmed=[SimpleNamespace(lift=9.0)] * 2)
    hold_between(search, None)
    assert len(search.confirmed) == 2
