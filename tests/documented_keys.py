"""The keys of run folders, and the words that their page documents."""

import csv
import json
import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
OPEN = {"parameters", "limit_worth", "versions", "scene", "first_broken", "blame", "baselines"}
"""Keys whose content has arbitrary names as keys: parameters, limits, packages, scenes, tolerances, cams."""
NAMED = {"event", "rkg", "tmm", "houbolt", "dop853"}
WORDS = re.compile(r"`([^`\s]+)`")


def documented() -> set[str]:
    """All words in code font on the page of the run folder."""
    return set(WORDS.findall((ROOT / "docs" / "run-folder.md").read_text(encoding="utf-8")))


def keys(data) -> set[str]:
    """All keys of a record at any depth, except arbitrary names."""
    if isinstance(data, list):
        return set().union(*map(keys, data))
    if not isinstance(data, dict):
        return set()
    inside = [keys(value) for key, value in data.items() if key not in OPEN]
    return set(data).union(*inside) - NAMED


def undocumented(folder: Path) -> set[str]:
    """Files, columns and keys of a run folder that its page does not document."""
    names = {f"{p.name}/" if p.is_dir() else p.name for p in folder.iterdir()}
    for path in folder.rglob("*.json"):
        names |= keys(json.loads(path.read_text(encoding="utf-8")))
    for line in (folder / "history.jsonl").read_text(encoding="utf-8").splitlines():
        names |= keys(json.loads(line))
    for path in folder.glob("*.csv"):
        with open(path, newline="", encoding="utf-8") as file:
            names |= set(next(csv.reader(file)))
    return names - documented()
