"""Compiled programs kept on disk, so that a second start does not compile again."""

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
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.5)
    return folder
