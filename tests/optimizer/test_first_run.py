"""The first run of an installation compiles in processes of its own, which never outlive it."""

import subprocess
import sys
from argparse import Namespace

import pytest

from camopt import programs
from camopt.cli.arguments import say_compilation
from camopt.optimizer import first_run, run
from camopt.optimizer.accuracy import ACCURACIES
from camopt.optimizer.stage_clock import Progress, StageClock
from camopt.scene import load_scene

SLEEPER = [sys.executable, "-c", "import time; time.sleep(600)"]


def test_a_process_for_every_part_and_none_outlives_an_interruption(monkeypatch):
    processes, real = [], subprocess.Popen

    class Interrupted(real):
        def wait(self, timeout=None):
            if self is processes[0] and self.poll() is None and len(processes) == len(first_run.PARTS):
                processes.append("interrupted once")
                raise KeyboardInterrupt
            return super().wait(timeout)

    def start(words, **named):
        assert words == [sys.executable, "-m", "camopt.optimizer.first_run", list(first_run.PARTS)[len(processes)]]
        processes.append(Interrupted(SLEEPER, **named))
        return processes[-1]

    monkeypatch.setattr(first_run.subprocess, "Popen", start)
    with pytest.raises(KeyboardInterrupt):
        first_run.compile_programs()
    assert len(processes) == len(first_run.PARTS) + 1
    assert all(process.poll() is not None for process in processes[:-1])


def test_programs_are_missing_only_where_they_could_be_kept(monkeypatch, tmp_path):
    monkeypatch.setattr(programs, "_folder", lambda file: tmp_path)
    assert first_run.programs_missing()
    (tmp_path / "one.nbi").write_bytes(b"")
    assert not first_run.programs_missing()
    monkeypatch.setattr(programs, "_folder", lambda file: None)
    assert not first_run.programs_missing()


@pytest.mark.parametrize(("wanted", "said"), [(True, first_run.SAYING + "\n"), (False, "")])
def test_a_job_says_that_it_compiles_where_no_bar_is_drawn_too(monkeypatch, capsys, wanted, said):
    """Standard error is no terminal here, so that the bar shows nothing."""
    monkeypatch.setattr(run, "programs_missing", lambda: True)
    monkeypatch.setattr(run, "compile_programs", lambda: None)
    scene, effort = load_scene("motori-1"), ACCURACIES["draft"]
    with Progress(wanted, effort, "auto", False) as shown:
        run._OpenRun(scene, {}, effort, StageClock(), None, shown).make_programs()
        assert capsys.readouterr().err == said


@pytest.mark.parametrize("missing", [True, False])
def test_a_command_that_simulates_says_so_before_it_compiles(monkeypatch, capsys, missing):
    monkeypatch.setattr(first_run, "programs_missing", lambda: missing)
    say_compilation(Namespace(quiet=False))
    assert capsys.readouterr() == ("", f"{first_run.SAYING}\n" * missing)
    say_compilation(Namespace(quiet=True))
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("part", first_run.PARTS)
def test_a_part_ends_well_in_a_process_of_its_own(part):
    words = [sys.executable, "-m", "camopt.optimizer.first_run", part]
    done = subprocess.run(words, capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
