"""Settings that hold for the whole suite: no windows, checked shapes, and in the smooth path no silent broadcasting."""

import os

import jaxtyping
import pytest

from tests.checked_shapes import MODULES

os.environ["MPLBACKEND"] = "Agg"
jaxtyping.install_import_hook(MODULES, "tests.checked_shapes.checked")  # before camopt is first imported


SHARED = ("test_exact_rule", "test_families", "test_families_motion", "test_real_trains_rule", "test_smooth_rule")
"""Tests of the rules for `jax.grad`: the cam families' formulas run on arrays of NumPy too, and broadcast as those."""


@pytest.fixture(autouse=True)
def _no_rank_promotion(request):
    """JAX arrays of different rank meet only where the code says so; double precision is camopt's own business."""
    if "smooth" not in request.node.path.parts or request.node.path.stem in SHARED:
        yield
        return
    import jax

    with jax.numpy_rank_promotion("raise"):
        yield
