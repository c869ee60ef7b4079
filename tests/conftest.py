"""Settings that hold for the whole suite: no windows, and in the smooth path no silent broadcasting."""

import os

import pytest

os.environ["MPLBACKEND"] = "Agg"


@pytest.fixture(autouse=True)
def _no_rank_promotion(request):
    """JAX arrays of different rank meet only where the code says so; double precision is camopt's own business."""
    if "smooth" not in request.node.path.parts:
        yield
        return
    import jax

    with jax.numpy_rank_promotion("raise"):
        yield
