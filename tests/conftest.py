"""Settings of the whole suite: no windows, checked shapes, and no implicit broadcasting on the smooth path."""

import os
from contextlib import nullcontext
from html import escape

import jaxtyping
import pytest

from tests.browser import started_browser
from tests.checked_shapes import MODULES

os.environ["MPLBACKEND"] = "Agg"
jaxtyping.install_import_hook(MODULES, "tests.checked_shapes.checked")  # before camopt is first imported


APART = "tests/experiments/test_experiments.py"
"""The tests of this file are independent: any worker may run any of them."""


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """Like `--dist loadfile`, which runs each file on one worker, except that the tests of `APART` are distributed."""
    from xdist.scheduler import LoadFileScheduling

    class ByFile(LoadFileScheduling):
        def _split_scope(self, nodeid):
            return nodeid if nodeid.startswith(APART) else super()._split_scope(nodeid)

    return ByFile(config, log)


SHARED = ("test_exact_rule", "test_families", "test_families_motion", "test_real_trains_rule", "test_smooth_rule")
"""Tests of the rules for `jax.grad`: the formulas of cam families also run on NumPy arrays, and broadcast like them."""


@pytest.fixture(autouse=True)
def _no_rank_promotion(request):
    """Operations on JAX arrays of different rank are errors unless the code reshapes them explicitly."""
    if "smooth" not in request.node.path.parts or request.node.path.stem in SHARED:
        yield
        return
    import jax

    with jax.numpy_rank_promotion("raise"):
        yield


@pytest.fixture(scope="module")
def browser():
    """Chromium for the tests of one file: while it runs, no second browser can be started in its thread."""
    with started_browser() as started:
        yield started


@pytest.fixture(scope="module")
def undrawn():
    """Figures are saved with their texts only, from the first use in a module on, because drawing them takes longer
    than most small jobs. tests/plots draws figures, and tests/optimizer/test_run.py those of a job."""
    from matplotlib.text import Text

    def words(figure, kind):
        return f"<svg>{escape(' '.join(text.get_text() for text in figure.findobj(Text)))}</svg>".encode()

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("camopt.plots.style.laid_out", lambda figure: nullcontext())
        patch.setattr("camopt.plots.style.picture", words)
        yield
