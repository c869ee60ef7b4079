"""Compiled programs kept on disk, so that a second start does not compile again."""

import os
from pathlib import Path

import jax


def cache_compilations(folder: Path | None = None) -> Path | None:
    """Keep compiled programs in `folder`, by default ~/.cache/camopt/jax-<version>; returns the folder in use.

    A folder that JAX was already given (JAX_COMPILATION_CACHE_DIR) is left as it is. Cached programs are executed, so
    the folder is created for this user alone. A folder that others may write to, or that cannot be made, is not used:
    the function then returns None, and programs are compiled anew in each run.
    """
    given = jax.config.values["jax_compilation_cache_dir"]
    if given is not None and folder is None:
        return Path(given)
    folder = folder or Path("~/.cache/camopt").expanduser() / f"jax-{jax.__version__}"
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError:
        return None
    status = folder.stat()
    if status.st_uid != os.getuid() or status.st_mode & 0o022 or not os.access(folder, os.W_OK):
        return None
    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.5)
    return folder
