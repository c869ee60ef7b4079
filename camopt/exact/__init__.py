"""Event-exact motion (numba, no JAX): the reference of the project where all laws are linear."""

from pathlib import Path

from camopt.exact.compilation import forget_stale_programs
from camopt.exact.engine import prepare as prepare
from camopt.exact.kernel import revolve

if hasattr(revolve, "stats"):  # plain Python where numba is told to compile nothing
    forget_stale_programs(Path(__file__).parent, Path(revolve.stats.cache_path))
