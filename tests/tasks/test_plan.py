"""Plans and the command that runs them: the resulting tasks, and a sentence for each fault."""

import os
import re
import signal
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import pytest

import camopt
from camopt.scene import InputError, scene_text
from camopt.tasks import plan as plans
from camopt.tasks.plan import load_plan
from camopt.tasks.task import VERBS, stored_task
from tests.command_line import refused, run
from tests.tasks.tasks_of_tests import row_count, stored

HEAD = 'format = 1\nverb = "settled"\nscenes = ["motori-1"]\ncams = ["polydyne"]\n'
REHEARSAL = 'format = 1\nverb = "rehearse"\n[settings]\ntasks = 20\n'


def written(folder: Path, text: str) -> Path:
    (folder / "plan.toml").write_text(text, encoding="utf-8")
    return folder / "plan.toml"


def test_a_grid_takes_every_combination(tmp_path):
    vary = '[vary]\nspring.preload_N = [240, 250]\n"valve.mass_kg" = [0.2, 0.24, 0.3]\n'
    plan = load_plan(written(tmp_path, HEAD + "speeds_rpm = [4000, 5000]\n" + vary))
    tasks = list(plan)
    assert len(tasks) == len(plan) == 12 == len({stored_task(task, "1").key for task in tasks})
    assert tasks[0] == {"verb": "settled", "scene": "motori-1", "cam": "polydyne", "speed_rpm": 4000.0,
                        "vary": {"spring.preload_N": 240.0, "valve.mass_kg": 0.2}}  # fmt: skip
    assert plan.digest == load_plan(tmp_path / "plan.toml").digest


def test_a_list_combines_entries_in_order_and_uses_the_scenes_speeds(tmp_path):
    vary = 'combine = "list"\n[vary]\nspring.preload_N = [240, 250]\nvalve.mass_kg = [0.2, 0.3]\n'
    tasks = list(load_plan(written(tmp_path, HEAD + vary)))
    listed = camopt.load_scene("motori-1").operation.speeds_rpm
    assert [task["speed_rpm"] for task in tasks] == [*listed, *listed]
    assert {tuple(task["vary"].values()) for task in tasks} == {(240.0, 0.2), (250.0, 0.3)}


def test_every_train_of_a_yield_is_a_task(tmp_path):
    text = HEAD.replace("settled", "yield") + "speeds_rpm = [4000, 5000]\n[settings]\ntrains = 3\nseed = 5\n"
    plan = load_plan(written(tmp_path, text))
    assert [(task["train"], task["seed"], task["speeds_rpm"]) for task in plan] == [
        (i, 5, (4000.0, 5000.0)) for i in range(3)
    ]
    assert len(plan) == 3 and repr(plan) == "SweepPlan(3 tasks of the verb yield)"


def test_files_are_beside_the_plan_and_identified_by_content(tmp_path):
    (tmp_path / "mine.toml").write_text(scene_text("motori-1"), encoding="utf-8")
    path = written(tmp_path, HEAD.replace("motori-1", "mine.toml"))
    plan = load_plan(path)
    assert next(iter(plan))["scene"] == scene_text("motori-1")
    (tmp_path / "mine.toml").write_text(scene_text("motori-1").replace("preload_N = 250", "preload_N = 251"))
    plans.scene_as_text.__globals__["_named_scene"].cache_clear()
    assert load_plan(path).digest != plan.digest


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("format = 1", "verb: Field required"),
        (HEAD.replace("cams", "cam"), "cam: unknown key; did you mean 'cams'?"),
        (HEAD.replace("cams", "cam"), "cams: Value error, missing"),
        (HEAD.replace("motori-1", "motori"), "scene "),
        (HEAD.replace("polydyne", "polydyn"), "neither a family"),
        (HEAD + "speeds_rpm = [0]\n", "speeds_rpm.0: must be greater than 0 (given: '0')"),
        (HEAD + "[vary]\nspring.preload = [1]\n", "'spring.preload': motori-1 has no such number"),
        (HEAD + "[vary]\nspring.preload_N = 1\n", "vary.spring.preload_N: must be a valid tuple"),
        (HEAD + 'combine = "list"\n[vary]\nspring.preload_N = [1]\nvalve.mass_kg = [1, 2]\n', "these are spring"),
        (HEAD + "[settings]\ntrains = 3\n", "trains: unknown key"),
        (REHEARSAL + 'tsks = 1\n', "tsks: unknown key; did you mean 'tasks'?"),
        ('scenes = ["motori-1"]\n' + REHEARSAL, 'verb "rehearse" has none: leave it out'),
        ("format = ", "not valid TOML"),
    ],
)  # fmt: skip
def test_faults_of_a_plan_are_reported_as_sentences(tmp_path, text, words):
    path = written(tmp_path, text)
    with pytest.raises(InputError) as refused:
        load_plan(path)
    assert str(refused.value).startswith(f"{path}: ") and words in str(refused.value)


