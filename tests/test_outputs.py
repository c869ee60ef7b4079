"""Commands and functions check that every output file and folder can be written before they compute anything."""

import argparse
from importlib import import_module

import optax
import pytest

import camopt
from camopt import storage
from camopt.cam.families.polydyne import polydyne
from camopt.cli import arguments, verbs
from camopt.cli.parser import WRITTEN, parser, verb_named
from camopt.report.regenerated import regenerate
from camopt.scene import InputError, load_scene
from camopt.scene.text_file import scene_toml
from tests.command_line import refused

CAM = ("--cam", "polydyne")
NEEDED = {
    "verify": CAM,
    "simulate": (*CAM, "--speed", "6000"),
    "gradient": (*CAM, "--speed", "6000"),
    "yield": CAM,
    "cam": CAM,
    "what-if": (*CAM, "--set", "valve_tip.mass_kg=0.1"),
    "rise": ("--rise-mm", "10", "--over-deg", "60"),
    "sweep --csv": ("--store", "rows.sqlite"),
}
"""Required arguments of a verb other than its scene."""
SCENES = {"rise": (), "sweep": ("plan.toml",)}
FIRST = {
    "camopt.cli.verbs": ("cam_of",),
    "camopt.optimizer.run": ("optimize", "kinematic_optimum", "with_best_values"),
    "camopt.optimizer.baselines.comparison": ("compare", "compare_again"),
    "camopt.study.extremes.extremes": ("extremes",),
    "camopt.study.tradeoff.methods": ("method_work",),
    "camopt.study.fronts": ("_point",),
    "camopt.optimizer.ascent.ascent": ("FreeVariables",),
    "camopt.report.regenerated": ("compare_again",),
}
"""The first functions that a verb or a public function calls to compute, by module."""


def outputs() -> dict[str, argparse.Action]:
    """The options of all verbs that name a file or folder to write, as "verb option"."""
    every = next(a for a in parser()._actions if isinstance(a, argparse._SubParsersAction)).choices
    files = {f"{verb} {action.option_strings[0]}": action for verb, sub in every.items() for action in sub._actions[1:]
             if action.metavar in ("FILE", "DIR")}  # fmt: skip
    assert len(files) > 15
    return files


@pytest.fixture
def places(tmp_path, monkeypatch):
    """A folder with a file, below which no folder can be created, and a folder in which no file can be created
    (simulated, because access rights do not bind a superuser)."""
    (tmp_path / "file").write_text("kept")
    (tmp_path / "closed").mkdir()
    plain = storage.Path.touch

    def touch(self, *arguments, **named):
        if "closed" in self.parts:
            raise PermissionError(13, "Permission denied")
        return plain(self, *arguments, **named)

    monkeypatch.setattr(storage.Path, "touch", touch)
    monkeypatch.chdir(tmp_path)
    kept = sorted(tmp_path.rglob("*"))
    yield tmp_path
    assert sorted(tmp_path.rglob("*")) == kept and (tmp_path / "file").read_text() == "kept"


def forbid(monkeypatch, *but: str) -> None:
    """Makes the test fail if anything is computed."""
    for module, names in FIRST.items():
        for name in set(names) - set(but):
            monkeypatch.setattr(import_module(module), name, lambda *_, **__: pytest.fail("it computed first"))


@pytest.mark.parametrize("option", outputs())
def test_an_output_of_a_verb_is_checked_before_it_computes(capsys, monkeypatch, places, option):
    verb, name = option.split()
    if outputs()[option].metavar == "FILE":
        assert outputs()[option].dest in WRITTEN
        monkeypatch.setattr(verbs, verb_named(verb), lambda args: pytest.fail("it computed first"))
        paths = "file/x.svg", "closed/x.svg", "none/x.svg"
    else:
        forbid(monkeypatch)
        paths = "file/x", "closed/x", "closed/none/x"
    words = verb, *SCENES.get(verb, ("motori-1",)), *NEEDED.get(verb, ()), *NEEDED.get(option, ())
    for path in paths:
        said = refused(capsys, *words, name, path)
        assert said.count("\n") == 1 and "cannot be written" in said and "writable" in said


@pytest.mark.parametrize("verb", ["optimize", "compare", "tradeoff", "extremes"])
def test_a_default_folder_is_checked_too(capsys, monkeypatch, places, verb):
    forbid(monkeypatch)
    monkeypatch.setattr(arguments, "default_run_folder", lambda name: places / "closed" / "runs" / name)
    assert "cannot be written to (Permission denied)" in refused(capsys, verb, "motori-1")


def test_a_device_passes_the_check():
    storage.check_file("/dev/null")


@pytest.mark.parametrize("path", ["file/x", "closed/x"])
@pytest.mark.parametrize("function", ["optimize", "tradeoff", "pareto", "ascend"])
def test_an_output_of_a_function_is_checked_before_it_computes(monkeypatch, places, function, path):
    forbid(monkeypatch, "optimize")
    scene = load_scene("motori-1")

    def ascend(scene, out):
        camopt.ascend(camopt.objective(scene, speeds_rpm=(4000,)), polydyne(scene), optax.sgd(1e-3), 1, out=out)

    free = {"free": {"spring.preload_N": (200.0, 320.0)}} if function == "optimize" else {}
    computing = ascend if function == "ascend" else getattr(camopt, function)
    with pytest.raises(InputError, match="cannot be written"):
        computing(scene, out=places / path, **free)


def test_the_report_is_checked_before_it_is_made_again(monkeypatch, tmp_path):
    forbid(monkeypatch)
    (tmp_path / "scene.toml").write_text(scene_toml(load_scene("motori-1")))
    (tmp_path / "report.html").mkdir()
    with pytest.raises(InputError, match=r"report\.html: cannot be written \(it is a folder\)"):
        regenerate(tmp_path)
