"""The robustness tests at a small size; `python -m tests.campaign inputs --cases 100000` and `kills` run more cases."""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from camopt.exact.kernel.propagators import KEPT
from tests.campaign import fuzz, messages
from tests.campaign.fuzz import outcomes, verdict
from tests.campaign.inputs import KINDS, drawn
from tests.campaign.kills import COMMANDS, digest, killings, torn
from tests.campaign.soak import grown, soaked
from tests.campaign.starved import LEAST_FILES, QUICK, bare, camopt, mounted, refused

LONG = pytest.mark.long
"""Mark for additional parameters, since each command takes a second or more to start."""


class TestInputs:
    def test_every_kind_is_drawn_and_cases_are_reproducible(self):
        cases = [drawn(seed) for seed in range(300)]
        assert {case.kind for case in cases} == set(KINDS)
        assert cases == [drawn(seed) for seed in range(300)]

    def test_a_sample_has_no_fault(self):
        cases = outcomes(range(80), workers=2)  # a limit on processor time slows a process's clock
        assert {case["kind"] for case in cases} >= {"scene", "cam", "table", "design", "command"}
        assert not [case for case in cases if case["wrong"]]

    def test_excessive_time_or_memory_is_detected(self):
        """A process that exceeds its processor time is ended, and one that uses too much memory is reported. A process
        with a limit on processor time has a clock with coarse ticks, so no other test runs in it."""
        code = "from tests.campaign import fuzz\nfuzz.SECONDS = 0.0\nfuzz.answer(0)\nwhile True: pass"
        assert subprocess.run([sys.executable, "-c", code], timeout=60).returncode == -signal.SIGXCPU
        code = "from tests.campaign import fuzz\nfuzz.BYTES = 1\nassert fuzz.answer(0)['wrong'] == 'over 2 GB'"
        assert subprocess.run([sys.executable, "-c", code], timeout=60).returncode == 0
        assert fuzz.lost(0, "3 workers died")["kind"] == drawn(0).kind

    @pytest.mark.parametrize(
        ("code", "said", "wrong"),
        [
            (0, "", ""),
            (2, "camopt: x: expected a number", ""),
            (1, "camopt: a defect of camopt", "exit 1"),
            (2, "", "no sentence"),
            (0, "RuntimeWarning: overflow", "Warning:"),
            (2, "x" * 5000, "a line that nobody reads"),
        ],
    )
    def test_faults_are_detected(self, code, said, wrong):
        assert verdict(code, said) == wrong


class TestMessages:
    @pytest.mark.parametrize("seeds", [range(60), pytest.param(range(1000, 2500), marks=LONG)])
    def test_every_message_to_the_designer_is_answered(self, seeds):
        answers = list(messages.outcomes(seeds))
        assert {"status 200", "status 400"} <= {answer["ended"] for answer in answers}
        assert not [answer for answer in answers if answer["wrong"]]

    @pytest.mark.parametrize(
        ("status", "text", "wrong"),
        [
            (200, '{"state": "ok"}', ""),
            (400, '{"says": "expected an object"}', ""),
            (400, "{}", "no sentence"),
            (500, '{"says": "a defect"}', "status 500"),
            (200, "<html>", "no JSON"),
        ],
    )
    def test_faults_are_detected(self, status, text, wrong):
        assert messages.wrong_with(status, text) == wrong


class TestKills:
    @pytest.mark.parametrize(("name", "kills"), [("cam", 1), *(pytest.param(n, 5, marks=LONG) for n in COMMANDS)])
    def test_a_killed_command_is_resumed(self, tmp_path, name, kills):
        assert [kill["wrong"] for kill in killings(name, tmp_path, kills)] == [""] * kills

    def test_damaged_files_are_detected(self, tmp_path):
        for name, text in {"a.json": '{"x": 1', "b.toml": "x = ", "c.svg": "<svg>", "d.json": "{}"}.items():
            (tmp_path / name).write_text(text)
        assert sorted(said.partition(":")[0] for said in torn(tmp_path)) == ["a.json", "b.toml", "c.svg"]

    def test_times_are_ignored_in_comparisons(self, tmp_path):
        for name, seconds in {"a.json": 1, "b.json": 2}.items():
            (tmp_path / name).write_text(f'{{"area": 1, "rows": [{{"seconds": {seconds}}}]}}')
        assert digest(tmp_path / "a.json") == digest(tmp_path / "b.json")


