"""Sweeps: every task has its row, once, whatever computes it, and a store that belongs elsewhere is left alone."""

import os
import signal
import sqlite3
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from multiprocessing import active_children

import numpy as np
import pytest

import camopt
from camopt.scene import InputError
from camopt.tasks import sweep as sweeping
from camopt.tasks.engines import MOST_DEATHS
from camopt.tasks.task import stored_task
from tests.campaign.starved import mounted
from tests.tasks.tasks_of_tests import opened, rehearsals, stored

DIES = {"verb": "rehearse", "number": 10**6, "end": "die"}
DIED = '{"reason": "3 workers that computed it died (killed by a signal, or out of memory)"}'
KILLS = 3


@pytest.fixture(scope="module")
def serial(tmp_path_factory):
    """The rows of 200 stand-ins computed one by one in this process."""
    path = tmp_path_factory.mktemp("serial") / "x.sqlite"
    assert camopt.sweep(rehearsals(200), path, workers=0).counts == {"done": 200}
    return stored(path)


class Killer(threading.Thread):
    """Kills a random worker process of this one each time that so many more rows stand in the store."""

    def __init__(self, path, after: list[int]):
        super().__init__(daemon=True)
        self.path, self.after, self.killed = path, after, []

    def run(self):
        random = np.random.default_rng(0)
        for rows in self.after:
            while not (self.path.exists() and self.count() >= rows):
                time.sleep(0.005)
            children = [child for child in active_children() if child.name.startswith("SpawnProcess")]
            victim = children[random.integers(len(children))]
            os.kill(victim.pid, signal.SIGKILL)
            self.killed.append(victim.pid)

    def count(self) -> int:
        try:
            with opened(self.path) as db:
                return db.execute("SELECT count(*) FROM row").fetchone()[0]
        except sqlite3.OperationalError:  # the parent is about to make the tables
            return 0


class TestWorkers:
    def test_random_workers_that_are_killed_leave_no_trace(self, tmp_path, serial):
        path, killer = tmp_path / "x.sqlite", Killer(tmp_path / "x.sqlite", [20, 80, 140])
        killer.start()
        found = camopt.sweep(rehearsals(200, 0.0), path, workers=2)
        killer.join(20)
        assert len(killer.killed) == KILLS
        assert found.counts == {"done": 200} and stored(path) == serial

    def test_a_task_that_always_dies_is_one_failed_row(self, tmp_path, serial):
        tasks = [*rehearsals(30), DIES, *list(rehearsals(200))[30:], DIES]
        found = camopt.sweep(tasks, tmp_path / "x.sqlite", workers=2)
        assert found.counts == {"done": 200, "failed": 1}
        (failed,) = found.failed()
        assert (failed["task"], failed["reason"].startswith(f"{MOST_DEATHS} workers")) == (30, True)
        rows = stored(tmp_path / "x.sqlite")
        assert len({row[0] for row in rows}) == 201
        others = [(key, *rest) for key, number, *rest in rows if number != 30]
        assert others == [(key, *rest) for key, _, *rest in serial]
        assert [outcome for *_, outcome in rows if outcome == DIED] == [DIED]

    def test_workers_that_cannot_begin_are_said(self, tmp_path):
        code = f"import camopt; camopt.sweep([{{'verb': 'rehearse', 'number': 1}}], {str(tmp_path / 'x')!r}, workers=1)"
        (tmp_path / "script.py").write_text(code)
        done = subprocess.run([sys.executable, tmp_path / "script.py"], capture_output=True, text=True, timeout=240)
        assert done.returncode == 1
        assert done.stderr.rstrip().splitlines()[-1].startswith("camopt.scene.errors.InputError: sweep: worker proc")
        assert '`if __name__ == "__main__":`' in done.stderr
        assert "bootstrapping" not in done.stderr, "workers that read the script say nothing of their own"


PARENT = """
import sys, camopt
from tests.tasks.tasks_of_tests import rehearsals
if __name__ == "__main__":
    camopt.sweep(TASKS, sys.argv[1], workers=2)
"""


def rows_after_the_end(folder, path, tasks: str, how) -> int:
    """Begins a sweep in a process of its own, ends that by a signal after 20 rows, and waits until its workers are gone
    too; how many rows it leaves."""
    script = folder / "parent.py"
    script.write_text(PARENT.replace("TASKS", tasks))
    env = os.environ | {"PYTHONPATH": os.pathsep.join([os.getcwd(), os.environ.get("PYTHONPATH", "")])}
    parent = subprocess.Popen([sys.executable, script, path], env=env, stderr=subprocess.PIPE, process_group=0)
    reader = Killer(path, [])
    while reader.count() < 20 if path.exists() else True:
        assert parent.poll() is None
        time.sleep(0.01)
    parent.send_signal(how)
    parent.communicate(timeout=30)
    assert parent.returncode == -signal.SIGKILL if how == signal.SIGKILL else parent.returncode != 0
    for _ in range(200):  # the orphans see that the parent is gone
        try:
            os.killpg(parent.pid, 0)
        except ProcessLookupError:
            return reader.count()
        time.sleep(0.05)
    pytest.fail("worker processes outlive their parent")


