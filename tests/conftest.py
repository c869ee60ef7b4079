"""Settings that hold for the whole suite: no windows, checked shapes, and in the smooth path no silent broadcasting."""

import os

import jaxtyping
import pytest

from tests.checked_shapes import MODULES

os.environ["MPLBACKEND"] = "Agg"
jaxtyping.install_import_hook(MODULES, "tests.checked_shapes.checked")  # before camopt is first imported


@pytest.fixture(autouse=True)
def _no_rank_promotion(request):
    """JAX arrays of different rank meet only where the code says so; double precision is camopt's own business."""
    if "smooth" not in request.node.path.parts:
        yield
        return
    import jax

    with jax.numpy_rank_promotion("raise"):
        yield
