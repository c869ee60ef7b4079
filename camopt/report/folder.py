"""Reading of a run folder as plain data, with a list of the missing files; the files are untrusted."""

import csv
import json
import tomllib
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

from camopt.measure.yield_words import standing
from camopt.scene.errors import InputError
from camopt.scene.quantities import is_number
from camopt.verifier.record import VerificationRecord, outside_entries

MOST_BYTES = 50_000_000
MOST_FIGURES = 30
OUTSIDE = "outside.json"
"""File with the results of an external simulation program, where one was used."""
Content = TypeVar("Content")

LOW_MM = 0.005
"""A lift that stays below its limit by less than this [mm] counts as at the limit."""


@dataclass(frozen=True)
class RunFolder:
    """The contents of a run folder; the content of a missing file is empty, and its name is in `missing`."""

    name: str
    scene: dict
    design: dict
    verification: VerificationRecord
    comparison: list[dict[str, str]]
    provenance: dict
    history: list[dict]
    figures: dict[str, str]  # name -> text of the SVG file
    missing: list[str] = field(default_factory=list)
    path: str = ""  # of the folder, relative to the working folder where it lies inside

    @property
    def verdict(self) -> str | None:
        """The verdict; None where the cam was not verified."""
        return self.verification.get("verdict")

    @property
    def broken(self) -> dict[str, list[str]]:
        """The limits that the verdict lists as broken, in the form of `broken_places`."""
        return broken_places(self.verification.get("broken") or [])

    @property
    def built(self) -> dict:
        """The run's statement on trains as built; empty where there is none that can be understood."""
        record = _table(self.verification, "yield")
        return record if standing(record) else {}

    @property
    def demands(self) -> dict:
        """The scene's [design]: every limit by its key."""
        return _table(self.scene, "design")

    @property
    def band_rpm(self) -> tuple[float, float] | None:
        """The scene's band of crankshaft speeds [r/min]."""
        ends = _table(self.scene, "operation").get("band_rpm")
        return (ends[0], ends[1]) if isinstance(ends, list) and len(ends) == 2 and all(map(is_number, ends)) else None

    @property
    def scatters(self) -> bool:
        """Whether the scene has tolerances or a grinding error."""
        return bool(self.scene.get("tolerance") or self.scene.get("grinding"))

    @property
    def settings(self) -> dict:
        """The options of the run."""
        return _table(self.provenance, "settings")

    @property
    def worth(self) -> dict[str, float]:
        """Percentage gain of area for one per cent more of a limit, by the limit's key. The limit on the lift is left
        out where the cam stays below it: the values are those of the kinematic program, which has no limits on the
        motion, so its cam may reach the lift that this one does not."""
        worth = {str(k): v for k, v in _table(self.design, "limit_worth").items() if is_number(v)}
        return worth if self.below_max_lift_mm is None else {k: v for k, v in worth.items() if k != "max_lift_mm"}

    @property
    def below_max_lift_mm(self) -> float | None:
        """Distance of the highest lift below its limit [mm]; None where the limit is reached, or not known."""
        reached, limit = self.design.get("highest_lift_mm"), self.demands.get("max_lift_mm")
        below = limit - reached if is_number(reached) and is_number(limit) else 0.0
        return below if below >= LOW_MM else None

    @property
    def stages(self) -> dict[str, dict]:
        """Time and memory of each stage of the run."""
        stages = _table(self.provenance, "stages")
        return {str(name): cost for name, cost in stages.items() if isinstance(cost, dict)}


def broken_places(broken: Iterable) -> dict[str, list[str]]:
    """Broken limits by key, each with the places at which it is broken, "" for a limit on the cam's shape, from entries
    such as `nose_deg` and `jump_max_mm at 6990 r/min`."""
    places: dict[str, list[str]] = {}
    for entry in broken:
        key, _, place = str(entry).partition(" at ")
        places.setdefault(key, []).append(place)
    return places


