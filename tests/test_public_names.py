"""The names that README, pages and notebooks promise: each exists, says shapes, units and errors, and is shown."""

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
SIGNATURES = {
    "CrankTiming": "centre_deg, cam_per_crank=0.5",
    "MeasuredLift": "speed_rpm, cam_angle_deg, valve_mm",
    "area_bound": "scene, knot_deg=2.0, margin_N=None",
    "ascend": "objective, start, optimiser, steps=50, *, form='free', knot_deg=3.0, train=None, judge_every=5, "
    "metric=False, out=None, resume=False, progress=False",
    "cam_card": "cam, lifts_mm=(1.0, 1.27), *, name='', timing=None, other=None",
    "camshaft_torque": "scene, cam, phases_deg=(0.0,), speed_rpm=None",
    "compare": "scene, designs, out, *, accuracy='draft', baselines='plain', progress=False, note=<lambda>",
    "converted": "lift, measured_by, follower",
    "cycloidal": "scene",
    "differentiable": "scene, cam",
    "exponent": "scene, exponents=(2, 10, 18, 26, 34)",
    "free_cam": "design, knot_deg=3.0",
    "identify": "scene, cam, measured, free, *, settle=0, zero_known=True, noise_um=None, confidence=0.95",
    "joint_spring": "scene, rate=(0.9, 1.1), preload=(0.9, 1.1), *, speeds='band', accuracy='draft', "
    "margin_N=0.0, evaluations=30",
    "kurz": "scene, sections_deg=None, a23=None, *, jerk=True",
    "linear_program": "objective, matrix, bound, *, size=None",
    "linearised": "scene, cam, speeds_rpm=None, *, trains=0, seed=0, tie=1.0, width_um=1.0, source='smooth', "
    "steps_per_revolution=1440, free=()",
    "live": "scene, *, folder=None",
    "load_scene": "source, need=()",
    "manufacturing_yield": "scene, cam, trains=1000, *, speeds_rpm=None, seed=0, halve=False, price=False, out=None, "
    "resume=False, progress=False",
    "modes": "scene, state='lifted'",
    "multi_pol": "scene, sections_deg=None, a12=None, *, a45=None, j34=None, j45=None, jerk=True",
    "nearest_free_cam": "scene, cam, *, knot_deg=3.0",
    "new_design": "scene, sections_deg=None, a12=None, *, a34=None, j34=None, j23=None, start_ratio=None, "
    "quintic=False, jerk=True",
    "objective": "scene, *, speeds_rpm=None, maximise='area_ratio', penalties=None, source='auto', revolutions=4, "
    "trains=0, seed=0, constraints=None, tie=1.0, width_um=None, steps_per_revolution=1440, path=None",
    "optimize": "scene, speeds='band', accuracy='standard', gradient='auto', out=None, seed=0, "
    "resume=False, progress=False, designed=<lambda>, *, compare=True, wanted_yield=None, free=None, start=None, "
    "source=None, width_um=1.0, tie=1.0, steps_per_revolution=1440",
    "pareto": "scene, against='bounce_max_mm', values=None, *, release=(), speeds='band', "
    "accuracy='draft', gradient='none', seed=0, out=None, progress=False",
    "polydyne": "scene, exponents=(2, 10, 18, 26, 34), design_speed_rpm=None, *, ramp_height_mm=None, dynamic=None",
    "polynomial_345": "scene",
    "polynomial_4567": "scene",
    "read_cam": "spec, scene, table_angle=None, table_lift=None, table_ratio=None, table_probe_mm=None, *, "
    "table_first_line=None, table_columns=None",
    "read_lift_table": "path, scene, table_angle=None, table_lift=None, table_ratio=None, table_probe_mm=None, *, "
    "table_first_line=None, table_columns=None",
    "reduce": "scene, cam=None, speeds_rpm=None, *, tolerance_mm=0.01, workers=2",
    "simulate": "scene, cam, speed_rpm, method='event', *, revolutions=2, step_deg=0.1, parameters=None, "
    "accuracy=None, progress=False, width_um=None, tie=None, steps_per_revolution=None",
    "sweep": "tasks, store, executor=None, workers=None, *, retry_failed=False, progress=False",
    "tradeoff": "scene, out=None, resume=False, *, size='full', progress=False, cam=None",
    "trains_as_built": "scene, count, *, seed=0, first=0",
    "trapezoid": "scene, sections_deg=None, jerk=True",
    "verify": "scene, lift, speeds_rpm=None, methods='all', accuracy='standard', progress=False, outside=False",
}
"""Public name -> its parameters with their defaults; those after the star go by name alone."""
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
    """Text that is represented by itself."""

    def __repr__(self) -> str:
        return str(self)


@pytest.mark.parametrize("name", SIGNATURES)
def test_signature(name):
    assert name in dir(camopt)
    assert signature(getattr(import_module(camopt._PUBLIC[name]), name)) == SIGNATURES[name]


USED_FIRST = ("verify", "optimize", "simulate", "reduce", "differentiable")


def test_a_public_name_stays_the_function_after_its_first_use():
    """Names of USED_FIRST, each used in a process of its own; one that a module hides is noticed."""
    snippet = "import camopt, camopt.smooth; first = camopt.{0}; assert callable(first) and camopt.{0} is first"
    hidden = {"hidden": "import camopt, camopt.scene; assert callable(camopt.scene)"}
    ended = run_each({name: snippet.format(name) for name in USED_FIRST} | hidden, (*LIBRARIES, "jax"))
    assert {name for name, code in ended.codes.items() if code} == {"hidden"}, ended.said


def test_no_public_name_is_a_module_of_the_package():
    """Once a module or package of `camopt` is imported, Python hides a function of its name behind it."""
    assert not {module.name for module in pkgutil.iter_modules(camopt.__path__)} & {*camopt.__all__}


def test_every_public_name_has_its_signature_in_the_table():
    assert list(SIGNATURES) == sorted(camopt.__all__)


def test_the_reader_of_signatures_sees_names_defaults_and_kinds():
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
    """The names under TYPE_CHECKING and in the table of homes are the same, from the same modules."""
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
