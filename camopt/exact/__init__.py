"""Event-exact motion (numba, no JAX): the reference of the project where all laws are linear."""

from pathlib import Path

from camopt.exact.compilation import forget_stale_programs
from camopt.exact.engine import prepare as prepare
from camopt.exact.kernel import revolve
from camopt.scene import units

CONSTANTS = (Path(units.__file__),)
"""Modules outside this folder whose numbers are compiled into its programs."""
cache = revolve.stats.cache_path if hasattr(revolve, "stats") else None  # numba may be told to compile nothing
if cache is not None:
    forget_stale_programs(Path(__file__).parent, Path(cache), CONSTANTS)
