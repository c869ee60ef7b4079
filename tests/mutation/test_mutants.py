"""The order of the mutants follows from the seed, and every mutant is a fault."""

from pathlib import Path

import pytest

pytest.importorskip("cosmic_ray")

from tests.mutation import mutants as drawing
from tests.mutation.mutants import Mutant, difference


@pytest.fixture
def small(tmp_path, monkeypatch) -> Path:
    """A tree with one file."""
    path = tmp_path / "camopt/measure/a.py"
    path.parent.mkdir(parents=True)
    path.write_text("def f(x: int | None) -> int | None:\n    return 2 * x\n")
    monkeypatch.setattr(drawing, "ROOT", tmp_path)
    return path


def test_the_order_of_all_places_follows_from_the_seed(small):
    drawn = drawing.mutants(0)
    assert drawn == drawing.mutants(0) and len({m.key for m in drawn}) == len(drawn)
    assert {m.file for m in drawn} == {"camopt/measure/a.py"}
    assert sorted(m.key for m in drawn) == sorted(m.key for m in drawing.mutants(1))


def test_every_mutant_is_a_fault(small):
    texts = [m.text() for m in drawing.mutants(0)]
    assert len({*texts}) == len(texts) > 5
    assert all("2 * x" not in text and "(x: int | None) -> int | None" in text for text in texts)


def test_a_missing_place_is_reported(small):
    with pytest.raises(ValueError, match="no such place"):
        Mutant("camopt/measure/a.py", "NumberReplacer", 99).text()


def test_the_difference_names_its_lines(small):
    small.write_text("import math\n\n\ndef f(x):\n    return math.pi * x\n")
    mutant = next(m for m in drawing.mutants(0) if "Mul" in m.operator)
    text, lines = difference(mutant, mutant.text())
    assert lines == range(5, 6) and "-    return math.pi * x" in text
