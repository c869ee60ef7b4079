"""The user's cache folder: compiled programs of earlier processes."""

import os
from pathlib import Path


def cache_folder(name: str) -> Path | None:
    """`name` in a folder camopt of the user's cache folder (XDG_CACHE_HOME, else ~/.cache), made where missing. What is
    kept there is executed, so the folder is made for this user alone; None where it cannot be made or written to, or
    where others may write to it: programs are then compiled anew in each process."""
    try:
        home = Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser())
        folder = home / "camopt" / name
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        status = folder.stat()
    except (OSError, RuntimeError):  # a RuntimeError where the user has no home
        return None
    if status.st_uid != os.getuid() or status.st_mode & 0o022 or not os.access(folder, os.W_OK):
        return None
    return folder
