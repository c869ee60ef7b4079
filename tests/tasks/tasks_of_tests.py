"""Tasks and the reading of stores that the tests of sweeps share."""

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path


def rehearsals(count: int, seconds: float = 0.0) -> Iterator[dict]:
    """So many stand-ins."""
    return ({"verb": "rehearse", "number": i, "seconds": seconds} for i in range(count))


@contextmanager
def opened(path: Path) -> Iterator[sqlite3.Connection]:
    """A database, closed at the end; what was changed is kept. A connection is no more than a transaction itself."""
    with closing(sqlite3.connect(path)) as db, db:
        yield db


def stored(path: Path) -> list[tuple]:
    """The rows of a store as its bytes are, by key."""
    with opened(path) as db:
        return db.execute("SELECT key, number, task, state, outcome FROM row ORDER BY key").fetchall()


def doubled(number: float, folder: str = "") -> dict:
    """A function for the verb "call"; with `folder` it fails as long as that is not there."""
    if folder and not Path(folder).exists():
        raise FileNotFoundError(f"{folder} is not there")
    return {"twice": 2 * number}
