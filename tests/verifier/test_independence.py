"""The independence of the methods, read from their imports; tests/test_layers.py reads what else may import what."""

import ast
from pathlib import Path

import pytest

import camopt.verifier
from camopt.verifier.methods import INDEPENDENT
from camopt.verifier.verdict import method_named

FOLDER = Path(camopt.verifier.__file__).parent
METHODS = FOLDER / "methods"


def imported(path: Path) -> set[str]:
    """Every module that a file imports, at any depth, in full."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "relative imports hide their layer"
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def test_every_method_has_a_file_and_every_file_a_method():
    files = {p.stem for p in METHODS.rglob("*.py") if not p.stem.startswith("of_")} - {"__init__"}
    assert {f"camopt.verifier.methods.{name}" for name in files} == set(INDEPENDENT.values())


def test_a_verdict_takes_every_method_from_its_own_file():
    assert {name: method_named(name).__module__ for name in INDEPENDENT} == INDEPENDENT
    assert method_named("event").__module__ == "camopt.verifier.verdict"


def files_of(method: str) -> list[Path]:
    """The file of a method, and the one beside it that is named for it."""
    return [METHODS / f"{method}.py", *METHODS.glob(f"of_{method}.py")]


@pytest.mark.parametrize("method", INDEPENDENT)
def test_methods_share_only_train_lift_and_response(method):
    own = f"camopt.verifier.methods.of_{method}."
    names = {name for path in files_of(method) for name in imported(path)}
    ours = {name for name in names if name.startswith("camopt") and not name.startswith(own)}
    shared = {"camopt.cam.lift.Lift", "camopt.scene.response.Response", "camopt.scene.response.Revolve"}
    data = {"camopt.scene.train.Train", "camopt.scene.train.GROUND"}
    compilation = {"camopt.programs.compiled"}
    refusals = {"camopt.scene.errors.InputError", "camopt.scene.errors.MotionRefused"}
    assert ours <= shared | data | refusals | compilation


def test_every_file_beside_the_methods_belongs_to_one():
    assert {p.stem for p in METHODS.glob("of_*.py")} <= {f"of_{method}" for method in INDEPENDENT}


def test_the_reader_of_imports_sees_them():
    assert "camopt.exact.engine" in imported(FOLDER / "verdict.py")
