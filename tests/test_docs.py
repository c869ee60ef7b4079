"""The pages in `docs`: every key of a run folder is documented, and every link has a target."""

import json
import re

import pytest

import camopt
from camopt.cam.families.registry import FAMILIES
from camopt.scene.quantities import QUANTITIES
from tests.documented_keys import ROOT, WORDS, documented, keys, undocumented

PAGES = sorted(p for p in (ROOT / "docs").rglob("*.md") if "site" not in p.parts)


def test_the_page_names_every_key_of_an_energy_balance_and_a_periodic_solution():
    """The keys are those of the stored output of `camopt verify --energy --periodic`."""
    stored = (ROOT / "tests" / "golden" / "slow-verify.txt").read_text(encoding="utf-8")
    (entry, *_) = json.loads(stored.rpartition("== settled.json")[2])["speeds"]
    assert {"residual_relative", "largest_multiplier"} <= keys(entry) <= documented()


def test_the_tutorial_on_comparing_lists_every_family():
    text = (ROOT / "docs/tutorials/compare.md").read_text(encoding="utf-8")
    assert [name for name in FAMILIES if f"`{name}`" not in text] == []


def test_an_undocumented_key_is_detected(tmp_path):
    (tmp_path / "history.jsonl").write_text('{"stage": "margin", "new_key": 1}\n', encoding="utf-8")
    (tmp_path / "comparison.csv").write_text("cam,new_column\n", encoding="utf-8")
    (tmp_path / "design.json").write_text('{"pieces": {"start_rad": []}, "parameters": {"a23": 1}}', encoding="utf-8")
    (tmp_path / "notes.txt").touch()
    assert undocumented(tmp_path) == {"new_key", "new_column", "start_rad", "notes.txt"}


def test_the_model_defines_every_metric():
    text = (ROOT / "docs" / "model.md").read_text(encoding="utf-8")
    table = text.partition("## The metrics")[2]
    rows = dict(re.findall(r"^\| `(\w+)` \| ([^|]+?) \|", table, re.MULTILINE))
    assert rows == {q.name: q.unit for q in QUANTITIES.values()}


@pytest.mark.parametrize(
    "page", [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *PAGES], ids=lambda p: str(p.relative_to(ROOT))
)
def test_the_targets_of_links_exist(page):
    links = [link.partition("#")[0] for link in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8"))]
    files = [page.parent / link for link in links if link and "://" not in link]
    assert not [file for file in files if not (file.exists() and file.stat().st_size)]


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_files_and_modules_that_a_page_names_exist(page):
    words = WORDS.findall(page.read_text(encoding="utf-8"))
    paths = [w for w in words if w.startswith(("camopt/", "tests/")) and not (ROOT / w).exists()]
    named = [re.sub(r"\.[A-Z]\w*$", "", w) for w in words if re.fullmatch(r"camopt(\.\w+)+", w)]
    modules = [name for name in named if name.partition(".")[2] not in camopt.__all__]
    lost = [m for m in modules if not any((ROOT / f"{m.replace('.', '/')}{end}").exists() for end in (".py", "/"))]
    assert not paths and not lost
