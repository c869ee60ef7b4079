"""The smooth, differentiable path (JAX): smoothed contact, motions, metrics, and what `jax.grad` differentiates.

Importing this package turns on 64-bit floats in JAX and keeps compiled programs on disk between runs.
"""

import os
from pathlib import Path

import jax

from camopt.cache import cache_folder


def cache_compilations(folder: Path | None = None) -> Path | None:
    """Keeps JAX's compiled programs in `folder`, by default the user's cache; returns the folder in use.

    A folder that JAX was already given (JAX_COMPILATION_CACHE_DIR) is left as it is. Without a safe folder
    (`camopt.cache.cache_folder`) the function returns None, and programs are compiled anew in each run.
    """
    given = jax.config.values["jax_compilation_cache_dir"]
    if given is not None and folder is None:
        return Path(given)
    folder = folder or cache_folder(f"jax-{jax.__version__}")
    if folder is None:
        return None
    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    return folder


# Before equinox is first imported: its error checks are host callbacks, which JAX <= 0.10 refuses to cache on disk.
os.environ.setdefault("EQX_ON_ERROR", "nan")
jax.config.update("jax_enable_x64", True)
cache_compilations()
