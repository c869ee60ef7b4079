import numpy as np
import pytest
from scipy.stats import qmc

from camopt.cam.families.sobol import DIMENSIONS, sobol


@pytest.mark.parametrize("dimensions", range(1, DIMENSIONS + 2))
def test_the_points_are_scipy_s(dimensions):
    np.testing.assert_array_equal(sobol(64, dimensions), qmc.Sobol(dimensions, scramble=False).random(64))
