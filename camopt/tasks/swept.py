"""What a sweep found: the rows of its store, as dictionaries, as a labelled dataset or as a table."""

import json
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

import xarray as xr

from camopt.storage import write_csv_rows
from camopt.tasks.compute import FAILED
from camopt.tasks.store import TaskStore
from camopt.tasks.task import PART

FIRST = ("task", "state", "verb", "scene", "cam")
"""Columns that stand first."""


class SweptTasks:
    """The rows of a store, read anew whenever they are asked for, one at a time; in the order of the plan."""

    def __init__(self, store: Path):
        self.store = Path(store)

    def _open(self) -> TaskStore:
        return TaskStore(self.store, version("camopt"))

    def rows(self) -> Iterator[dict[str, Any]]:
        """A dictionary a row: `task`, its number in the plan, `state`, the task's own keys, and what it returned.

        A failed task has its `reason` instead. A scene or cam that is no name is its digest; `part` gives the text.
        """
        with self._open() as store:
            for row in store.rows():
                yield row.as_dict()

    def part(self, name: str) -> str:
        """The text of a scene or a cam that rows name by its digest."""
        with self._open() as store:
            return store.part(name)

    @property
    def counts(self) -> dict[str, int]:
        """How many rows ended in which state ("done", "failed")."""
        with self._open() as store:
            return store.counts()

    def failed(self) -> list[dict[str, Any]]:
        """The rows of tasks that failed, with their reasons."""
        return [row for row in self.rows() if row["state"] == FAILED]

    def columns(self) -> list[str]:
        """The names that occur in the rows, those of the task first."""
        names = dict.fromkeys(name for row in self.rows() for name in row)
        return [name for name in FIRST if name in names] + [name for name in names if name not in FIRST]

    def dataset(self) -> xr.Dataset:
        """The rows along the dimension `task`; a number that a row does not have is NaN, a text empty."""
        rows, names = list(self.rows()), self.columns()
        return xr.Dataset({name: ("task", _column([row.get(name) for row in rows])) for name in names})

    def write_csv(self, path: str | Path) -> None:
        """Writes the rows as a table; a value that a row does not have is an empty cell, lists are JSON."""
        names = self.columns()
        cells = ([_cell(row.get(name)) for name in names] for row in self.rows())
        write_csv_rows(path, names, cells)

    def lines(self) -> list[str]:
        """What was found, in sentences."""
        counts = self.counts
        said = ", ".join(f"{count} {state}" for state, count in counts.items()) or "none"
        return [f"{sum(counts.values())} tasks: {said}"]

    def __repr__(self) -> str:
        return f"SweptTasks({self.store}, {'; '.join(self.lines())})"

    def _repr_html_(self) -> str:
        return "<br>".join(self.lines())


def _column(values: list) -> list:
    if all(isinstance(v, int | float) or v is None for v in values):
        return [float("nan") if v is None else v for v in values]
    return [_cell(v) if v is not None else "" for v in values]


def _cell(value: Any) -> Any:
    """A value as it stands in a cell: lists as JSON, the digest of a long text short."""
    if isinstance(value, list | dict):
        return json.dumps(value)
    if isinstance(value, str) and value.startswith(PART):
        return value[: len(PART) + 12]
    return value
