"""Programs that numba keeps go when any source of theirs changes, and stay otherwise."""

import ast
import os
import subprocess
import sys
from pathlib import Path

import camopt
from camopt import exact
from camopt.exact.compilation import STAMP, forget_stale_programs

CALLEE = "import numba\n@numba.njit(cache=True)\ndef number():\n    return {}\n"
CALLER = "import numba\nfrom callee import number\n@numba.njit(cache=True)\ndef twice():\n    return 2 * number()\n"
ASK = (
    "from pathlib import Path; import caller; from camopt.exact.compilation import forget_stale_programs as forget; "
    "forget(Path('.'), Path(caller.twice.stats.cache_path)); print(caller.twice())"
)


def ask(folder: Path) -> str:
    root = str(Path(__file__).parents[2])
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([root, str(folder)])}
    run = subprocess.run(
        [sys.executable, "-c", ASK], cwd=folder, env=environment, capture_output=True, check=True, timeout=60
    )
    return run.stdout.decode().strip()


def test_a_change_in_a_called_file_is_seen(tmp_path):
    (tmp_path / "callee.py").write_text(CALLEE.format(3))
    (tmp_path / "caller.py").write_text(CALLER)
    assert ask(tmp_path) == "6"
    (tmp_path / "callee.py").write_text(CALLEE.format(50))
    assert ask(tmp_path) == "100"  # numba alone would go on with the old program and say 6


def test_programs_stay_while_the_sources_do(tmp_path):
    sources, kept = tmp_path / "sources", tmp_path / "kept"
    sources.mkdir()
    (sources / "kernel.py").write_text("a = 1")
    assert forget_stale_programs(sources, kept)
    (kept / "kernel.nbi").write_text("index")
    (kept / "other.txt").write_text("not a program")
    assert not forget_stale_programs(sources, kept)
    assert (kept / "kernel.nbi").exists()
    (sources / "kernel.py").write_text("a = 2")
    assert forget_stale_programs(sources, kept)
    assert sorted(path.name for path in kept.iterdir()) == [STAMP, "other.txt"]


def test_a_change_of_a_constant_from_elsewhere_is_seen(tmp_path):
    sources, kept, units = tmp_path / "sources", tmp_path / "kept", tmp_path / "units.py"
    sources.mkdir()
    units.write_text("MM = 1e-3")
    assert forget_stale_programs(sources, kept, [units])
    assert not forget_stale_programs(sources, kept, [units])
    units.write_text("MM = 1e-2")
    assert forget_stale_programs(sources, kept, [units])


def test_every_constant_that_the_programs_read_is_covered():
    """Numbers that `camopt.exact` imports from other folders (their names are capitals) come from the files listed."""
    root = Path(camopt.__file__).parent
    found = set()
    for path in (root / "exact").rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        for node in ast.walk(ast.parse(text)) if "njit" in text else ():
            if isinstance(node, ast.ImportFrom) and node.module and not node.module.startswith("camopt.exact"):
                constants = [a.name for a in node.names if a.name.isupper()]
                if constants and node.module.startswith("camopt."):
                    found.add((root.parent / node.module.replace(".", "/")).with_suffix(".py"))
    assert found == set(exact.CONSTANTS)
