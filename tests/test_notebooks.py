"""The notebooks run from top to bottom at their small size, and the value of every cell has a representation."""

import ast
import re
import time
from pathlib import Path

import pytest

from camopt.optimizer.baselines import comparison

NOTEBOOKS = sorted((Path(__file__).parents[1] / "notebooks").glob("*.py"))
EXPECTED = {
    "bring your own valve train": "own_valve_train",
    "a thousand valve trains": "thousand_trains",
    "compare": "compare_families",
    "an experiment of your own": "own_experiment",
    "first design": "first_design",
    "robust band": "robust_band",
    "speed against accuracy": "speed_against_accuracy",
    "trust in gradients": "trust_in_gradients",
}
REPRESENTATIONS = ("_repr_html_", "_repr_png_", "_repr_mimebundle_")
LONGEST_S = 40.0
"""Limit on the processor time of one notebook at small size [s]; it takes a third if all programs are compiled."""


def cells(text: str) -> list[str]:
    """The code cells of a percent script."""
    parts = re.split(r"^# %%(.*)$", text, flags=re.MULTILINE)[1:]
    return [code for kind, code in zip(parts[::2], parts[1::2], strict=True) if "[markdown]" not in kind]


def shown(code: str, name: str, names: dict) -> object:
    """Runs a cell like a notebook and returns the value of its last line, if that is an expression."""
    tree = ast.parse(code)
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, name, "exec"), names)
    return None if last is None else eval(compile(ast.Expression(last.value), name, "eval"), names)


def shows_itself(value: object) -> bool:
    """Whether a notebook shows a value better than by Python's default representation of an object."""
    if hasattr(type(value), "savefig"):
        return len(value.axes) > 0  # an empty figure shows nothing
    return value is None or isinstance(value, dict | str) or any(hasattr(value, r) for r in REPRESENTATIONS)


def test_all_notebooks_exist():
    assert {path.stem for path in NOTEBOOKS} == set(EXPECTED.values())
    for path in NOTEBOOKS:
        title = re.search(r"^# # (.*)$", path.read_text(encoding="utf-8"), re.MULTILINE)
        assert title and any(EXPECTED[key] == path.stem for key in EXPECTED if title[1].lower().startswith(key))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda p: p.stem)
def test_runs_at_small_size(path, undrawn, tmp_path, monkeypatch):
    monkeypatch.setenv("CAMOPT_NOTEBOOK_SIZE", "small")
    monkeypatch.setattr(comparison, "SECTIONED", ())  # their searches are tested in tests/optimize
    monkeypatch.chdir(tmp_path)
    names, begin, values = {"__name__": "__main__"}, time.process_time(), []
    for i, code in enumerate(cells(path.read_text(encoding="utf-8"))):
        value = shown(code, f"{path.name}, cell {i}", names)
        values.append(value)
        assert shows_itself(value), f"{path.name}, cell {i} ends in a {type(value).__name__} that does not show itself"
        html = (value._repr_html_() if hasattr(value, "_repr_html_") else None) or ""
        assert ">nan<" not in html.lower(), f"{path.name}, cell {i} shows a NaN"
    assert any(hasattr(type(v), "savefig") for v in values), "a notebook without a figure"
    assert time.process_time() - begin < LONGEST_S


def test_a_cell_that_fails_or_shows_nothing_is_detected():
    with pytest.raises(ZeroDivisionError):
        shown("a = 1\na / 0", "cell", {})
    assert shown("a = 1\na + 1", "cell", {}) == 2
    assert not shows_itself(object())
    assert cells("# %% [markdown]\n# text\n\n# %%\na = 1\n# %%\nb = 2\n") == ["\na = 1\n", "\nb = 2\n"]