class TestSoak:
    def test_verdicts_do_not_leak_resources(self):
        begin, end = soaked(2 * KEPT, KEPT)  # by then the cache of tables has its largest number of trains
        assert not grown(begin, end), (begin, end)

    @pytest.mark.parametrize("key", ["memory_MB", "threads", "files"])
    def test_growth_is_detected(self, key):
        held = {"memory_MB": 500.0, "threads": 3, "files": 9}
        assert not grown(held, held) and grown(held, held | {key: held[key] * 2})


class TestStarved:
    def test_a_full_disk(self, tmp_path):
        with mounted(tmp_path / "disk", "size=16k") as folder:
            assert refused(camopt(*QUICK, "--csv", str(folder / "lift.csv")))
            assert not list(folder.iterdir())
            assert refused(camopt("yield", "motori-1", "--cam", "polydyne", "--out", str(folder / "run")))

    def test_a_folder_that_may_not_be_written_to(self, tmp_path):
        with mounted(tmp_path / "disk", "ro") as folder:
            assert refused(camopt(*QUICK, "--csv", str(folder / "lift.csv")))
            assert refused(camopt("optimize", "motori-1", "--out", str(folder / "run")))
            assert camopt(*QUICK, cwd=folder, env=bare(HOME=str(folder))).returncode == 0

    def test_files_of_limited_size(self, tmp_path):
        assert refused(camopt(*QUICK, "--csv", "lift.csv", cwd=tmp_path, through=LEAST_FILES))
        assert not list(tmp_path.iterdir())

    @pytest.mark.parametrize("home", [None, *(pytest.param(n, marks=LONG) for n in ("/nonexistent", "/dev/null"))])
    def test_no_home(self, tmp_path, home):
        done = camopt(*QUICK, cwd=tmp_path, env=bare(**({} if home is None else {"HOME": home})))
        assert (done.returncode, "Traceback" in done.stderr) == (0, False)

    @pytest.mark.parametrize("locale", ["C", *(pytest.param(n, marks=LONG) for n in ("POSIX", "tr_TR.UTF-8", "none"))])
    def test_other_locales(self, tmp_path, locale):
        done = camopt("scenes", "kodama", env=bare(LC_ALL=locale, PYTHONUTF8="0", PYTHONIOENCODING="ascii"))
        assert done.returncode == 0, done.stderr
        (tmp_path / "own.toml").write_text(done.stdout)
        assert camopt("modes", str(tmp_path / "own.toml"), env=bare(LC_ALL=locale)).returncode == 0

    @pytest.mark.parametrize(
        "name",
        [
            "a\nb",
            os.fsdecode(b"\xff\xfe"),
            *(pytest.param(n, marks=LONG) for n in (" a b ", "'\"", "-x", "ä€", "%s{x}$y")),
        ],
    )
    def test_odd_names_of_files(self, tmp_path, name):
        done = camopt(*QUICK, f"--csv=./{name}", cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert [os.fsencode(path.name) for path in tmp_path.iterdir()] == [os.fsencode(name)]
        again = camopt("cam", "kodama", f"--cam=./{name}.csv", cwd=tmp_path)
        assert refused(again)

    @pytest.mark.parametrize("ending", [">&-", "2>&-", "<&-", ">&- 2>&-", "| head -c 1", ">/dev/full"])
    def test_closed_input_and_output(self, ending):
        line = f"'{sys.executable}' -m camopt scenes kodama {ending}"
        done = subprocess.run(["bash", "-c", line], capture_output=True, text=True, timeout=60)
        assert "Traceback" not in done.stderr and "a defect" not in done.stderr
        assert done.returncode in (0, 2)

    def test_a_folder_that_vanishes(self, tmp_path):
        words = ("yield", "motori-1", "--cam", "polydyne", "--trains", "200", "--quiet", "--out", "run")
        process = subprocess.Popen(
            [sys.executable, "-m", "camopt", *words], cwd=tmp_path, stderr=subprocess.PIPE, text=True
        )
        while not (tmp_path / "run" / "run.json").exists() and process.poll() is None:
            time.sleep(0.02)
        shutil.rmtree(tmp_path / "run")
        _, said = process.communicate(timeout=120)
        assert process.returncode == 2, said
        assert "Traceback" not in said and "a defect" not in said

    def test_several_at_once_in_one_folder(self, tmp_path):
        words = ("yield", "motori-1", "--cam", "polydyne", "--trains", "20", "--quiet", "--out", "run")
        command = [sys.executable, "-m", "camopt", *words]
        both = [subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True) for _ in range(3)]
        said = [process.communicate(timeout=120)[1] for process in both]
        codes = sorted(process.returncode for process in both)
        assert codes[1:] == [2, 2] and codes[0] in (0, 3), said
        assert not torn(Path(tmp_path / "run"))
