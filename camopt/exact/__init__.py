"""Event-exact motion (numba, no JAX): the reference against which the project measures trains with linear laws."""

from pathlib import Path

from camopt.exact.adjoint.sweep import sweep
from camopt.exact.batch import run
from camopt.exact.compilation import forget_stale_programs
from camopt.exact.engine import prepare as prepare
from camopt.exact.kernel.revolution import revolve
from camopt.scene import units

CONSTANTS = (Path(units.__file__),)
"""Modules outside this folder whose numbers are compiled into its programs."""

for program in (revolve, sweep, run):  # one of each folder: numba keeps the programs of a folder beside its files
    kept = program.stats.cache_path if hasattr(program, "stats") else None  # numba may be told to compile nothing
    if kept is not None:
        forget_stale_programs(Path(__file__).parent, Path(kept), CONSTANTS)
