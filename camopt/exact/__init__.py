"""Event-exact motion (numba, no JAX): the reference against which the project measures trains with linear laws."""

from pathlib import Path

from camopt.exact.adjoint.sweep import sweep
from camopt.exact.batch import run
from camopt.exact.compilation import forget_stale_programs
from camopt.exact.engine import prepare as prepare
from camopt.exact.kernel.revolution import revolve

for program in (revolve, sweep, run):  # one of each folder: numba keeps the programs of a folder beside its files
    if hasattr(program, "stats"):  # numba may be told to compile nothing
        forget_stale_programs(Path(__file__).parent, Path(program.stats.cache_path))
