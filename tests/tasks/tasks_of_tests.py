"""Tasks and functions to read stores, shared by the tests of sweeps."""

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

DIES = {"verb": "rehearse", "number": 10**6, "end": "die"}
"""A task that kills its worker, and below the outcome of its row."""
DIED = '{"reason": "3 workers that computed it died (killed by a signal, or out of memory)"}'


def rehearsals(count: int, seconds: float = 0.0) -> Iterator[dict]:
    """`count` rehearsal tasks, each of which waits for `seconds`."""
    return ({"verb": "rehearse", "number": i, "seconds": seconds} for i in range(count))


@contextmanager
def opened(path: Path) -> Iterator[sqlite3.Connection]:
    """A database connection that commits and closes at the end; sqlite3's own context manager only commits."""
    with closing(sqlite3.connect(path)) as db, db:
        yield db


def stored(path: Path) -> list[tuple]:
    """The raw rows of a store, sorted by key."""
    with opened(path) as db:
        return db.execute("SELECT key, number, task, state, outcome FROM row ORDER BY key").fetchall()


def row_count(path: Path) -> int:
    """The number of rows in the store of a sweep, 0 before it has tables."""
    if not path.exists():
        return 0
    try:
        with opened(path) as db:
            return db.execute("SELECT count(*) FROM row").fetchone()[0]
    except sqlite3.OperationalError:  # the parent has not yet created the tables
        return 0


def doubled(number: float, folder: str = "") -> dict:
    """A function for the verb "call"; it fails if `folder` is given and does not exist."""
    if folder and not Path(folder).exists():
        raise FileNotFoundError(f"{folder} is not there")
    return {"twice": 2 * number}
