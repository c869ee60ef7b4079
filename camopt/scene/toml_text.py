"""TOML texts: those from anywhere as data, and a scene as a text.

What would cost the parser its stack or the machine its memory is refused before it is parsed.
"""

import re
import tomllib
from itertools import accumulate

import tomli_w

from camopt.scene.errors import InputError
from camopt.scene.schema import Scene

MOST_PARTS = 16
"""Parts of a dotted key: the parser's memory grows with their square, and a scene needs two."""
DEEPEST = 16
"""Brackets within brackets: the parser's stack grows with them, and a scene needs three."""
_QUOTED_OR_COMMENT = re.compile(
    r'"""(?:[^\\"]|\\.|"(?!""))*+(?:"""|\\?\Z)'  # what is not closed counts too, so that no text takes long
    r"|'''(?:[^']|'(?!''))*+(?:'''|\Z)"
    r'|"(?:[^"\\\n]|\\.)*+"?'
    r"|'[^'\n]*+'?"
    r"|#[^\n]*+",
    re.DOTALL,
)


def toml_data(text: str, where: str) -> dict:
    """The tables of a TOML text; `where` begins the sentences. Raises InputError for whatever is no usable TOML."""
    bare = _QUOTED_OR_COMMENT.sub(lambda found: "" if found[0].startswith("#") else "q", text)
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
    except ValueError:  # Python turns no more than some thousand digits into an integer
        raise InputError(
            f"{where}: an integer of thousands of digits, which no quantity of a scene has: correct it"
        ) from None


def scene_toml(scene: Scene) -> str:
    """A scene as TOML text, which `load_scene` reads back; values that are the schema's defaults are left out."""
    return tomli_w.dumps(scene.model_dump(exclude_none=True, exclude_defaults=True))
