"""Does `camopt.verify` confirm any cam that breaks a limit, and how many good cams does it refuse?

200 cams around the limits of ten random valve trains (lightly damped coils, pushrods, unequal ramps, nested springs,
heavier and lighter masses) are verified by `camopt.verify` and compared with the reference: the event-exact settled
motion at every r/min of the band. A cam is good if bounce, jump and seating velocity keep their limits at all of them.
Lightly damped trains can have two settled motions at one speed, so the motion from rest, which the verdict uses, is
computed too, at a sample of the speeds and at all speeds of the verdict.

Both run on `camopt.sweep`, with stores in the folder of the results, so that an interrupted run resumes. The cams are
stored in `near_limit-cams.jsonl`; with that file and without the stores the same cams are verified again.
"""

import json
import time
from collections import Counter
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import camopt
from camopt.plots.style import new_figure
from camopt.storage import write_bytes
from experiments.support.near_limit_cams import COLD, PER_LINE, band, from_rest, lift_of, near_limit_cams
from experiments.support.near_limit_scenes import KINDS, drawn_scene
from experiments.support.record import RESULTS, called, run_script, write_result

PER_SCENE = 20
MOST_LINES = 60
"""Largest number of lines of cams for a scene, after which the search for cams around its limits ends with an error."""
SEED = 2026
REST_RPM = 10.0
SMALL = {"scenes": (4,), "cams": 1, "width_rpm": 20.0, "accuracy": "draft"}
FULL = {"scenes": tuple(range(len(KINDS))), "cams": PER_SCENE, "width_rpm": None, "accuracy": "standard"}
OUTCOMES = (
    "confirmed-good",
    "confirmed-BAD",
    "rejected-bad",
    "rejected-good",
    "sensitive",
    "not converged",
)


def main(size: str, folder: Path = RESULTS) -> dict:
    """Draws the cams, verifies and counts them, and writes `near_limit.json` and its figure."""
    plan = FULL if size == "full" else SMALL
    folder.mkdir(parents=True, exist_ok=True)
    rows = judged(plan, drawn(plan, size, folder), size, folder)
    trains = {KINDS[number]["name"]: scene_of(number, plan["width_rpm"]) for number in plan["scenes"]}
    scenes = {name: table([row for row in rows if row["name"] == name]) for name in trains}
    shown = [{k: v for k, v in row.items() if k != "z"} | {"outcome": outcome(row)} for row in rows]
    content = {
        "table": table(rows),
        "scenes": scenes,
        "bands_rpm": {name: list(scene.operation.band_rpm) for name, scene in trains.items()},
        "speeds_looked_at": sum(len(band(trains[row["name"]])) for row in rows),
        "continued_and_cold_apart": max(row["cold"]["apart"] for row in rows),
        "median_seconds_of_a_verdict": float(np.median([row["seconds"] for row in rows])),
        "rows": shown,
    }
    return write_result("near_limit", size, content, {"verdicts": figure(rows)} if size == "full" else {}, folder)


def scene_of(number: int, width_rpm: float | None):
    """The drawn scene, with the upper `width_rpm` of its band only if that is given."""
    scene = drawn_scene(number)
    if width_rpm is None:
        return scene
    high = scene.operation.band_rpm[1]
    narrow = scene.operation.model_copy(update={"band_rpm": (high - width_rpm, high)})
    return scene.model_copy(update={"operation": narrow})


def drawn(plan: dict, size: str, folder: Path) -> list[dict]:
    """Cams with their reference motions: those of the file in `folder`, or new ones, with which it is written."""
    path, store = folder / "near_limit-cams.jsonl", folder / "near_limit-cams.sqlite"
    if not path.exists():
        cases = [{"number": n, "cams": plan["cams"], "width_rpm": plan["width_rpm"]} for n in plan["scenes"]]
        new = [row for of in called("experiments.near_limit:cams_around", cases, size, store) for row in of["rows"]]
        write_bytes(path, "".join(json.dumps(row) + "\n" for row in new).encode())
    rows = [json.loads(line) for line in path.read_text().splitlines()]
    return [row for row in rows if row["scene"] in plan["scenes"] and row["cam"] < plan["cams"]]


def cams_around(number: int, cams: int, width_rpm: float | None) -> dict:
    """A number of cams around the limits of a drawn scene, with their reference motions."""
    scene, rows = scene_of(number, width_rpm), []
    for line in range(MOST_LINES):
        rng = np.random.default_rng([SEED, number, line])
        for cam in near_limit_cams(scene, rng, min(PER_LINE, cams - len(rows))):
            row = {"scene": number, "name": scene.name, "cam": len(rows), "line": line, "knot_deg": cam.knot_deg}
            rows.append(row | {"z": cam.z.tolist(), "truth": cam.truth.as_row(), "cold": cold(scene, cam, rng)})
        if len(rows) >= cams:
            return {"rows": rows}
    raise RuntimeError(f"{scene.name}: {MOST_LINES} lines gave {len(rows)} cams around its limits")