def test_the_examples_of_plans_are_valid(tmp_path):
    help_text = tomllib.loads(Path("camopt/cli/commands.toml").read_text())["commands"]["sweep"]["notes"]
    page = Path("docs/sweeps.md").read_text(encoding="utf-8")
    tutorial = Path("docs/thousand-trains.md").read_text(encoding="utf-8")
    shown = re.findall(r"```toml\n(.*?)```", page + tutorial, re.DOTALL)
    assert len(shown) == 2
    for text in [*shown, help_text.partition("\n")[2].replace("\n  ", "\n").strip()]:
        assert len(load_plan(written(tmp_path, text))) > 0
    assert all(f"`{verb}`" in page or f'"{verb}"' in page for verb in VERBS)


class TestCommand:
    def test_a_plan_is_swept_and_resumed(self, tmp_path, capsys, monkeypatch):
        monkeypatch.chdir(tmp_path)
        written(tmp_path, REHEARSAL)
        words = "sweep", "plan.toml", "--store", "x.sqlite", "--workers", "1"
        code, out, err = run(capsys, *words, "--csv", "x.csv")
        assert (code, out) == (0, "20 tasks: 20 done\n")
        assert err.startswith("plan.toml: 20 tasks into x.sqlite\n")
        assert len(Path("x.csv").read_text().splitlines()) == 21
        before = stored(tmp_path / "x.sqlite")
        assert "x.sqlite: exists already: --resume goes on in it" in refused(capsys, *words)
        assert run(capsys, *words, "--resume", "--quiet") == (0, "20 tasks: 20 done\n", "")
        written(tmp_path, REHEARSAL.replace("20", "30"))
        said = refused(capsys, *words, "--resume", "--quiet")
        assert said.startswith("camopt: x.sqlite: belongs to another plan, and nothing in it was changed: name another")
        assert stored(tmp_path / "x.sqlite") == before

    @pytest.mark.parametrize(
        ("words", "sentence"),
        [
            (("--resume",), "x.sqlite: is not there, so there is nothing to go on with"),
            (("--insecure",), "--insecure: belongs to --scheduler"),
            (("--retry-failed",), "--retry-failed: computes the failed tasks of a store once more: add --resume"),
            (("--scheduler", "here"), "--scheduler 'here': expected tcp://HOST:PORT or tls://HOST:PORT"),
            (("--scheduler", "tcp://10.0.0.1:8786"), "use tls:// with certificates, or add --insecure"),
        ],
    )
    def test_wrong_use(self, tmp_path, capsys, monkeypatch, words, sentence):
        monkeypatch.chdir(tmp_path)
        written(tmp_path, REHEARSAL)
        assert sentence in refused(capsys, "sweep", "plan.toml", "--store", "x.sqlite", *words)
        assert not Path("x.sqlite").exists()

    def test_failed_tasks_give_exit_code_three(self, tmp_path, capsys, monkeypatch):
        monkeypatch.chdir(tmp_path)
        written(tmp_path, HEAD.replace('"settled"', '"simulate"') + 'speeds_rpm = [5000]\n[settings]\nmethod = "x"\n')
        code, out, err = run(capsys, "sweep", "plan.toml", "--store", "x.sqlite", "--workers", "1")
        assert (code, out) == (3, "1 tasks: 1 failed\n")
        assert "--csv x.sqlite.csv` writes the rows as a table, with the reasons" in err

    def test_an_interruption_reports_how_to_continue(self, tmp_path):
        written(tmp_path, REHEARSAL + "seconds = 0.2\n")
        command = [sys.executable, "-m", "camopt", "sweep", "plan.toml", "--store", "x.sqlite", "--workers", "1"]
        env = os.environ | {"PYTHONPATH": os.pathsep.join([os.getcwd(), os.environ.get("PYTHONPATH", "")])}
        with subprocess.Popen(command, cwd=tmp_path, env=env, stderr=subprocess.PIPE, text=True) as process:
            while not row_count(tmp_path / "x.sqlite"):
                time.sleep(0.02)
            process.send_signal(signal.SIGINT)
            _, err = process.communicate(timeout=30)
        assert process.returncode == 130
        assert "interrupted; x.sqlite is left, with a row for each task that ended" in err
        assert "`camopt sweep plan.toml --store x.sqlite --resume` goes on" in err
        assert 0 < len(stored(tmp_path / "x.sqlite")) < 20
