"""Designs beside the cams of the literature: `comparison.csv`, their verdicts, and the figures of a run folder.

Every row is written from a verdict as verification.json has it: the design's from that file, a baseline's from
`verdicts/<name>.json`. The table and the figures can therefore be made again from the folder alone.
"""

import json
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from camopt.cam.design_file import read_design, write_design
from camopt.cam.families.polydyne import polydyne
from camopt.cam.lift import Lift
from camopt.cam.read import FAMILIES, read_cam
from camopt.optimize.accuracy import Accuracy, accuracy_named
from camopt.optimize.figures import draw
from camopt.plots.style import DESIGN, family_of
from camopt.scene.errors import InputError
from camopt.scene.schema import Scene
from camopt.scene.train import build_train
from camopt.scene.units import DEG, MM
from camopt.storage import create_run_folder, write_csv, write_json
from camopt.verify.effort import EFFORTS
from camopt.verify.verdict import Verdict, verify

SECTIONED = ("multi-pol", "new-design")
NO_JERK = " (no jerk limit)"
"""Ending of the name of a baseline that was designed without the scene's jerk limit."""
FAILED = "failed"
"""Verdict of a baseline that the scene has no member of, or that cannot be judged; its sentence stands as `broken`."""
JERK = "jerk_max_mm_per_deg3"
HALVINGS = 3
"""Of the step of each method for a baseline: enough where it bounces little, and where it bounces much only the range
matters."""
MOTION_COLUMNS = ("jump_mm", "contact_force_min_N", "seating_velocity_m_per_s", "impact_velocity_m_per_s")


def compare(
    scene: Scene,
    designs: dict[str, Lift],
    out: Path | str,
    accuracy: str = "draft",
    baselines: str = "plain",
    progress: bool = False,
) -> Path:
    """Compare designs with the scene's baselines in the new folder `out`; returns it.

    `designs`: name -> lift law, each judged at the scene's listed speeds (k) [r/min] and over its band. `baselines`
    "plain": the literature's cams as their authors would draw them, for the largest area; "best": every family searched
    for the largest area within the scene's bounce limit at its listed speeds, which takes minutes and with `progress`
    draws a bar. Either under all limits of the scene and without its jerk limit. Writes comparison.csv and figures.
    Raises InputError for an unusable folder or scene, and for other words.
    """
    build_train(scene).require_linear("the comparison", "verify each cam on this scene with `camopt verify`")
    if baselines not in BASELINES:
        raise InputError(f"baselines {baselines!r}: expected {' or '.join(BASELINES)}")
    effort = accuracy_named(accuracy)
    folder = create_run_folder(out)
    named = {"design" if len(designs) == 1 else name: lift for name, lift in designs.items()}
    compare_in(folder, scene, named, {}, effort, BASELINES[baselines](scene, progress))
    return folder


def plain_baselines(scene: Scene, progress: bool = False) -> dict[str, Lift | str]:
    """Polydyne, Multi-Pol and New Design by name; a sentence where a family has no member."""
    cams: dict[str, Lift | str] = {"polydyne": _member(lambda: polydyne(scene))}
    for name in SECTIONED:
        cams[name] = _member(lambda name=name: read_cam(name, scene))
        if _jerk_limited(scene):
            cams[name + NO_JERK] = _member(lambda name=name: read_cam(f"{name}:jerk=no", scene))
    return cams


def best_baselines(scene: Scene, progress: bool = False) -> dict[str, Lift | str]:
    """Every family's largest area within the scene's bounce limit, by name; where none holds it, the least bounce."""
    from camopt.optimize.baselines import largest_area_member

    limit = None if scene.design is None else scene.design.bounce_max_mm
    cams: dict[str, Lift | str] = {}
    for jerk in (True, False) if _jerk_limited(scene) else (True,):
        for name in FAMILIES:
            cams[name + ("" if jerk else NO_JERK)] = _member(
                lambda name=name, jerk=jerk: largest_area_member(scene, name, jerk, limit, progress=progress).lift
            )
    return cams


BASELINES = {"plain": plain_baselines, "best": best_baselines}


def _jerk_limited(scene: Scene) -> bool:
    return scene.design is not None and scene.design.jerk_max_mm_per_deg3 is not None


def _member(design: Callable[[], Lift]) -> Lift | str:
    """A family's member, or why the scene has none: the comparison says so and goes on with the others.

    Whatever a family fails of, it must not cost the design that it is compared with: any exception is such a reason.
    """
    try:
        return design()
    except InputError as error:
        return str(error)
    except Exception as error:
        return _defect(error)


def _defect(error: Exception) -> str:
    return f"it failed on this train, which is a defect of camopt ({type(error).__name__}: {error})"


def compare_in(
    folder: Path,
    scene: Scene,
    designs: dict[str, Lift],
    verdicts: dict[str, Verdict],
    effort: Accuracy,
    baselines: Mapping[str, Lift | str] | None = None,
) -> None:
    """comparison.csv and figures into a folder; cams with a verdict are not verified again.

    `baselines` as `plain_baselines`, which is the default, gives them; one that has no member gets a row that says why.
    They are judged at the listed speeds and, unless a given verdict is without one, over the band in the same steps as
    the design. Cams and verdicts are kept in the folder's `cams` and `verdicts`, for the report and for `--cam`.
    """
    baselines = plain_baselines(scene) if baselines is None else baselines
    band_step = None if any(v.band is None for v in verdicts.values()) else effort.verdict.band_step_rpm
    cams = dict(designs)
    found = {name: verdicts[name].as_dict() if name in verdicts else _judged(scene, lift, effort, band_step)
             for name, lift in designs.items()}  # fmt: skip
    for name, lift in sorted(baselines.items()):
        found[name] = _judged_baseline(scene, lift, effort, band_step)
        if not isinstance(lift, str) and found[name]["verdict"] != FAILED:
            cams[name] = lift
    _keep(folder, scene, {name: lift for name, lift in cams.items() if name not in designs},
          {name: one for name, one in found.items() if name not in designs})  # fmt: skip
    _write(folder, scene, cams, found)


