"""Compiled programs kept on disk, and when they are no longer those of the sources."""

from collections.abc import Sequence
from hashlib import sha256
from pathlib import Path

from camopt.storage import write_bytes

STAMP = "camopt-exact.sha256"


def forget_stale_programs(sources: Path, kept: Path, constants: Sequence[Path] = ()) -> bool:
    """Deletes the programs that numba keeps in the folder `kept` where a source has changed since; returns whether.

    numba compares a program with the file of its own function only, and compiles what it calls from other files into
    it, and the values of the constants that it reads: after a change of one of these it would go on with the old one.
    So all programs of the folder `sources`, and of the folders in it, stand and fall together, with the files of
    `constants` from elsewhere.
    """
    digest = sha256()
    files = {path.relative_to(sources).as_posix(): path for path in sorted(sources.rglob("*.py"))}
    for name, path in (*files.items(), *((path.name, path) for path in constants)):
        digest.update(name.encode() + b"\0" + path.read_bytes())
    current, stamp = digest.hexdigest().encode(), kept / STAMP
    if stamp.exists() and stamp.read_bytes() == current:
        return False
    kept.mkdir(parents=True, exist_ok=True)
    for path in (*kept.glob("*.nbi"), *kept.glob("*.nbc")):
        path.unlink(missing_ok=True)  # another process may be doing the same
    write_bytes(stamp, current)
    return True