class TestParent:
    @pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT])
    def test_a_parent_that_ends_leaves_a_store_that_goes_on(self, tmp_path, serial, how):
        path = tmp_path / "x.sqlite"
        assert 20 <= rows_after_the_end(tmp_path, path, "rehearsals(200, 0.01)", how) < 200
        camopt.sweep(rehearsals(200, 0.01), path, workers=0)
        tasks = rehearsals(200, 0.01)
        assert [row[0] for row in stored(path)] == sorted(stored_task(task, camopt.__version__).key for task in tasks)
        but_for_the_wait = [sorted((n, s, o) for _, n, _, s, o in rows) for rows in (stored(path), serial)]
        assert but_for_the_wait[0] == but_for_the_wait[1]

    def test_rows_that_are_there_are_not_computed_again(self, tmp_path, monkeypatch):
        camopt.sweep(rehearsals(5), tmp_path / "x", workers=0)
        before = stored(tmp_path / "x")
        monkeypatch.setattr("camopt.tasks.sweep.compute", lambda task: pytest.fail("computed again"))
        assert camopt.sweep(rehearsals(5), tmp_path / "x", workers=0).counts == {"done": 5}
        assert stored(tmp_path / "x") == before


class TestStores:
    def refused(self, tasks, path) -> str:
        before = stored(path) if path.exists() else None
        with pytest.raises(InputError) as refused:
            camopt.sweep(tasks, path, workers=0)
        assert not path.with_name(f"{path.name}-wal").exists()  # SQLite removes it when the last connection is closed
        assert before is None or stored(path) == before
        return str(refused.value)

    def test_other_tasks(self, tmp_path):
        path = tmp_path / "x"
        camopt.sweep(rehearsals(5), path, workers=0)
        assert "its row 0 is not task 0 of this plan" in self.refused(rehearsals(5, 0.01), path)
        assert "these are 3 tasks" in self.refused(rehearsals(3), path)
        assert "these are 3 tasks" in self.refused(list(rehearsals(3)), path)
        assert camopt.sweep(rehearsals(7), path, workers=0).counts == {"done": 7}

    def test_another_version(self, tmp_path, monkeypatch):
        path = tmp_path / "x"
        camopt.sweep(rehearsals(2), path, workers=0)
        monkeypatch.setattr(sweeping, "version", lambda name: "9.9")
        words = self.refused(rehearsals(2), path)
        assert (
            f"of camopt {camopt.__version__}, and this is camopt 9.9" in words and "nothing in it was changed" in words
        )

    @pytest.mark.parametrize("content", [b"no database at all, " * 99, b"x"])
    def test_another_file(self, tmp_path, content):
        (tmp_path / "x").write_bytes(content)
        with pytest.raises(InputError, match="cannot be used as the store of a sweep"):
            camopt.sweep(rehearsals(2), tmp_path / "x", workers=0)
        assert (tmp_path / "x").read_bytes() == content

    def test_another_database(self, tmp_path):
        with opened(tmp_path / "x") as db:
            db.execute("CREATE TABLE row (key, number, task, state, outcome)")
        assert "a database, but not the store of a sweep" in self.refused(rehearsals(2), tmp_path / "x")

    def test_a_torn_page(self, tmp_path):
        path = tmp_path / "x"
        camopt.sweep(rehearsals(200), path, workers=0)
        data = bytearray(path.read_bytes())
        data[20_000:24_000] = b"\x7f" * 4000  # behind the pages that opening it reads
        path.write_bytes(data)
        with pytest.raises(InputError, match="cannot be read or written any further"):
            camopt.sweep(rehearsals(200), path, workers=0).write_csv(tmp_path / "x.csv")
        assert not (tmp_path / "x.csv").exists()

    @pytest.mark.parametrize("column", ["task", "outcome"])
    def test_an_edited_row(self, tmp_path, column):
        path = tmp_path / "x"
        found = camopt.sweep(rehearsals(3), path, workers=0)
        with opened(path) as db:
            db.execute(f"UPDATE row SET {column} = '[1' WHERE number = 1")
        with pytest.raises(InputError, match="row 1 of the sweep's store is damaged"):
            found.columns()

    def test_a_store_that_says_no_version(self, tmp_path):
        camopt.sweep(rehearsals(3), tmp_path / "x", workers=0)
        with opened(tmp_path / "x") as db:
            db.execute("DELETE FROM about")
        assert "of camopt unknown" in self.refused(rehearsals(3), tmp_path / "x")

    def test_a_disk_that_fills_up(self, tmp_path):
        with mounted(tmp_path / "disk", "size=100k") as folder:
            with pytest.raises(InputError, match="make room on its disk"):
                camopt.sweep(rehearsals(1000), folder / "x", workers=0)
            assert len(stored(folder / "x")) > 0

    def test_no_folder(self, tmp_path):
        assert "cannot be written" in self.refused(rehearsals(2), tmp_path / "none" / "x")


