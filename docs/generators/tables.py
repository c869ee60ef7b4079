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
    spec = tomllib.loads(content)
    records = stored(RESULTS / f"{spec['of']}.json")
    for key in spec.get("at", []):
        records = records[key]
    pairs = records.items() if isinstance(records, dict) else enumerate(records)
    chosen = [(key, row) for key, row in pairs if key != "provenance" and _value(spec.get("where", "True"), key, row)]
    rows = [[_cell(cell, key, row) for _, cell in spec["columns"]] for key, row in chosen]
    return markdown([heading for heading, _ in spec["columns"]], rows)


def markdown(headings: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """A table in Markdown."""
    headings = list(headings)
    lines = [headings, ["---"] * len(headings), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def _cell(cell: str, key: object, row: object) -> str:
    expression, _, form = cell.rpartition("|")
    return shown(_value(expression, key, row), form.strip()).replace("|", "\\|")


def _value(expression: str, key: object, row: object) -> object:
    names = {"__builtins__": {}, **FUNCTIONS, "row": wrapped(row), "key": key}
    return eval(expression.strip(), names, Names(RESULTS, names))


def origin(content: str) -> str:
    """A sentence with date, machine, versions and command of a stored result, which the block's content names."""
    source = provenance(content.strip())
    versions = ", ".join(f"{name} {number}" for name, number in source["versions"].items())
    return f"*Measured on {source['date_utc']} ({source['machine']}; {versions}) by* `{source['command']}`.\n"


def provenance(name: str) -> dict:
    """Command, versions, machine and date of a stored result."""
    return stored(RESULTS / f"{name}.json")["provenance"]
