"""Paths and text files named by the user: the result is a text or a clear error.

TOML that would exhaust the parser's stack or the machine's memory is refused before it is parsed.
"""

import os
import re
import tomllib
from itertools import accumulate
from pathlib import Path

import tomli_w

from camopt.scene.errors import InputError
from camopt.scene.schema import Scene

LONGEST_SHOWN = 60
"""Largest number of characters of the user's text that a sentence repeats."""


def excerpt(text: str) -> str:
    """The text in quotes, without its middle if it is long."""
    half = LONGEST_SHOWN // 2
    return repr(text) if len(text) <= LONGEST_SHOWN else f"{text[:half]!r} ... {text[-half:]!r}"


def usable_path(path: str | Path, what: str) -> Path:
    """The path, if the operating system accepts it, whether or not a file is there; `what` begins the error sentence.

    Raises InputError for a path that is too long, contains a character that no file name may have, or lies in a folder
    without access.
    """
    try:
        os.stat(path)
    except (FileNotFoundError, NotADirectoryError):
        pass
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it holds a character that no file name may have"
        raise InputError(
            f"{what} {excerpt(str(path))}: the system does not accept this path ({reason}): name another"
        ) from None
    return Path(path)


def read_text(path: Path, most_bytes: int, what: str, encoding: str = "utf-8") -> str:
    """The text of a file of at most `most_bytes` bytes; `what` names its purpose ("scene file") in the error sentences.
    Raises InputError if the file is larger, cannot be read or is not UTF-8."""
    try:
        if path.stat().st_size > most_bytes:
            raise InputError(f"{path}: larger than {most_bytes} bytes, which no {what} needs")
        return path.read_text(encoding=encoding)
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read as UTF-8 text ({error})") from error


MOST_PARTS = 16
"""Largest number of parts of a dotted key. The parser's memory grows with its square, and a scene needs two."""
DEEPEST = 16
"""Largest depth of nested brackets. The parser's stack grows with it, and a scene needs three."""
_QUOTED_OR_COMMENT = re.compile(
    r'"""(?:[^\\"]|\\.|"(?!""))*+(?:"""|\\?\Z)'  # an unclosed string matches too, so that no text takes long
    r"|'''(?:[^']|'(?!''))*+(?:'''|\Z)"
    r'|"(?:[^"\\\n]|\\.)*+"?'
    r"|'[^'\n]*+'?"
    r"|#[^\n]*+",
    re.DOTALL,
)


def toml_data(text: str, where: str) -> dict:
    """The tables of a TOML text; `where` begins the error sentences. Raises InputError if it is not usable TOML."""
    bare = _QUOTED_OR_COMMENT.sub(lambda match: "" if match[0].startswith("#") else "q", text)
    if max(part.count(".") for part in re.split(r"[^\w. \t-]", bare)) >= MOST_PARTS:
        raise InputError(
            f"{where}: a dotted key of more than {MOST_PARTS} parts: write tables, which nest once in a scene"
        )
    brackets = (1 if bracket in "[{" else -1 for bracket in re.findall(r"[][{}]", bare))
    if max(accumulate(brackets), default=0) > DEEPEST:
        raise InputError(f"{where}: arrays or tables nested more than {DEEPEST} deep: write three, as scenes have")
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{where}: not valid TOML: {error}") from error
    except ValueError:  # Python limits an integer to a few thousand digits
        raise InputError(
            f"{where}: an integer of thousands of digits, which no quantity of a scene has: correct it"
        ) from None


def scene_toml(scene: Scene) -> str:
    """A scene as TOML text that `load_scene` reads back; values equal to the schema's defaults are left out."""
    return tomli_w.dumps(scene.model_dump(exclude_none=True, exclude_defaults=True))
