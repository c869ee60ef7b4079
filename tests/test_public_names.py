"""The public names of the package: each exists, has its stated signature and a docstring, and is in the guide."""

import ast
import inspect
import pkgutil
import pydoc
import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

import camopt
from tests.fresh_processes import LIBRARIES, run_each

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", ROOT / "docs" / "reference" / "python.md", *sorted((ROOT / "notebooks").glob("*.py"))]
GUIDE = "".join(p.read_text(encoding="utf-8") for p in PAGES)
SIGNATURES = dict(
    line.removesuffix(")").split("(", 1)
    for line in (ROOT / "tests" / "data" / "signatures.txt").read_text(encoding="utf-8").splitlines()
)
"""Public name -> its parameters with their defaults; those after the star are keyword-only."""
UNPROMISED = {"CrankTiming", "MeasuredLift", "cam_card", "camshaft_torque", "converted", "cycloidal", "differentiable",
              "exponent", "joint_spring", "linear_program", "live", "polynomial_345", "polynomial_4567", "read_cam",
              "tradeoff"}  # fmt: skip
"""Public names that the guide need not show."""


def page(name: str) -> str:
    """The docstring of a public name."""
    return inspect.getdoc(getattr(camopt, name)) or ""


def signature(function) -> str:
    """Parameters and defaults without annotations; a default that is a function is shown as its name."""
    bare = []
    for parameter in inspect.signature(function).parameters.values():
        default = parameter.default
        shown = Shown(default.__name__) if inspect.isfunction(default) else default
        bare.append(parameter.replace(annotation=inspect.Parameter.empty, default=shown))
    return str(inspect.Signature(bare))[1:-1]


class Shown(str):
    """Text whose representation is the text itself."""

    def __repr__(self) -> str:
        return str(self)


@pytest.mark.parametrize("name", SIGNATURES)
def test_signature(name):
    assert name in dir(camopt)
    assert signature(getattr(import_module(camopt._PUBLIC[name]), name)) == SIGNATURES[name]


USED_FIRST = ("verify", "optimize", "simulate", "reduce", "differentiable")


def test_a_public_name_remains_the_same_function():
    """Each name of USED_FIRST is used in a new process; the test also detects a name that a module hides."""
    snippet = "import camopt, camopt.smooth; first = camopt.{0}; assert callable(first) and camopt.{0} is first"
    hidden = {"hidden": "import camopt, camopt.scene; assert callable(camopt.scene)"}
    ended = run_each({name: snippet.format(name) for name in USED_FIRST} | hidden, (*LIBRARIES, "jax"))
    assert {name for name, code in ended.codes.items() if code} == {"hidden"}, ended.said


def test_no_public_name_is_a_module_of_the_package():
    """An imported module or package of `camopt` would hide a public function of the same name."""
    assert not {module.name for module in pkgutil.iter_modules(camopt.__path__)} & {*camopt.__all__}


def test_every_public_name_has_its_signature_in_the_table():
    assert list(SIGNATURES) == sorted(camopt.__all__)


def test_signatures_have_names_defaults_and_kinds():
    def one(a: int, b=1, *, c="x", d=signature) -> None: ...

    assert signature(one) == "a, b=1, *, c='x', d=signature"


@pytest.mark.parametrize("name", sorted(SIGNATURES.keys() - UNPROMISED))
def test_is_in_the_guide(name):
    assert re.search(rf"`{name}`|camopt\.{name}\(", GUIDE)


def test_every_public_name_has_a_docstring_that_begins_with_a_sentence():
    for name in dir(camopt):
        if name == "__version__":
            continue
        first = page(name).split("\n\n")[0].replace("\n", " ")
        assert first.endswith((".", ")", ".)")) and len(first.split()) > 3, name


def test_help_names_every_function_with_its_parameters():
    text = pydoc.render_doc(camopt, renderer=pydoc.plaintext)
    listed = text.split("FUNCTIONS", 1)[1]
    for name in camopt.__all__:
        assert f"`{name}`" in camopt.__doc__ or f"`{name}," in camopt.__doc__, f"{name}: not in the docstring"
        if inspect.isfunction(getattr(camopt, name)):
            assert re.search(rf"^    {name}\(\s*\w", listed, re.M), f"{name}: no signature"


def test_names_for_editors_are_those_that_are_imported_lazily():
    """The names under TYPE_CHECKING and in the table of lazy imports are the same, from the same modules."""
    tree = ast.parse(Path(camopt.__file__).read_text(encoding="utf-8"))
    (block,) = (node for node in tree.body if isinstance(node, ast.If))
    seen = {alias.name: node.module for node in block.body for alias in node.names}
    assert seen == camopt._PUBLIC
    assert {*camopt.__all__, "__version__"} == set(dir(camopt))


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'simulat'"):
        camopt.simulat  # noqa: B018


def test_import_loads_nothing_heavy():
    heavy = {"jax", "numba", "numpy", "scipy", "matplotlib", "xarray", "pandas", "pydantic"}
    code = f"import sys, camopt; dir(camopt); print(*({heavy} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout.strip()) == (0, "")