def test_any_executor_with_at_most_four_tasks_for_each_worker(tmp_path, serial):
    flying, most = set(), []
    taken = iter(list(rehearsals(200)))

    def watched():
        for task in taken:
            most.append(len(flying))
            yield task

    class Executor(ThreadPoolExecutor):
        def submit(self, function, /, *args, **kwargs):
            future = super().submit(function, *args, **kwargs)
            flying.add(future)
            future.add_done_callback(flying.discard)
            return future

    with Executor(2) as executor:
        camopt.sweep(watched(), tmp_path / "x", executor)
    assert stored(tmp_path / "x") == serial
    assert max(most) <= 2 * sweeping.AHEAD


def test_an_executor_that_is_gone_and_a_worker_of_another_version_are_said(tmp_path, monkeypatch):
    executor = ThreadPoolExecutor(1)
    executor.shutdown()
    with pytest.raises(InputError, match=r"the executor does not go on .*sweep again with the same store"):
        camopt.sweep(rehearsals(2), tmp_path / "x", executor)
    monkeypatch.setattr("camopt.tasks.compute._own_version", lambda: "9.9")
    with ThreadPoolExecutor(1) as executor, pytest.raises(InputError, match=r"a worker has camopt 9\.9, and the tasks"):
        camopt.sweep(rehearsals(2), tmp_path / "x", executor)


def test_a_task_that_raises_is_a_failed_row_with_its_sentence(tmp_path):
    tasks = [{"verb": "rehearse", "number": 3, "end": "raise"}, {"verb": "rehearse", "number": 3}, DIES]
    found = camopt.sweep(tasks, tmp_path / "x", workers=0)
    assert [row["state"] for row in found.rows()] == ["failed", "done", "failed"]
    reasons = [row["reason"] for row in found.failed()]
    assert reasons[0] == "rehearse: task 3 fails, as it was told to"
    assert "worker process only" in reasons[1]
    found.write_csv(tmp_path / "x.csv")
    first, *lines = (tmp_path / "x.csv").read_text().splitlines()
    assert first == "task,state,verb,end,number,reason,fraction" and len(lines) == 3
    data = found.dataset()
    assert data["fraction"].dims == ("task",) and np.isnan(data["fraction"][0]) and data["fraction"][1] > 0
    assert repr(found).endswith("3 tasks: 1 done, 2 failed)") and found._repr_html_() == "3 tasks: 1 done, 2 failed"


@pytest.mark.parametrize("workers", [-1, 2000])
def test_workers_are_counted(tmp_path, workers):
    with pytest.raises(InputError, match="expected a number from 0 to 1000"):
        camopt.sweep(rehearsals(1), tmp_path / "x", workers=workers)


def test_failed_rows_are_computed_once_more_where_that_is_asked_for(tmp_path):
    needed = tmp_path / "needed"
    one = {"verb": "call", "function": "tests.tasks.tasks_of_tests:doubled", "arguments": {"number": 1}}
    failing = one | {"arguments": {"number": 2, "folder": str(needed)}}
    tasks = [one, failing, {"verb": "rehearse", "number": 7, "end": "raise"}, failing]
    path = tmp_path / "x"
    assert camopt.sweep(tasks, path, workers=0).counts == {"done": 1, "failed": 2}
    before = stored(path)
    needed.touch()
    assert camopt.sweep(tasks, path, workers=0).counts == {"done": 1, "failed": 2} and stored(path) == before
    found = camopt.sweep(tasks, path, workers=0, retry_failed=True)
    assert found.counts == {"done": 2, "failed": 1}
    after = stored(path)
    assert [row[:3] for row in after] == [row[:3] for row in before]
    assert sum(was != now for was, now in zip(before, after, strict=True)) == 1
