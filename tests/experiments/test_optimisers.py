"""The optimisers: all of them in the long tests, and the curves of the figure."""

import numpy as np
import pytest

pytest.importorskip("cma")  # of the extra `peers`
from experiments import optimisers
from experiments.support.optimiser_runs import METHODS, run


def test_the_methods_of_the_experiment_are_those_that_run():
    assert set(optimisers.METHODS) == set(METHODS)


@pytest.mark.long
@pytest.mark.parametrize("method", optimisers.METHODS)
def test_every_method_confirms_a_cam_from_the_calmest_one(method):
    found = run("motori-1", method, "calmest", 8.0)
    assert found["area_ratio"] > 0.2 and found["judged"] > 3  # the start has 0.06


def test_the_figure_holds_the_last_area():
    time = np.array([0.0, 1.0, 2.0, 3.0])
    found = optimisers.largest_until([[1.0, 0.5], [2.5, 0.6]], time)
    np.testing.assert_array_equal(found, [-np.inf, 0.5, 0.5, 0.6])
