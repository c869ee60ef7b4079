"""Numbers of stored results by an expression, so that no page holds a number of its own.

In a page, `{number}` and then in backquotes `optimiser.rows['kodama, band'].area_ratio | .4f` is a number of
`experiments/results/optimiser.json` in a format of Python's. Names are files; attributes are keys (an index in brackets
where a key is no name); a list takes a number, or texts, which name the one row that holds all of them. Expressions may
use arithmetic, `min`, `max`, `len`, `sum`, `abs` and comprehensions.
"""

import json
import re
from functools import cache
from pathlib import Path
from typing import Any

RESULTS = Path(__file__).parents[2] / "experiments" / "results"
ROLE = re.compile(r"\{number\}`([^`]+)`")
FUNCTIONS = {f.__name__: f for f in (min, max, len, set, sum, abs, sorted, zip)}


class Keys:
    """A JSON object by attribute or index."""

    def __init__(self, content: dict):
        self._content = content

    def __getattr__(self, key: str):
        return self[key]

    def __getitem__(self, key: str):
        return wrapped(self._content[key])

    def __iter__(self):
        return iter(self._content)

    def __len__(self):
        return len(self._content)

    def get(self, key: str, otherwise=None):
        """What stands under a key, or something else where nothing does."""
        return wrapped(self._content.get(key, otherwise))

    def values(self):
        """The values, which may be numbers, rows or objects again."""
        return [wrapped(value) for value in self._content.values()]


class Rows:
    """A JSON list by number, or by texts that exactly one of its rows holds."""

    def __init__(self, content: list):
        self._content = content

    def __getitem__(self, which):
        if isinstance(which, int | slice):
            return wrapped(self._content[which])
        texts = which if isinstance(which, tuple) else (which,)
        (row,) = [row for row in self._content if all(text in row.values() for text in texts)]
        return wrapped(row)

    def __iter__(self):
        return (wrapped(row) for row in self._content)

    def __len__(self):
        return len(self._content)


def wrapped(value: Any) -> Any:
    """A JSON value as an expression sees it."""
    return Keys(value) if isinstance(value, dict) else Rows(value) if isinstance(value, list) else value


@cache
def stored(path: Path) -> Any:
    """The content of a results file, read once."""
    return json.loads(path.read_text(encoding="utf-8"))


class Names(dict):
    """Results by the name of their file in a folder, as the names of an expression."""

    def __init__(self, folder: Path, known: dict):
        super().__init__()
        self._folder, self._known = folder, known

    def __missing__(self, name: str):
        if name in self._known:  # what is missing here is looked up among the globals next
            raise KeyError(name)
        return wrapped(stored(self._folder / f"{name}.json"))


def number(text: str, folder: Path = RESULTS) -> str:
    """What `expression | format` gives by the results in a folder; raises for what is not there."""
    expression, _, form = text.rpartition("|")
    known = {"__builtins__": {}, **FUNCTIONS}
    return shown(eval(expression.strip(), known, Names(folder, known)), form.strip())


def shown(value: Any, form: str) -> str:
    """A value in a format of Python's: a list with commas, minus signs as signs, 1e-09 as 1e−9, 5e+01 as 50.

    None is a dash.
    """
    if isinstance(value, Rows):
        return ", ".join(shown(one, form) for one in value)
    if value is None or isinstance(value, str):
        return value or "–"
    text = format(value, form)
    if re.search(r"e\+0[1-5]$", text):
        text = f"{float(text):.0f}"
    return re.sub(r"e(−?)\+?0*", r"e\1", text.replace("-", "−"))


def filled_numbers(text: str, folder: Path = RESULTS) -> str:
    """A text with the number of every role in it; a per cent sign does not begin a line, where it begins a comment."""
    return re.sub(r"\n *%", " %", ROLE.sub(lambda role: number(role[1], folder), text))
