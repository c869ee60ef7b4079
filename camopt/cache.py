"""The user's cache folder, which holds the compiled programs of earlier processes."""

import os
from pathlib import Path


def cache_folder(name: str) -> Path | None:
    """The folder `camopt/name` in the user's cache folder (XDG_CACHE_HOME, else ~/.cache), created where it is missing.
    Its files are executed, so only this user may write to it. The result is None where the folder cannot be created or
    written to, or where others may write to it; programs are then compiled in each process."""
    try:
        home = Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser())
        folder = home / "camopt" / name
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        status = folder.stat()
    except (OSError, RuntimeError):  # RuntimeError: the user has no home folder
        return None
    if status.st_uid != os.getuid() or status.st_mode & 0o022 or not os.access(folder, os.W_OK):
        return None
    return folder
