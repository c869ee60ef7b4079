"""Paths and text files that a user names: whatever they are, the answer is the text or a sentence."""

import os
from pathlib import Path

from camopt.scene.errors import InputError

LONGEST_SHOWN = 60
"""Characters of the user's own text that a sentence repeats."""


def excerpt(text: str) -> str:
    """The text, quoted, without its middle where it is long."""
    half = LONGEST_SHOWN // 2
    return repr(text) if len(text) <= LONGEST_SHOWN else f"{text[:half]!r} ... {text[-half:]!r}"


def usable_path(path: str | Path, what: str) -> Path:
    """The path, if the system takes it at all, whether or not something is there; `what` begins the sentence.

    Raises InputError for a path that is too long, holds a NUL or no character of a file name, or lies in a folder that
    may not be looked into.
    """
    try:
        os.stat(path)
    except (FileNotFoundError, NotADirectoryError):
        pass
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it holds a character that no file name may have"
        raise InputError(f"{what} {excerpt(str(path))}: the system does not take this path ({reason})") from None
    return Path(path)


def read_text(path: Path, most_bytes: int, what: str, encoding: str = "utf-8") -> str:
    """The text of a file of at most `most_bytes` bytes; `what` it is to be ("scene file") stands in the sentences.

    Raises InputError where the file is larger, cannot be read or is not UTF-8.
    """
    try:
        if path.stat().st_size > most_bytes:
            raise InputError(f"{path}: larger than {most_bytes} bytes, which no {what} needs")
        return path.read_text(encoding=encoding)
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read as UTF-8 text ({error})") from error
