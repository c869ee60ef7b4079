"""Compiled programs kept on disk, and when they are no longer those of the sources."""

from hashlib import sha256
from pathlib import Path

from camopt.storage import write_bytes

STAMP = "camopt-exact.sha256"


def forget_stale_programs(sources: Path, kept: Path) -> bool:
    """Deletes the programs that numba keeps in the folder `kept` if a source has changed since; returns whether it did.

    numba compares a program with the file of its own function only, and compiles what it calls from other files into
    it: after a change of one of these it would go on with the old one. So all programs of the folder `sources`, and of
    the folders in it, stand and fall together.
    """
    digest = sha256()
    for path in sorted(sources.rglob("*.py")):
        digest.update(path.relative_to(sources).as_posix().encode() + b"\0" + path.read_bytes())
    current, stamp = digest.hexdigest().encode(), kept / STAMP
    if stamp.exists() and stamp.read_bytes() == current:
        return False
    kept.mkdir(parents=True, exist_ok=True)
    for path in (*kept.glob("*.nbi"), *kept.glob("*.nbc")):
        path.unlink(missing_ok=True)  # another process may be doing the same
    write_bytes(stamp, current)
    return True
