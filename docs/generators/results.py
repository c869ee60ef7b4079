"""Numbers of stored results, given by expressions, so that no measured number is typed into a page.

In a page, `{number}` and then in backquotes `optimiser.rows['kodama, band'].area_ratio | .4f` is a number of
`experiments/results/optimiser.json` in a Python format. Names are files; attributes are keys (a key that is not an
identifier is written in brackets); a list is indexed by a number, or by texts, which select the only row with all of
them as values. Expressions may use arithmetic, `min`, `max`, `len`, `sum`, `abs` and comprehensions.
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
    """A JSON object whose keys are read as attributes or by index."""

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
        """The value of a key, or `otherwise` if the key is missing."""
        return wrapped(self._content.get(key, otherwise))

    def values(self):
        """The values, which may be numbers, rows or objects again."""
        return [wrapped(value) for value in self._content.values()]


class Rows:
    """A JSON list, indexed by number, or by texts that exactly one of its rows has as values."""

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
    """A JSON value in the form that expressions use."""
    return Keys(value) if isinstance(value, dict) else Rows(value) if isinstance(value, list) else value


@cache
def stored(path: Path) -> Any:
    """The content of a results file, read once."""
    return json.loads(path.read_text(encoding="utf-8"))


class Names(dict):
    """The names of an expression: results by the name of their file in a folder."""

    def __init__(self, folder: Path, known: dict):
        super().__init__()
        self._folder, self._known = folder, known

    def __missing__(self, name: str):
        if name in self._known:  # Python then looks the name up among the globals
            raise KeyError(name)
        return wrapped(stored(self._folder / f"{name}.json"))


def number(text: str, folder: Path = RESULTS) -> str:
    """The formatted value of `expression | format` for the results in a folder; raises if a name or key is missing."""
    expression, _, form = text.rpartition("|")
    functions = {"__builtins__": {}, **FUNCTIONS}
    return shown(eval(expression.strip(), functions, Names(folder, functions)), form.strip())


def shown(value: Any, form: str) -> str:
    """A value in a Python format: lists separated by commas, typographic minus signs, 1e-09 as 1e−9, 5e+01 as 50.

    None is shown as a dash.
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
    """A text with all numbers filled in; no line begins with a per cent sign, which would begin a comment there."""
    return re.sub(r"\n *%", " %", ROLE.sub(lambda role: number(role[1], folder), text))
