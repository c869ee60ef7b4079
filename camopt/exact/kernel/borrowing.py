"""Compiled functions that only borrow the arrays they are given."""

from collections.abc import Callable
from typing import Any

from camopt.programs import compiled, inner


def borrowing(function: Callable | None = None, *, from_python: bool = False, **options) -> Any:
    """`inner`, or with `from_python` `compiled`, for a function that makes no array and returns none.

    numba then counts no references in it. By itself it counts those of every array of every tuple that a function is
    given, with two locked instructions each, which is most of the time of a small function: 340 ns against 8 ns a call
    with 24 arrays. A function that does make an array is refused by numba; one that returns an array must not be
    declared so.
    """
    if function is None:
        return lambda f: borrowing(f, from_python=from_python, **options)
    return (compiled if from_python else inner)(function, _nrt=False, **options)
