"""A dask cluster as executor computes the rows of the serial sweep even if workers are killed (skipped without dask).
Also tested: function and script of the experiment in docs/how-to/cluster.md."""

import logging
import os
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

import camopt
from camopt.scene import InputError
from camopt.tasks.engines import check_address, cluster
from tests.tasks.tasks_of_tests import DIED, DIES, rehearsals, row_count, stored

pytestmark = pytest.mark.filterwarnings("ignore")  # warnings of dask about sockets of killed workers


@pytest.fixture
def local():
    """A scheduler on the loopback interface with two worker processes."""
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(
            2, processes=True, threads_per_worker=1, dashboard_address=None, silence_logs=logging.CRITICAL
        ) as dask_cluster,
    ):
        yield dask_cluster


def kill_one(local, path) -> None:
    """Kills a worker of a cluster as soon as the store has 40 rows."""
    pids = [nanny.pid for nanny in local.workers.values()]
    while row_count(path) < 40:
        time.sleep(0.01)
    os.kill(pids[0], signal.SIGKILL)


def test_rows_of_a_cluster_with_a_killed_worker_are_those_of_the_serial_sweep(local, tmp_path):
    tasks = [*rehearsals(200, 0.002), DIES]
    camopt.sweep(tasks[:-1], tmp_path / "serial", workers=0)
    killer = threading.Thread(target=kill_one, args=(local, tmp_path / "x"), daemon=True)
    killer.start()
    with cluster(local.scheduler_address) as (executor, workers):
        assert workers == 2
        swept = camopt.sweep(tasks, tmp_path / "x", executor, workers)
    killer.join(10)
    assert swept.counts == {"done": 200, "failed": 1}
    rows = stored(tmp_path / "x")
    assert [row for row in rows if row[1] != 200] == stored(tmp_path / "serial")
    assert [row[4] for row in rows if row[1] == 200] == [DIED]


def test_an_address_without_a_scheduler(monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr("camopt.tasks.engines.WAIT_SECONDS", 1)
    with pytest.raises(InputError, match=r"--scheduler tcp://127.0.0.1:9: no scheduler answers"):
        with cluster("tcp://127.0.0.1:9"):
            pass


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:8786", "tcp://localhost:1", "tcp://[::1]:1", "tls://10.0.0.1:1"])
def test_safe_addresses(address):
    check_address(address, insecure=False)


def test_an_address_beyond_this_machine_needs_tls_or_an_option():
    with pytest.raises(InputError, match="use tls:// with certificates, or add --insecure"):
        check_address("tcp://cluster.example:8786", insecure=False)
    check_address("tcp://cluster.example:8786", insecure=True)


@pytest.mark.parametrize("address", ["", "127.0.0.1:8786", "tcp://", "tcp://host", "tcp://host:port", "http://h:1"])
def test_invalid_addresses(address):
    with pytest.raises(InputError, match="expected tcp://HOST:PORT or tls://HOST:PORT"):
        check_address(address, insecure=True)


PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "cluster.md"
ARGUMENTS = {"scene": "motori-1", "start": "calmest", "optimiser": "adam", "rate": 1e-3, "width_um": 1.0, "steps": 1}


@pytest.fixture
def files(tmp_path):
    """The page's two files in a new folder."""
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    for name, text in zip(("climbs.py", "sweep_climbs.py"), blocks, strict=True):
        (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


def test_a_row_of_the_experiment(files, monkeypatch):
    monkeypatch.syspath_prepend(files)
    task = {"verb": "call", "function": "climbs:climb", "arguments": ARGUMENTS}
    data = camopt.sweep([task], files / "one.sqlite", workers=0).dataset()
    assert 0.1 < float(data["area_ratio"][0]) < 0.6  # near that of the calmest cam; the largest known value is 0.58
    assert float(data["contact_force_N"][0]) > -250.0  # the tied motion has small pulling forces


@pytest.mark.long
@pytest.mark.timeout(900)
def test_the_script_with_a_local_cluster(files):
    pytest.importorskip("distributed")
    done = subprocess.run(
        [sys.executable, "sweep_climbs.py"], cwd=files, capture_output=True, text=True, check=True, timeout=800
    )
    assert "4 done" in done.stdout, done.stdout + done.stderr
    areas = [float(word) for word in re.findall(r"0\.\d+", done.stdout.splitlines()[-1])]
    assert len(areas) == 4 and len(set(areas)) == 4  # every start and rate gives a different area
