"""The process that compiles ahead: only on a new installation, and never longer than the job."""

import subprocess
import sys

import pytest

from camopt import programs
from camopt.optimizer import ahead

SLEEPER = [sys.executable, "-c", "import time; time.sleep(600)"]


@pytest.fixture
def started(monkeypatch):
    """The processes that are started, each of them one that would sleep for ten minutes."""
    processes, real = [], subprocess.Popen

    def start(words, **named):
        assert words == [sys.executable, "-m", "camopt.optimizer.ahead"]
        processes.append(real(SLEEPER, **named))
        return processes[-1]

    monkeypatch.setattr(ahead.subprocess, "Popen", start)
    return processes


def test_a_new_installation_compiles_beside_the_job_and_ends_with_it(monkeypatch, started):
    monkeypatch.setattr(ahead, "kept", lambda folder: False)
    with pytest.raises(KeyboardInterrupt), ahead.compiling_ahead():
        assert started[0].poll() is None
        raise KeyboardInterrupt
    assert len(started) == 1 and started[0].poll() is not None


@pytest.mark.parametrize("known", [True, None])
def test_nothing_is_started_where_programs_are_kept_or_cannot_be(monkeypatch, started, known):
    monkeypatch.setattr(ahead, "kept", lambda folder: known)
    with ahead.compiling_ahead():
        pass
    assert started == []


def test_what_is_kept_is_told_by_the_folder(monkeypatch, tmp_path):
    monkeypatch.setattr(programs, "_folder", lambda file: tmp_path)
    assert programs.kept("exact") is False
    (tmp_path / "one.nbi").write_bytes(b"")
    assert programs.kept("exact") is True
    monkeypatch.setattr(programs, "_folder", lambda file: None)
    assert programs.kept("exact") is None


def test_the_late_programs_are_compiled_by_what_it_runs():
    ahead.compile_late_programs()  # from the cache here, where the other tests have run
    from camopt.exact import batch
    from camopt.verifier.methods import rkg

    assert batch.run.signatures and rkg._march.signatures
