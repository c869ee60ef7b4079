"""The survivors with stored reasons still exist in the sources."""

import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
KNOWN = tomllib.loads(Path(__file__).with_name("survivors.toml").read_text(encoding="utf-8"))["survivor"]


@pytest.mark.parametrize("survivor", KNOWN, ids=lambda survivor: f"{survivor['file']}:{survivor['operator']}")
def test_the_lines_of_a_survivor_are_in_its_file(survivor):
    lines = (ROOT / survivor["file"]).read_text(encoding="utf-8").splitlines()
    lost = [line[1:] for line in survivor["difference"].splitlines() if line.startswith("-")]
    assert lost and all(line in lines for line in lost), "bring it to the line as it is now, or drop it"
    assert survivor["kind"] in ("equivalent", "harmless") and survivor["reason"]


def test_a_known_place_is_found_when_lines_before_it_change(tmp_path, monkeypatch):
    drawing = pytest.importorskip("tests.mutation.mutants", exc_type=ImportError)
    path = tmp_path / "camopt/measure/a.py"
    path.parent.mkdir(parents=True)
    change = "@@ -1 +1 @@\n-    return 2 * x\n+    return 2 + x"
    monkeypatch.setattr(drawing, "ROOT", tmp_path)
    for before in ("", "LIMIT = 3 * 4\n\n\n"):
        path.write_text(f"{before}def f(x):\n    return 2 * x\n\n\ndef g(x):\n    return 2 * x\n")
        places = drawing.mutants_with("camopt/measure/a.py", "ReplaceBinaryOperator_Mul_Add", change)
        assert [mutant.occurrence for mutant in places] == ([1, 2] if before else [0, 1])
    path.unlink()
    assert drawing.mutants_with("camopt/measure/a.py", "ReplaceBinaryOperator_Mul_Add", change) == []
