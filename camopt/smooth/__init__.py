"""The smooth, differentiable path (JAX): smoothed contact, motions, metrics, and what `jax.grad` differentiates.

Importing this package turns on 64-bit floats in JAX, keeps compiled programs on disk between runs, and prints a line
when a compilation takes long.
"""

import os
import sys
from pathlib import Path
from threading import Timer, get_ident

import jax
import jax.monitoring

from camopt.cache import cache_folder


def cache_compilations() -> Path | None:
    """Keeps JAX's compiled programs in the user's cache; returns the folder in use.

    A folder that is already set for JAX (JAX_COMPILATION_CACHE_DIR) is left as it is. Without a safe folder
    (`camopt.cache.cache_folder`) the function returns None, and programs are compiled anew in each run.
    """
    configured = jax.config.values["jax_compilation_cache_dir"]
    if configured is not None:
        return Path(configured)
    if (folder := cache_folder(f"jax-{jax.__version__}")) is None:
        return None
    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    return folder


LONG_S = 2.0
"""Seconds after which a line reports a compilation."""


def say_compiling(folder: Path | None) -> None:
    """Prints a line to the error output for every compilation that takes longer than `LONG_S`."""
    where = "in every process, for want of a safe cache folder" if folder is None else f"once, and keeps it in {folder}"
    waiting: dict[int, Timer] = {}

    def listen(event: str, duration_secs: float, **_) -> None:
        if event == "/jax/core/compile/jaxpr_to_mlir_module_duration":  # what comes before a compilation
            timer = Timer(LONG_S, print, [f"camopt: JAX compiles a program, {where}"], {"file": sys.stderr})
            timer.daemon = True
            timer.start()
            waiting[get_ident()] = timer
        elif event == "/jax/core/compile/backend_compile_duration" and get_ident() in waiting:
            waiting.pop(get_ident()).cancel()

    jax.monitoring.register_event_duration_secs_listener(listen)


# Before equinox is first imported: its error checks are host callbacks, which JAX <= 0.10 refuses to cache on disk.
os.environ.setdefault("EQX_ON_ERROR", "nan")
jax.config.update("jax_enable_x64", True)
say_compiling(cache_compilations())
