"""Sweeps: every task has exactly one row, whatever computes it, and a store of another sweep is not changed."""

import os
import signal
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
from tests.tasks.tasks_of_tests import DIED, DIES, opened, rehearsals, row_count, stored

KILLS = 3


@pytest.fixture(scope="module")
def serial(tmp_path_factory):
    """The rows of 200 rehearsal tasks, computed one after another in this process."""
    path = tmp_path_factory.mktemp("serial") / "x.sqlite"
    assert camopt.sweep(rehearsals(200), path, workers=0).counts == {"done": 200}
    return stored(path)


class Killer(threading.Thread):
    """Kills a random worker of this process whenever the store reaches one of the given numbers of rows."""

    def __init__(self, path, after: list[int]):
        super().__init__(daemon=True)
        self.path, self.after, self.killed = path, after, []

    def run(self):
        random = np.random.default_rng(0)
        for rows in self.after:
            while row_count(self.path) < rows:
                time.sleep(0.005)
            children = [child for child in active_children() if child.name.startswith("SpawnProcess")]
            victim = children[random.integers(len(children))]
            os.kill(victim.pid, signal.SIGKILL)
            self.killed.append(victim.pid)


class TestWorkers:
    def test_killed_workers_do_not_change_the_rows(self, tmp_path, serial):
        path, killer = tmp_path / "x.sqlite", Killer(tmp_path / "x.sqlite", [20, 80, 140])
        killer.start()
        swept = camopt.sweep(rehearsals(200, 0.0), path, workers=2)
        killer.join(20)
        assert len(killer.killed) == KILLS
        assert swept.counts == {"done": 200} and stored(path) == serial

    def test_a_task_that_always_dies_is_one_failed_row(self, tmp_path, serial):
        tasks = [*rehearsals(30), DIES, *list(rehearsals(200))[30:], DIES]
        swept = camopt.sweep(tasks, tmp_path / "x.sqlite", workers=2)
        assert swept.counts == {"done": 200, "failed": 1}
        (failed,) = swept.failed()
        assert (failed["task"], failed["reason"].startswith(f"{MOST_DEATHS} workers")) == (30, True)
        rows = stored(tmp_path / "x.sqlite")
        assert len({row[0] for row in rows}) == 201
        others = [(key, *rest) for key, number, *rest in rows if number != 30]
        assert others == [(key, *rest) for key, _, *rest in serial]
        assert [outcome for *_, outcome in rows if outcome == DIED] == [DIED]

    def test_workers_that_cannot_start_are_reported(self, tmp_path):
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
    """Starts a sweep in a new process, ends the process by a signal after 20 rows, waits until its workers have ended,
    and returns the number of rows."""
    script = folder / "parent.py"
    script.write_text(PARENT.replace("TASKS", tasks))
    env = os.environ | {"PYTHONPATH": os.pathsep.join([os.getcwd(), os.environ.get("PYTHONPATH", "")])}
    parent = subprocess.Popen([sys.executable, script, path], env=env, stderr=subprocess.PIPE, process_group=0)
    while row_count(path) < 20:
        assert parent.poll() is None
        time.sleep(0.01)
    parent.send_signal(how)
    parent.communicate(timeout=30)
    assert parent.returncode == -signal.SIGKILL if how == signal.SIGKILL else parent.returncode != 0
    for _ in range(200):  # until the workers notice that the parent has ended
        try:
            os.killpg(parent.pid, 0)
        except ProcessLookupError:
            return row_count(path)
        time.sleep(0.05)
    pytest.fail("worker processes outlive their parent")


