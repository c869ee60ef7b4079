"""A cluster of dask as an executor: the rows of the serial sweep, whatever is killed; skipped where there is none."""

import logging
import os
import signal
import threading
import time

import pytest

import camopt
from camopt.scene import InputError
from camopt.tasks.engines import check_address, cluster
from tests.tasks.tasks_of_tests import rehearsals, stored
from tests.tasks.test_sweep import DIED, DIES, Killer

pytestmark = pytest.mark.filterwarnings("ignore")  # dask's own, of sockets that its dead workers leave


@pytest.fixture
def local():
    """A scheduler on the loopback interface with two worker processes."""
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(
            2, processes=True, threads_per_worker=1, dashboard_address=None, silence_logs=logging.CRITICAL
        ) as one,
    ):
        yield one


def kill_one(local, path) -> None:
    """Kills a worker of a cluster once 40 rows stand in the store."""
    pids = [nanny.pid for nanny in local.workers.values()]
    reader = Killer(path, [])
    while not path.exists() or reader.count() < 40:
        time.sleep(0.01)
    os.kill(pids[0], signal.SIGKILL)


def test_rows_of_a_cluster_with_a_killed_worker_are_those_of_the_serial_sweep(local, tmp_path):
    tasks = [*rehearsals(200, 0.002), DIES]
    camopt.sweep(tasks[:-1], tmp_path / "serial", workers=0)
    killer = threading.Thread(target=kill_one, args=(local, tmp_path / "x"), daemon=True)
    killer.start()
    with cluster(local.scheduler_address) as (executor, workers):
        assert workers == 2
        found = camopt.sweep(tasks, tmp_path / "x", executor, workers)
    killer.join(10)
    assert found.counts == {"done": 200, "failed": 1}
    rows = stored(tmp_path / "x")
    assert [row for row in rows if row[1] != 200] == stored(tmp_path / "serial")
    assert [row[4] for row in rows if row[1] == 200] == [DIED]


def test_nobody_at_the_address(monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr("camopt.tasks.engines.WAIT_SECONDS", 1)
    with pytest.raises(InputError, match=r"--scheduler tcp://127.0.0.1:9: no scheduler answers"):
        with cluster("tcp://127.0.0.1:9"):
            pass


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:8786", "tcp://localhost:1", "tcp://[::1]:1", "tls://10.0.0.1:1"])
def test_addresses_that_are_safe(address):
    check_address(address, insecure=False)


def test_an_address_beyond_this_machine_needs_tls_or_a_word():
    with pytest.raises(InputError, match="use tls:// with certificates, or add --insecure"):
        check_address("tcp://cluster.example:8786", insecure=False)
    check_address("tcp://cluster.example:8786", insecure=True)


@pytest.mark.parametrize("address", ["", "127.0.0.1:8786", "tcp://", "tcp://host", "tcp://host:port", "http://h:1"])
def test_no_addresses(address):
    with pytest.raises(InputError, match="expected tcp://HOST:PORT or tls://HOST:PORT"):
        check_address(address, insecure=True)
