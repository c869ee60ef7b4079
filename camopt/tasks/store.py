"""The store of a sweep: an SQLite file with one row per task, written by the parent process alone.

A row is written completely or not at all, survives the end of the process, and never changes, except that a failed task
may be computed again. Long texts that tasks share, such as scenes and cams, are stored once.
"""

import sqlite3
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from camopt.scene.errors import InputError
from camopt.scene.text_file import usable_path
from camopt.storage import check_file
from camopt.tasks.compute import FAILED, Outcome
from camopt.tasks.task import StoredTask

HEADER = b"SQLite format 3\0"
MARK = 0x63616D6F
"""`application_id` of the file: "camo"."""
TABLES = (
    "CREATE TABLE about (name TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID",
    "CREATE TABLE part (name TEXT PRIMARY KEY, text TEXT NOT NULL) WITHOUT ROWID",
    "CREATE TABLE row (number INTEGER PRIMARY KEY, key TEXT NOT NULL UNIQUE, task TEXT NOT NULL, "
    "state TEXT NOT NULL, outcome TEXT NOT NULL)",
)


class TaskStore:
    """An open store; `with TaskStore(path, version, plan) as store`. With `retry_failed`, failed rows count as missing.

    A missing file is created. Raises InputError, leaving the file unchanged, for a file that is not the store of a
    sweep, that another version of camopt created, or that belongs to another plan (where both have a digest).
    """

    def __init__(self, path: str | Path, version: str, plan: str = "", *, retry_failed: bool = False):
        self.path = usable_path(path, "store")
        check_file(self.path)
        try:
            _check_header(self.path)
            self._db = sqlite3.connect(self.path, timeout=30.0, isolation_level=None)
            try:
                self._begin(version, plan)
                query = "SELECT key FROM row WHERE state = ?"
                self._to_repeat = {key for (key,) in self._db.execute(query, (FAILED,))} if retry_failed else set()
            except BaseException:
                self._db.close()
                raise
        except (sqlite3.Error, OSError) as error:
            raise InputError(f"{self.path}: cannot be used as the store of a sweep ({error}); name another") from error

    def __enter__(self) -> "TaskStore":
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        """Closes the file. Raises InputError where SQLite failed: the file is damaged, or the disk is full."""
        self._db.close()
        if isinstance(error, sqlite3.Error):
            raise InputError(
                f"{self.path}: cannot be read or written any further ({error}): make room on its disk and go on with "
                f"--resume, or, where the file is damaged, name another store"
            ) from error

    def _begin(self, version: str, plan: str) -> None:
        """Creates the tables of a new file, or checks those of an existing one."""
        if self._db.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]:
            self._check(version, plan)
        else:
            self._db.execute("PRAGMA journal_mode = WAL")
            with self._transaction():
                for table in TABLES:
                    self._db.execute(table)
                self._db.execute(f"PRAGMA application_id = {MARK}")
                rows = (("version", version), ("plan", plan))
                self._db.executemany("INSERT INTO about VALUES (?, ?)", rows)
        self._db.execute("PRAGMA synchronous = NORMAL")  # a row survives the death of any process

    def _check(self, version: str, plan: str) -> None:
        if self._db.execute("PRAGMA application_id").fetchone()[0] != MARK:
            raise InputError(f"{self.path}: a database, but not the store of a sweep; name another")
        about = dict(self._db.execute("SELECT name, value FROM about"))
        if about.get("version") != version:
            began = about.get("version", "unknown")
            raise InputError(
                f"{self.path}: its rows are of camopt {began}, and this is camopt {version}, whose numbers "
                f"may differ; nothing in it was changed: name another store"
            )
        if plan and about.get("plan") not in (None, "", plan):
            raise InputError(
                f"{self.path}: belongs to another plan, and nothing in it was changed: name another store for this one"
            )

    def _transaction(self):
        """Begins a transaction, which takes effect completely or not at all."""
        self._db.execute("BEGIN IMMEDIATE")
        return self._db

    def holds(self, number: int, key: str) -> bool:
        """Whether the store has a task's row. Raises InputError where its number belongs to a task of another plan."""
        rows = self._db.execute("SELECT number, key FROM row WHERE key = ? OR number = ?", (key, number)).fetchall()
        if any(n == number and k != key for n, k in rows):
            raise InputError(
                f"{self.path}: belongs to other tasks: its row {number} is not task {number} of this plan; nothing in "
                f"it was changed: name another store"
            )
        if key in self._to_repeat:
            self._to_repeat.discard(key)
            return False
        return bool(rows)

    def record(self, finished: Iterable[tuple[int, StoredTask, Outcome]]) -> None:
        """Writes the rows of finished tasks, and the texts that they refer to, in one transaction. An existing row
        stays, except that a failed one takes the new outcome."""
        finished = list(finished)
        with self._transaction() as db:
            parts = {name: text for _, task, _ in finished for name, text in task.parts.items()}
            db.executemany("INSERT OR IGNORE INTO part VALUES (?, ?)", parts.items())
            rows = ((number, task.key, task.text, *outcome) for number, task, outcome in finished)
            db.executemany(
                "INSERT INTO row VALUES (?, ?, ?, ?, ?) ON CONFLICT DO UPDATE "
                f"SET state = excluded.state, outcome = excluded.outcome WHERE row.state = '{FAILED}'",
                rows,
            )

    def read(self, query: str, *values: Any) -> sqlite3.Cursor:
        """Runs a query; table `row` has number, key, task, state and outcome, table `part` has name and text."""
        return self._db.execute(query, values)

    def check_count(self, tasks: int) -> None:
        """Raises InputError where the store has the row of a task whose number is `tasks` or more."""
        last = self._db.execute("SELECT coalesce(max(number), -1) FROM row").fetchone()[0]
        if last >= tasks:
            raise InputError(
                f"{self.path}: has a row for task {last}, but there are {tasks} tasks: it belongs to another sweep; "
                f"name another store"
            )


def _check_header(path: Path) -> None:
    """Raises sqlite3.DatabaseError for a file neither empty nor a database; SQLite would treat a short one as new."""
    if path.exists():
        with open(path, "rb") as file:
            if file.read(len(HEADER)) not in (b"", HEADER):
                raise sqlite3.DatabaseError("file is not a database")
