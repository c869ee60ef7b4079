"""Does `camopt optimize` end without a cam anywhere where a plain cam of the literature holds?

100 drawn scenes with every element, cams of 1 to 60 mm of lift, soft and stiff contacts, unequal ramps, two-stroke
timing, low and high speeds. In each, every family's largest cam goes through `camopt.verify` at draft, the largest
first, until one is confirmed, but for those with which event-exact breaks a limit tenfold. Then the command
`camopt optimize --accuracy draft --no-compare` runs, and its exit code, its verdict and its area stand beside. A loss
is a scene in which a family's cam is confirmed and the command ends otherwise, or with less area.

It runs on `camopt.sweep`, with a store beside the results, so that a run that was stopped goes on where it was.
"""

import contextlib
import io
import json
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np

import camopt
from camopt.cam.families.registry import FAMILIES
from camopt.cam.lift import Lift
from camopt.cam.read import read_cam
from camopt.cli.parser import main as camopt_command
from camopt.exact import settled_metrics
from camopt.measure.limits import broken_by_shape, motion_limits
from camopt.measure.sweep import at_speeds
from camopt.scene import InputError, MotionRefused, Scene
from camopt.scene.text_file import scene_toml
from experiments.support.drawn_designs import drawn_design
from experiments.support.record import RESULTS, run_script, write_result
from experiments.support.sweeping import called

SCENES = {"small": (87,), "full": tuple(range(100))}
FAR = 10.0
"""Part of a limit beyond which event-exact's settled motion alone says that a family's cam is none."""
SAME_AREA = 1e-9
"""Area ratio by which the delivered cam, read from its file, may differ from the same cam as it was designed."""


def main(size: str, folder: Path = RESULTS) -> dict:
    """Draws, verifies, optimises, counts, prints and writes `never_nothing.json`."""
    store = folder / "never_nothing.sqlite"
    folder.mkdir(parents=True, exist_ok=True)
    cases = ({"number": number} for number in SCENES[size])
    rows = called("experiments.never_nothing:outcome", cases, size, store)
    content = counted(rows) | {"rows": rows}
    for row in content["losses"]:
        print(row)
    print({key: value for key, value in content.items() if key not in ("losses", "rows")})
    return write_result("never_nothing", size, content, {}, folder)


def outcome(number: int) -> dict:
    """The row of a drawn scene: what is known of the families, and what the command ends with."""
    scene = drawn_design(number)
    design, operation = scene.required_design, scene.required_operation
    return {
        "scene": scene.name,
        "masses": len(scene.mass),
        "max_lift_mm": design.max_lift_mm,
        "top_rpm": max(operation.band_rpm),
        "unequal_ramps": design.closing_ramp_height_mm is not None,
        "two_stroke": operation.cam_per_crank == 1.0,
        **best_of_the_families(scene),
        **optimised(scene),
    }


def best_of_the_families(scene: Scene) -> dict:
    """The largest confirmed cam among the families' own, by `camopt.verify`."""
    design, cams, begin = scene.required_design, {}, time.process_time()
    for name in FAMILIES:
        with contextlib.suppress(InputError):  # a family that has no member here
            cams[name] = read_cam(name, scene)
    within = {name: cam for name, cam in cams.items() if not broken_by_shape(cam, design)}
    verdicts, best = {}, None
    for name in sorted(within, key=lambda name: -within[name].area_ratio_in(design)):
        far = largest_share(scene, within[name]) > FAR
        verdicts[name] = "far beyond" if far else camopt.verify(scene, within[name], accuracy="draft").verdict
        if verdicts[name] == "confirmed":
            best = name
            break
    area = within[best].area_ratio_in(design) if best else None
    spent = time.process_time() - begin
    return {"best_family": best, "family_area_ratio": area, "families": verdicts, "families_s": round(spent, 1)}


def largest_share(scene: Scene, cam: Lift) -> float:
    """The largest part of a limit that event-exact's settled motion from rest uses at the listed speeds."""
    design, operation = scene.required_design, scene.required_operation
    try:
        rows = at_speeds(settled_metrics, scene, cam, operation.speeds_rpm)
    except MotionRefused:
        return float("inf")
    limits = motion_limits(design).values()
    return max(float(limit.share(np.array([row[limit.metric] for row in rows])).max()) for limit in limits)


def optimised(scene: Scene) -> dict:
    """Exit code, verdict, family and area of `camopt optimize`; its last line where it found no cam."""
    begin, said = time.process_time(), io.StringIO()
    with tempfile.TemporaryDirectory() as work:
        file, folder = Path(work) / "scene.toml", Path(work) / "run"
        file.write_text(scene_toml(scene), encoding="utf-8")
        words = ["optimize", str(file), "--accuracy", "draft", "--no-compare", "--quiet", "--out", str(folder)]
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            code = camopt_command(words)
        record, verdict = ({}, {}) if not (folder / "design.json").exists() else (
            json.loads((folder / name).read_text(encoding="utf-8")) for name in ("design.json", "verification.json")
        )  # fmt: skip
    return {
        "exit_code": code,
        "verdict": verdict.get("verdict"),
        "delivered_family": record.get("family"),
        "area_ratio": record.get("area_ratio"),
        "bound": record.get("area_ratio_bound"),
        "says": record.get("why_a_family") or ("" if record else said.getvalue().strip().splitlines()[-1]),
        "optimize_s": round(time.process_time() - begin, 1),
    }


def is_loss(row: dict) -> bool:
    """Whether a family's cam is confirmed and the command ends without one, or with a smaller one."""
    if row["best_family"] is None:
        return False
    return row["verdict"] != "confirmed" or row["area_ratio"] < row["family_area_ratio"] - SAME_AREA


def counted(rows: list[dict]) -> dict:
    """How the scenes ended, and those in which something was lost."""
    confirmed = [row for row in rows if row["verdict"] == "confirmed"]
    return {
        "scenes": len(rows),
        "exit_codes": {str(code): count for code, count in sorted(Counter(r["exit_code"] for r in rows).items())},
        "a_family_holds": sum(row["best_family"] is not None for row in rows),
        "confirmed": len(confirmed),
        "by_the_search": sum(row["delivered_family"] == "free" for row in confirmed),
        "by_a_family": sum(row["delivered_family"] != "free" for row in confirmed),
        "of_the_search_alone": sum(row["best_family"] is None for row in confirmed),
        "neither": sum(row["best_family"] is None and row["verdict"] != "confirmed" for row in rows),
        "losses": [row for row in rows if is_loss(row)],
    }


if __name__ == "__main__":
    run_script(main, __doc__)