def cold(scene, cam, rng: np.random.Generator) -> dict:
    """The motion from rest at the worst speed and at others, and its distance from the continued one."""
    shares = cam.truth.shares
    at = np.unique([int(np.argmax(shares)), *rng.integers(len(shares), size=COLD - 1)])
    rest = from_rest(scene, lift_of(scene, cam.knot_deg, cam.z), cam.truth.speeds_rpm[at])
    return {"share": rest.share, "apart": float(np.max(np.abs(rest.shares - shares[at])))}


def judged(plan: dict, cams: list[dict], size: str, folder: Path) -> list[dict]:
    """The cams with their verdicts."""
    of_plan = {key: plan[key] for key in ("width_rpm", "accuracy")}
    cases = [{"number": row["scene"], **{key: row[key] for key in ("knot_deg", "z")}, **of_plan} for row in cams]
    verdicts = called("experiments.near_limit:verdict_of", cases, size, folder / "near_limit-verdicts.sqlite")
    added = ("verdict", "broken", "seconds", "rest")
    return [row | {key: new[key] for key in added} for row, new in zip(cams, verdicts, strict=True)]


def verdict_of(number: int, knot_deg: float, z: list[float], width_rpm: float | None, accuracy: str) -> dict:
    """The verdict of `camopt.verify` on a cam, with the motions from rest."""
    scene = scene_of(number, width_rpm)
    lift, began = lift_of(scene, knot_deg, z), time.process_time()
    verdict = camopt.verify(scene, lift, accuracy=accuracy)
    seconds = round(time.process_time() - began, 2)
    rest = again_from_rest(scene, lift, verdict)
    return {"verdict": verdict.verdict, "broken": list(verdict.broken), "seconds": seconds, "rest": rest}


def again_from_rest(scene, lift, verdict) -> dict:
    """The motion from rest at the speeds of the verdict, and for a confirmed cam also every REST_RPM."""
    speeds = {s.speed_rpm for s in (*verdict.speeds, *verdict.worst_in_band)}
    if verdict.verdict == "confirmed":
        speeds |= set(band(scene, REST_RPM).tolist())
    rest = from_rest(scene, lift, sorted(speeds))
    return {"share": rest.share, "speed_rpm": float(rest.speeds_rpm[np.argmax(rest.shares)])}


def outcome(row: dict) -> str:
    """One of OUTCOMES; the reference is the worse of the continued motion and the one from rest."""
    bad = worst_share(row) > 1.0
    if row["verdict"] == "confirmed":
        return "confirmed-BAD" if bad else "confirmed-good"
    if row["verdict"] == "rejected":
        return "rejected-bad" if bad else "rejected-good"
    return row["verdict"]


def worst_share(row: dict) -> float:
    """The largest known ratio of a metric to its limit of a cam, continued in speed or from rest."""
    return max(row[motion]["share"] for motion in ("truth", "cold", "rest"))


def table(rows: list[dict]) -> dict[str, int]:
    """Number of cams by outcome; also the number of good cams among the undecided ones."""
    counts = Counter(outcome(row) for row in rows)
    undecided = [row for row in rows if row["verdict"] in ("sensitive", "not converged")]
    good = sum(worst_share(row) <= 1.0 for row in rows)
    return {name: counts[name] for name in OUTCOMES} | {
        "cams": len(rows),
        "good": good,
        "good ones refused": good - counts["confirmed-good"],
        "bad from rest only": sum(row["truth"]["share"] <= 1.0 < worst_share(row) for row in rows),
        "good among the undecided": sum(worst_share(row) <= 1.0 for row in undecided),
    }


def figure(rows: list[dict]) -> Figure:
    """Every cam by its true worst metric over the limit, scene by scene, in the colour of its verdict."""
    drawing = new_figure(8.0, 4.6)
    axes, scenes = drawing.subplots(), list(dict.fromkeys(row["name"] for row in rows))
    for verdict, colour in (("confirmed", "C2"), ("rejected", "C3"), ("sensitive", "C1"), ("not converged", "C7")):
        of = [row for row in rows if row["verdict"] == verdict]
        heights = [scenes.index(row["name"]) + 0.25 * (row["cam"] / PER_SCENE - 0.5) for row in of]
        axes.plot([worst_share(row) for row in of], heights, "o", color=colour, markersize=4, label=verdict)
    axes.axvline(1.0, color="black", linewidth=0.8)
    axes.set(xscale="log", xlabel="worst figure at any r/min of the band, over its limit", yticks=range(len(scenes)))
    axes.set_yticklabels(scenes)
    axes.legend()
    return drawing


if __name__ == "__main__":
    run_script(main, __doc__)
