"""Tables of stored results as Markdown."""

import tomllib
from collections.abc import Iterable
from importlib import import_module

from docs.generators.results import FUNCTIONS, RESULTS, Names, shown, stored, wrapped


def result_table(content: str) -> str:
    """The table that an experiment makes from its stored cams; the block's content is the name of the result."""
    name = content.strip()
    return "\n".join(import_module(f"experiments.{name}").markdown(stored(RESULTS / f"{name}.json")["cams"]))


def rows_table(content: str) -> str:
    """A table with a row for each row of a stored list or object.

    The block's content is TOML: `of` is the file's name, `at` the keys that lead to the list or object, `where` a
    condition that selects rows, and `columns` a list of [heading, expression | format]. In every expression `row` is
    the row, and `key` its key or number.
    """
    asked = tomllib.loads(content)
    found = stored(RESULTS / f"{asked['of']}.json")
    for key in asked.get("at", []):
        found = found[key]
    pairs = found.items() if isinstance(found, dict) else enumerate(found)
    kept = [(key, row) for key, row in pairs if key != "provenance" and _value(asked.get("where", "True"), key, row)]
    rows = [[_cell(cell, key, row) for _, cell in asked["columns"]] for key, row in kept]
    return markdown([heading for heading, _ in asked["columns"]], rows)


def markdown(headings: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """A table in Markdown."""
    headings = list(headings)
    lines = [headings, ["---"] * len(headings), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def _cell(cell: str, key: object, row: object) -> str:
    expression, _, form = cell.rpartition("|")
    return shown(_value(expression, key, row), form.strip()).replace("|", "\\|")


def _value(expression: str, key: object, row: object) -> object:
    known = {"__builtins__": {}, **FUNCTIONS, "row": wrapped(row), "key": key}
    return eval(expression.strip(), known, Names(RESULTS, known))


def origin(content: str) -> str:
    """A sentence with date, machine, versions and command of a stored result, which the block's content names."""
    found = provenance(content.strip())
    versions = ", ".join(f"{name} {number}" for name, number in found["versions"].items())
    return f"*Measured on {found['date_utc']} ({found['machine']}; {versions}) by* `{found['command']}`.\n"


def provenance(name: str) -> dict:
    """Command, versions, machine and date of a stored result."""
    return stored(RESULTS / f"{name}.json")["provenance"]