def _table(content: dict, key: str) -> dict:
    """A table within a file's content; empty where it is missing or not a table."""
    table = content.get(key)
    return table if isinstance(table, dict) else {}


def read_run_folder(folder: Path) -> RunFolder:
    """Read what a report needs. Raises InputError where the folder does not exist or a file cannot be understood."""
    if not folder.is_dir():
        raise InputError(f"{folder}: no such run folder")
    missing: list[str] = []

    def read_file(name: str, parse: Callable[[str], Content], empty: Content) -> Content:
        path = folder / name
        if not path.is_file():
            missing.append(name)
            return empty
        try:
            return parse(_text(path))
        except (ValueError, csv.Error, RecursionError) as error:  # JSON, TOML and UTF-8 errors are ValueErrors
            raise InputError(f"{path}: cannot be read: {error}") from error

    outside = read_file(OUTSIDE, outside_entries, []) if (folder / OUTSIDE).exists() else []
    return RunFolder(
        name=folder.resolve().name,
        scene=read_file("scene.toml", tomllib.loads, {}),
        design=read_file("design.json", _object, {}),
        verification=read_file("verification.json", _verification, VerificationRecord()).with_outside(outside),
        comparison=read_file("comparison.csv", comparison_rows, []),
        provenance=read_file("provenance.json", _object, {}),
        history=read_file("history.jsonl", _lines, []),
        figures={p.stem: _text(p) for p in sorted((folder / "figures").glob("*.svg"))[:MOST_FIGURES]},
        missing=missing,
        path=_relative_path(folder),
    )


def _relative_path(folder: Path) -> str:
    """Path of the folder relative to the working folder; absolute where it does not lie inside."""
    absolute, here = folder.resolve(), Path.cwd()
    return (absolute.relative_to(here) if absolute.is_relative_to(here) else absolute).as_posix()


def _text(path: Path) -> str:
    if path.stat().st_size > MOST_BYTES:
        raise InputError(f"{path}: larger than {MOST_BYTES} bytes, which no run writes")
    try:
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not UTF-8 text ({error})") from error


def _object(text: str) -> dict:
    data = json.loads(text)
    if not isinstance(data, dict):
        raise ValueError("expected a JSON object")
    return data


def _verification(text: str) -> VerificationRecord:
    data = _object(text)
    if not isinstance(data.get("verdict", ""), str):
        raise ValueError("verdict: expected a word")
    if not isinstance(data.get("broken") or [], list):
        raise ValueError("broken: expected a list of words")
    for key in ("speeds", "worst_in_band"):
        speeds = data.get(key) or []
        if not isinstance(speeds, list) or not all(isinstance(s, dict) for s in speeds):
            raise ValueError(f"{key}: expected a list of objects")
        for speed in speeds:
            methods = speed.get("methods") or {}
            if not isinstance(methods, dict) or not all(isinstance(m, dict) for m in methods.values()):
                raise ValueError(f"{key}.methods: expected an object of objects")
    for key in ("band", "limits"):
        if not isinstance(data.get(key) or {}, dict):
            raise ValueError(f"{key}: expected an object")
    worst = (data.get("band") or {}).get("worst") or {}
    if not isinstance(worst, dict) or not all(isinstance(w, dict) for w in worst.values()):
        raise ValueError("band.worst: expected an object of objects")
    return VerificationRecord(data)


def comparison_rows(text: str) -> list[dict[str, str]]:
    """The rows of a comparison.csv; raises ValueError or csv.Error for a text in another format."""
    reader = csv.DictReader(text.splitlines(), restkey="", restval="", strict=True)
    rows = [{str(k): str(v) for k, v in row.items()} for row in reader]
    if reader.fieldnames is None or "cam" not in reader.fieldnames:
        raise ValueError("expected a column 'cam'")
    return rows


def _lines(text: str) -> list[dict]:
    """Objects of a JSONL file. A last line without a line end is dropped: the run was killed while writing it."""
    lines = text.split("\n")
    return [_object(line) for line in lines[:-1] if line.strip()]