def compare_again(folder: Path, scene: Scene) -> None:
    """comparison.csv and figures of a run folder again, from the design, cams and verdicts that lie in it.

    A folder without verdicts of baselines (an older run's) keeps its comparison. Raises InputError for files that
    cannot be understood.
    """
    if not (folder / "verdicts").is_dir():
        return
    cams = {DESIGN: read_design(folder / "design.json", scene)}
    found = {DESIGN: _read_verdict(folder / "verification.json")}
    for path in sorted((folder / "verdicts").glob("*.json"), key=lambda p: p.stem):
        found[path.stem] = _read_verdict(path)
        if (stored := folder / "cams" / path.name).is_file():
            cams[path.stem] = read_design(stored, scene)
    _write(folder, scene, cams, found)


def _judged(scene: Scene, lift: Lift, effort: Accuracy, band_step_rpm: float | None) -> dict:
    methods, tolerance_um = EFFORTS["draft"].methods, effort.verdict.tolerance_um
    return verify(scene, lift, None, methods, band_step_rpm, tolerance_um, HALVINGS).as_dict()


def _judged_baseline(scene: Scene, lift: Lift | str, effort: Accuracy, band_step_rpm: float | None) -> dict:
    """A baseline's verdict; one that has no member, or that cannot be judged, is "failed" with its sentence."""
    failure = lift
    if not isinstance(lift, str):
        try:
            return _judged(scene, lift, effort, band_step_rpm)
        except Exception as error:  # as in `_member`: it must not cost the design
            failure = str(error) if isinstance(error, InputError) else _defect(error)
    return {"verdict": FAILED, "broken": [failure], "speeds": [], "worst_in_band": [], "band": None}


def _keep(folder: Path, scene: Scene, cams: dict[str, Lift], found: dict[str, dict]) -> None:
    assert scene.design is not None, "load_scene(..., need='design') guarantees it"
    for part, contents in (("cams", cams), ("verdicts", found)):
        if contents:
            (folder / part).mkdir(exist_ok=True)
    for name, lift in cams.items():
        write_design(folder / "cams" / f"{name}.json", lift, scene.design.max_lift_mm * MM)
    for name, one in found.items():
        write_json(folder / "verdicts" / f"{name}.json", one)


def _read_verdict(path: Path) -> dict:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(content["verdict"], str) or not isinstance(content["speeds"], list):
            raise ValueError("expected a verdict and its speeds")
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path}: cannot be read as a verdict: {error}; verify the cam again") from error
    return content


def _write(folder: Path, scene: Scene, cams: dict[str, Lift], found: dict[str, dict]) -> None:
    rows = [row for name, lift in cams.items() for row in comparison_rows(scene, name, lift, found[name])]
    like = rows[0] if rows else dict.fromkeys(("cam", "limits", "verdict", "broken"))
    rows += [_failed_row(name, one, like) for name, one in found.items() if name not in cams]
    write_csv(folder / "comparison.csv", {key: [row[key] for row in rows] for key in rows[0]} if rows else {"cam": []})
    shown = {name: lift for name, lift in cams.items() if not name.endswith(NO_JERK)}
    draw(folder, scene, shown, {name: found[name] for name in shown})


def _failed_row(name: str, found: dict, like: dict) -> dict:
    limits = "no-jerk" if name.endswith(NO_JERK) else "all"
    named = {"cam": name, "limits": limits, "verdict": FAILED, "broken": "; ".join(found["broken"])}
    return dict.fromkeys(like) | named


def comparison_rows(scene: Scene, name: str, lift: Lift, found: dict) -> list[dict]:
    """One row per judged speed of a cam, from `found`, its verdict as verification.json has it.

    The speeds are the listed ones and the band's worst ones, ascending. A cam of the literature that breaks the jerk
    limit stands in the table without it, where that limit rejects nothing; a design never does.
    """
    design = scene.design
    assert design is not None, "load_scene(..., need='design') guarantees it"
    low, high = (a / MM * DEG**2 for a in lift.extremes(2))
    jerk = float(np.abs(lift.extremes(3)).max()) / MM * DEG**3
    shape = [word for word in found["broken"] if " at " not in word]
    limits = "no-jerk" if JERK in shape and family_of(name) != DESIGN else "all"
    shape = [word for word in shape if word != JERK or limits == "all"]
    records = {s["speed_rpm"]: s for s in [*(found.get("worst_in_band") or []), *found["speeds"]]}
    rows = []
    for speed in sorted(records):
        s = records[speed]
        here = [word for word in found["broken"] if word.endswith(f" at {speed:g} r/min")]
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
                "bounce_mm": s["bounce_mm"],
                "bounce_low_mm": low_mm,
                "bounce_high_mm": high_mm,
                **{key: s[key] for key in MOTION_COLUMNS},
                "verdict": "rejected" if shape else s["verdict"],
                "broken": "; ".join([*shape, *here]),
            }
        )
    return rows