class TestParent:
    @pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT])
    def test_the_store_of_a_parent_that_ended_can_be_continued(self, tmp_path, serial, how):
        path = tmp_path / "x.sqlite"
        assert 20 <= rows_after_the_end(tmp_path, path, "rehearsals(200, 0.01)", how) < 200
        camopt.sweep(rehearsals(200, 0.01), path, workers=0)
        tasks = rehearsals(200, 0.01)
        assert [row[0] for row in stored(path)] == sorted(stored_task(task, camopt.__version__).key for task in tasks)
        but_for_the_wait = [sorted((n, s, o) for _, n, _, s, o in rows) for rows in (stored(path), serial)]
        assert but_for_the_wait[0] == but_for_the_wait[1]

    def test_stored_rows_are_not_computed_again(self, tmp_path, monkeypatch):
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
        assert "there are 3 tasks" in self.refused(rehearsals(3), path)
        assert "there are 3 tasks" in self.refused(list(rehearsals(3)), path)
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

    def test_a_damaged_page(self, tmp_path):
        path = tmp_path / "x"
        camopt.sweep(rehearsals(200), path, workers=0)
        data = bytearray(path.read_bytes())
        data[20_000:24_000] = b"\x7f" * 4000  # after the pages that are read when the store is opened
        path.write_bytes(data)
        with pytest.raises(InputError, match="cannot be read or written any further"):
            camopt.sweep(rehearsals(200), path, workers=0).write_csv(tmp_path / "x.csv")
        assert not (tmp_path / "x.csv").exists()

    @pytest.mark.parametrize("column", ["task", "outcome"])
    def test_an_edited_row(self, tmp_path, column):
        path = tmp_path / "x"
        swept = camopt.sweep(rehearsals(3), path, workers=0)
        with opened(path) as db:
            db.execute(f"UPDATE row SET {column} = '[1' WHERE number = 1")
        with pytest.raises(InputError, match="row 1 of the sweep's store is damaged"):
            swept.columns()

    def test_a_store_without_a_version(self, tmp_path):
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


def test_a_closed_executor_and_a_worker_of_another_version_are_reported(tmp_path, monkeypatch):
    executor = ThreadPoolExecutor(1)
    executor.shutdown()
    with pytest.raises(InputError, match=r"the executor failed .*sweep again with the same store"):
        camopt.sweep(rehearsals(2), tmp_path / "x", executor)
    monkeypatch.setattr("camopt.tasks.compute._own_version", lambda: "9.9")
    with ThreadPoolExecutor(1) as executor, pytest.raises(InputError, match=r"a worker has camopt 9\.9, and the tasks"):
        camopt.sweep(rehearsals(2), tmp_path / "x", executor)


def test_a_task_that_raises_gives_a_failed_row_with_its_message(tmp_path):
    tasks = [{"verb": "rehearse", "number": 3, "end": "raise"}, {"verb": "rehearse", "number": 3}, DIES]
    swept = camopt.sweep(tasks, tmp_path / "x", workers=0)
    assert [row["state"] for row in swept.rows()] == ["failed", "done", "failed"]
    reasons = [row["reason"] for row in swept.failed()]
    assert reasons[0] == "rehearse: task 3 fails, as it was told to"
    assert "needs a worker process" in reasons[1]
    swept.write_csv(tmp_path / "x.csv")
    first, *lines = (tmp_path / "x.csv").read_text().splitlines()
    assert first == "task,state,verb,end,number,reason,fraction" and len(lines) == 3
    data = swept.dataset()
    assert data["fraction"].dims == ("task",) and np.isnan(data["fraction"][0]) and data["fraction"][1] > 0
    assert repr(swept).endswith("3 tasks: 1 done, 2 failed)") and swept._repr_html_() == "3 tasks: 1 done, 2 failed"


@pytest.mark.parametrize("workers", [-1, 2000])
def test_the_number_of_workers_is_limited(tmp_path, workers):
    with pytest.raises(InputError, match="expected a number from 0 to 1000"):
        camopt.sweep(rehearsals(1), tmp_path / "x", workers=workers)


def test_failed_rows_are_computed_again_on_request(tmp_path):
    needed = tmp_path / "needed"
    working = {"verb": "call", "function": "tests.tasks.tasks_of_tests:doubled", "arguments": {"number": 1}}
    failing = working | {"arguments": {"number": 2, "folder": str(needed)}}
    tasks = [working, failing, {"verb": "rehearse", "number": 7, "end": "raise"}, failing]
    path = tmp_path / "x"
    assert camopt.sweep(tasks, path, workers=0).counts == {"done": 1, "failed": 2}
    before = stored(path)
    needed.touch()
    assert camopt.sweep(tasks, path, workers=0).counts == {"done": 1, "failed": 2} and stored(path) == before
    swept = camopt.sweep(tasks, path, workers=0, retry_failed=True)
    assert swept.counts == {"done": 2, "failed": 1}
    after = stored(path)
    assert [row[:3] for row in after] == [row[:3] for row in before]
    assert sum(was != now for was, now in zip(before, after, strict=True)) == 1
