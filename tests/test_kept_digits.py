"""The results of small motions stay the same in every method: digits change only by an intended change.

That these results are right is shown by other tests; this test quickly detects any change.
"""

import json

import numpy as np
import pytest

from tests.kept_digits import FIGURES, FILE

KEPT = json.loads(FILE.read_text(encoding="utf-8"))


def test_all_of_them_are_kept():
    assert list(KEPT) == list(FIGURES)


@pytest.mark.parametrize("name", FIGURES)
def test_the_results_equal_the_stored_ones(name):
    expected = np.array(KEPT[name], dtype=float)  # null is not a number
    np.testing.assert_allclose(FIGURES[name](), expected, rtol=1e-7, atol=1e-12)
