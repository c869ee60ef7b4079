"""Settings that hold for the whole suite: no windows, checked shapes, and in the smooth path no silent broadcasting."""

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
"""The tests of this file share nothing: any worker may take any of them."""


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """As `--dist loadfile`, which keeps the fixtures of a file to one worker, but for the file of `APART`."""
    from xdist.scheduler import LoadFileScheduling

    class ByFile(LoadFileScheduling):
        def _split_scope(self, nodeid):
            return nodeid if nodeid.startswith(APART) else super()._split_scope(nodeid)

    return ByFile(config, log)


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


@pytest.fixture(scope="module")
def browser():
    """Chromium for the tests of one file: as long as it runs, no other may start in its thread."""
    with started_browser() as started:
        yield started


@pytest.fixture(scope="module")
def undrawn():
    """Figures are made and saved with their words alone, from where a module first asks for it: to draw them takes
    longer than most small jobs. tests/plots draws them, and tests/optimizer/test_run.py those of a job."""
    from matplotlib.text import Text

    def words(figure, kind):
        return f"<svg>{escape(' '.join(text.get_text() for text in figure.findobj(Text)))}</svg>".encode()

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("camopt.plots.style.laid_out", lambda figure: nullcontext())
        patch.setattr("camopt.plots.style.picture", words)
        yield
