"""The comparison's table and the verdicts behind it: the contents of `comparison.csv`, `cams` and `verdicts`.

Every row is written from a verdict: the design's in verification.json, or a baseline's in `verdicts/<name>.json`. The
table can therefore be written again from the folder alone.
"""

import json
from collections.abc import Mapping
from pathlib import Path

from camopt.cam.design_file import read_design, write_design
from camopt.cam.lift import Lift
from camopt.measure.limits import steepest_jerk
from camopt.plots.style import DESIGN, family_of
from camopt.scene.errors import InputError
from camopt.scene.schema import Scene
from camopt.scene.units import DEG, MM
from camopt.storage import write_csv, write_json

NO_JERK = " (no jerk limit)"
"""Suffix of the name of a baseline that was designed without the scene's jerk limit."""
FAILED = "failed"
"""Verdict of a baseline that has no member in the scene, or that cannot be judged; `broken` holds the reason."""
JERK = "jerk_max_mm_per_deg3"
MOTION_COLUMNS = ("jump_mm", "contact_force_min_N", "seating_velocity_m_per_s", "impact_velocity_m_per_s")
COLUMNS = (
    "cam",
    "limits",
    "speed_rpm",
    "area_ratio",
    "acceleration_max_mm_per_deg2",
    "acceleration_min_mm_per_deg2",
    "jerk_max_mm_per_deg3",
    "bounce_mm",
    "bounce_low_mm",
    "bounce_high_mm",
    *MOTION_COLUMNS,
    "verdict",
    "broken",
)


def failed(why: str) -> dict:
    """The verdict of a baseline without a cam, with the reason."""
    return {"verdict": FAILED, "broken": [why], "speeds": [], "worst_in_band": [], "band": None}


def store(folder: Path, scene: Scene, cams: Mapping[str, Lift], verdicts: Mapping[str, dict]) -> None:
    """Stores baselines and their verdicts by name in the folder's `cams` and `verdicts`."""
    for name, contents in (("cams", cams), ("verdicts", verdicts)):
        if contents:
            (folder / name).mkdir(exist_ok=True)
    for name, lift in cams.items():
        write_design(folder / "cams" / f"{name}.json", lift, scene.required_design.max_lift_mm * MM)
    for name, verdict in verdicts.items():
        write_json(folder / "verdicts" / f"{name}.json", verdict)


def stored(folder: Path, scene: Scene) -> tuple[dict[str, Lift], dict[str, dict]]:
    """The design and the stored baselines of a run folder, and the verdict of each; raises InputError for a file that
    cannot be understood."""
    cams = {DESIGN: read_design(folder / "design.json", scene)}
    verdicts = {DESIGN: _read_verdict(folder / "verification.json"), **verdicts_in(folder)}
    for name, verdict in verdicts.items():
        if name != DESIGN and verdict["verdict"] != FAILED:
            cams[name] = read_design(folder / "cams" / f"{name}.json", scene)
    return cams, verdicts


def verdicts_in(folder: Path) -> dict[str, dict]:
    """The stored verdicts of baselines by name; raises InputError for one that cannot be understood."""
    paths = sorted((folder / "verdicts").glob("*.json"), key=lambda p: p.stem)
    return {path.stem: _read_verdict(path) for path in paths}


def _read_verdict(path: Path) -> dict:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        speeds = content["speeds"]
        if not isinstance(content["verdict"], str) or not all(isinstance(s, dict) for s in speeds):
            raise ValueError("expected a verdict and its speeds")
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path}: cannot be read as a verdict: {error}; verify the cam again") from error
    return content


def write_table(folder: Path, scene: Scene, cams: Mapping[str, Lift], verdicts: Mapping[str, dict]) -> None:
    """Writes comparison.csv: the rows of every cam, then one row for every verdict without a cam."""
    rows = [row for name, lift in cams.items() for row in comparison_rows(scene, name, lift, verdicts[name])]
    for name, verdict in verdicts.items():
        if name not in cams:
            limits = "no-jerk" if name.endswith(NO_JERK) else "all"
            named = {"cam": name, "limits": limits, "verdict": FAILED, "broken": "; ".join(verdict["broken"])}
            rows.append(dict.fromkeys(COLUMNS) | named)
    write_csv(folder / "comparison.csv", {key: [row[key] for row in rows] for key in COLUMNS})


def comparison_rows(scene: Scene, name: str, lift: Lift, verdict: dict) -> list[dict]:
    """One row per judged speed of a cam, listed or the band's worst, in ascending order; `verdict` is the stored one.

    A cam of the literature that breaks the jerk limit belongs to the table without that limit, where it is not rejected
    for it; a design never does.
    """
    design = scene.required_design
    low, high = (a / MM * DEG**2 for a in lift.extremes(2))
    jerk = steepest_jerk(lift, design) / MM * DEG**3
    shape = [word for word in verdict["broken"] if " at " not in word]
    limits = "no-jerk" if JERK in shape and family_of(name) != DESIGN else "all"
    shape = [word for word in shape if word != JERK or limits == "all"]
    records = {s["speed_rpm"]: s for s in [*(verdict.get("worst_in_band") or []), *verdict["speeds"]]}
    rows = []
    for speed in sorted(records):
        s = records[speed]
        broken_at_speed = [word for word in verdict["broken"] if word.endswith(f" at {speed:g} r/min")]
        low_mm, high_mm = s["bounce_range_mm"]
        rows.append(
            {
                "cam": name,
                "limits": limits,
                "speed_rpm": speed,
                "area_ratio": lift.area_ratio_in(design),
                "acceleration_max_mm_per_deg2": high,
                "acceleration_min_mm_per_deg2": low,
                "jerk_max_mm_per_deg3": jerk,
                "bounce_low_mm": low_mm,
                "bounce_high_mm": high_mm,
                **{key: s[key] for key in ("bounce_mm", *MOTION_COLUMNS)},
                "verdict": "rejected" if shape else s["verdict"],
                "broken": "; ".join([*shape, *broken_at_speed]),
            }
        )
    return rows
