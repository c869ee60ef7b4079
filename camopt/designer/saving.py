"""An edited scene and its cam as files that the command line reads: a scene file, or a run folder with a report."""

import platform
import re
import time
from importlib.metadata import version
from pathlib import Path
from typing import Any

from camopt.cam.design_file import as_written, design_record
from camopt.cam.tables.lift_table import write_lift_table
from camopt.designer.session import Edited
from camopt.optimizer.bound.certificate import area_ratio_bound
from camopt.report.page import write_report
from camopt.scene.errors import InputError
from camopt.scene.text_file import excerpt
from camopt.scene.toml_text import scene_toml
from camopt.scene.units import MM
from camopt.storage import run_folder, run_identity, write_json, write_text

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}")
"""What a saved file or folder may be called: nothing that leads out of the folder that the designer was started in."""


def save_scene(folder: Path, name: object, design: Edited) -> Path:
    """Writes the scene to `<name>.toml`; an existing file is refused."""
    path = folder / f"{_named(name)}.toml"
    if path.exists():
        raise InputError(f"{path.name}: exists already: give another name")
    write_text(path, scene_toml(design.scene))
    return path


def save_run(folder: Path, name: object, design: Edited, verification: dict[str, Any] | None) -> Path:
    """Writes scene, cam and lift table into the new run folder `<name>`, with the verdict where there is one, and a
    report of them."""
    scene, cam = design.scene, design.cam
    assert scene.design is not None, "an edited scene has one"
    path, lift = folder / _named(name), as_written(cam.lift)
    with run_folder(path, run_identity("design", scene, program=cam.program)):
        bound = float(area_ratio_bound(scene.design).bound)
        record = design_record(
            cam.lift,
            scene.design.max_lift_mm * MM,
            area_ratio_bound=bound,
            area_gap_percent=100 * (bound - cam.area_ratio) / bound,
            area_ratio_no_jump=cam.area_ratio if cam.margin_price is not None else None,
            gradient_gain=0.0,
            limit_worth=cam.worth,
        )
        write_text(path / "scene.toml", scene_toml(scene))
        write_json(path / "design.json", record)
        write_lift_table(path / "lift.csv", lift)
        if verification is not None:
            write_json(path / "verification.json", verification)
        content = {
            "versions": {"camopt": version("camopt"), "python": platform.python_version()},
            "settings": {"command": "design", "program": cam.program},
            "finished_utc": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        }
        write_json(path / "provenance.json", content)
        write_report(path)
    return path


def _named(name: object) -> str:
    if not isinstance(name, str) or not NAME.fullmatch(name):
        raise InputError(
            f"name {excerpt(str(name))}: expected letters, digits, - and _, at most 64 of them, a letter or digit first"
        )
    return name
