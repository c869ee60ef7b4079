"""Records by address: compiled functions read what Python laid out, alone and inside a tuple, and keep nothing."""

import sys
from typing import NamedTuple

import numba
import numpy as np

from camopt.programs import pass_by_pointer


@pass_by_pointer
class Pair(NamedTuple):
    first: np.ndarray
    second: np.ndarray


class Holding(NamedTuple):
    pair: Pair
    third: np.ndarray


@numba.njit
def of_record(pair):
    return pair.first[0] + pair.second[1]


@numba.njit
def of_tuple(holding):
    holding.pair.first[0] += 1.0
    return of_record(holding.pair) + holding.third[0]


def test_fields_are_read_and_written_and_no_reference_stays():
    first, second, third = np.array([1.0, 2.0]), np.array([10.0, 20.0]), np.array([100.0])
    before = [sys.getrefcount(array) for array in (first, second, third)]
    for i in range(50):
        assert of_record(Pair(first, second)) == 21.0 + i
        assert of_tuple(Holding(Pair(first, second), third)) == 122.0 + i
    assert [sys.getrefcount(array) for array in (first, second, third)] == before
