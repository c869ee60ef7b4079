"""Is any cam confirmed that breaks a limit, and how many good ones are refused?

200 cams around the limits of ten drawn valve trains (lightly damped coils, pushrods, unequal ramps, nested springs,
heavier and lighter masses), judged by `camopt.verify` as it stands and by the truth: the event-exact settled motion at
every r/min of the band. A cam is good where bounce, jump and seating velocity hold their limits at all of them; lightly
damped trains can have two settled motions at one speed, so the motion from rest, which the verdict judges, is looked
at too, at a sample of the speeds and wherever the verdict looked.

Cams and verdicts are appended row by row to `near_limit-cams.jsonl` and `near_limit-verdicts.jsonl`, so that a run that
was stopped goes on where it was; remove the latter to judge the same cams again.
"""

import json
import time
from collections import Counter
from itertools import count
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import camopt
from camopt.plots.style import new_figure
from experiments.support.near_limit_cams import PER_LINE, band, lift_of, near_limit_cams
from experiments.support.near_limit_scenes import KINDS, drawn_scene
from experiments.support.near_limit_truth import COLD, from_rest
from experiments.support.record import RESULTS, run_script, write_result

PER_SCENE = 20
MOST_LINES = 60
"""Lines drawn for a scene: one without cams around its limits ends in a sentence instead of a loop without end."""
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
    """Draws, judges, counts and writes `near_limit.json` and its figure."""
    plan = FULL if size == "full" else SMALL
    folder.mkdir(parents=True, exist_ok=True)
    cams = drawn(plan, folder / "near_limit-cams.jsonl")
    rows = judged(plan, cams, folder / "near_limit-verdicts.jsonl")
    return keep(rows, plan, size, folder)


def scene_of(number: int, width_rpm: float | None):
    """The drawn scene; of its band only the upper `width_rpm` where that is given."""
    scene = drawn_scene(number)
    if width_rpm is None:
        return scene
    high = scene.operation.band_rpm[1]
    narrow = scene.operation.model_copy(update={"band_rpm": (high - width_rpm, high)})
    return scene.model_copy(update={"operation": narrow})


def drawn(plan: dict, path: Path) -> list[dict]:
    """Cams with their truth, those of `path` first; new ones are appended to it."""
    rows = read(path)
    for number in plan["scenes"]:
        scene = scene_of(number, plan["width_rpm"])
        have = [row for row in rows if row["scene"] == number]
        for line in count(max((row["line"] for row in have), default=-1) + 1):
            if len(have) >= plan["cams"]:
                break
            if line >= MOST_LINES:
                raise RuntimeError(f"{scene.name}: {line} lines gave {len(have)} cams around its limits")
            rng = np.random.default_rng([SEED, number, line])
            for found in near_limit_cams(scene, rng, min(PER_LINE, plan["cams"] - len(have))):
                row = {"scene": number, "name": scene.name, "cam": len(have), "line": line, "knot_deg": found.knot_deg}
                row |= {"z": found.z.tolist(), "truth": found.truth.as_row(), "cold": cold(scene, found, rng)}
                append(path, row)
                have.append(row)
                rows.append(row)
    return [row for row in rows if row["scene"] in plan["scenes"] and row["cam"] < plan["cams"]]


def cold(scene, found, rng: np.random.Generator) -> dict:
    """The motion from rest at the worst speed and at others, beside the one continued from speed to speed."""
    shares = found.truth.shares
    at = np.unique([int(np.argmax(shares)), *rng.integers(len(shares), size=COLD - 1)])
    rest = from_rest(scene, lift_of(scene, found.knot_deg, found.z), found.truth.speeds_rpm[at])
    return {"share": rest.share, "apart": float(np.max(np.abs(rest.shares - shares[at])))}


def judged(plan: dict, cams: list[dict], path: Path) -> list[dict]:
    """The cams with their verdicts, those of `path` first; new ones are appended to it."""
    known = {(row["scene"], row["cam"]): row for row in read(path)}
    for row in cams:
        if (row["scene"], row["cam"]) in known:
            continue
        scene = scene_of(row["scene"], plan["width_rpm"])
        began = time.process_time()
        lift = lift_of(scene, row["knot_deg"], row["z"])
        verdict = camopt.verify(scene, lift, accuracy=plan["accuracy"])
        new = {"scene": row["scene"], "cam": row["cam"], "verdict": verdict.verdict, "broken": list(verdict.broken)}
        new["seconds"] = round(time.process_time() - began, 2)
        new["rest"] = again_from_rest(scene, lift, verdict)
        append(path, new)
        known[row["scene"], row["cam"]] = new
    return [row | known[row["scene"], row["cam"]] for row in cams]


def again_from_rest(scene, lift, verdict) -> dict:
    """The motion from rest where the verdict looked with all methods, and of a confirmed cam every REST_RPM."""
    speeds = {s.speed_rpm for s in (*verdict.speeds, *verdict.worst_in_band)}
    if verdict.verdict == "confirmed":
        speeds |= set(band(scene, REST_RPM).tolist())
    rest = from_rest(scene, lift, sorted(speeds))
    return {"share": rest.share, "speed_rpm": float(rest.speeds_rpm[np.argmax(rest.shares)])}


def outcome(row: dict) -> str:
    """One of OUTCOMES; the truth is the worse of the continued motion and the one from rest."""
    bad = worst_share(row) > 1.0
    if row["verdict"] == "confirmed":
        return "confirmed-BAD" if bad else "confirmed-good"
    if row["verdict"] == "rejected":
        return "rejected-bad" if bad else "rejected-good"
    return row["verdict"]


def worst_share(row: dict) -> float:
    """The worst figure over its limit that is known of a cam, continued in speed or from rest."""
    return max(row[motion]["share"] for motion in ("truth", "cold", "rest"))


def table(rows: list[dict]) -> dict[str, int]:
    """How often each outcome was met; of the undecided ones also how many cams were good."""
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


def keep(rows: list[dict], plan: dict, size: str, folder: Path = RESULTS) -> dict:
    """Counts, prints and writes."""
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
    for name, of in (*scenes.items(), ("all", content["table"])):
        print(f"{name:<24}", ", ".join(f"{k} {v}" for k, v in of.items()))
    write_result("near_limit", size, content, {"verdicts": figure(rows)} if size == "full" else {}, folder)
    return content


def figure(rows: list[dict]) -> Figure:
    """Every cam by its true worst figure over the limit, scene by scene, in the colour of its verdict."""
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


def read(path: Path) -> list[dict]:
    """Rows of a file of JSON lines; none where there is no file."""
    return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []


def append(path: Path, row: dict) -> None:
    """One more row, written at once."""
    with path.open("a") as out:
        out.write(json.dumps(row) + "\n")


if __name__ == "__main__":
    run_script(main, __doc__)
