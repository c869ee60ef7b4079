"""Does the search converge to the same cam from every start, with either source of its constraint rows?

The search runs on every built-in scene with a design, over its band at the accuracy of a job: from the calmest cam,
from the literature's plain cams, and from random free cams within the limits on the shape, with constraint rows of the
smoothed motion by JAX and with those of the closed periodic response. The result of each search is the largest cam that
the full verdict confirms, with the numbers of rounds and Jacobians and the processor time. The areas are compared with
those of the job before its search used paths (commit 066e876). First-order methods from the calmest cam are compared by
`experiments.optimisers`. An interrupted run resumes.
"""

import time
from itertools import product
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import camopt
from camopt.cam.lift import Lift
from camopt.optimizer.accuracy import ACCURACIES, Accuracy
from camopt.optimizer.ascent.projection import ShapeLimits
from camopt.optimizer.candidates import largest_confirmed
from camopt.optimizer.program.program_cam import program_cam
from camopt.optimizer.search.region import largest_acceleration
from camopt.optimizer.search.search import find_cam
from camopt.scene import InputError, Scene, load_scene
from experiments.support.panels import POINTS, Panel, panels
from experiments.support.record import RESULTS, called, run_script, write_result

BEFORE = {
    "kodama": 0.5626,
    "motori-1": 0.5750,
    "exhaust-gas": 0.5821,
    "finger-hydraulic": 0.6102,
    "kodama-hertz": 0.5597,
    "pushrod-hydraulic": 0.5999,
    "race-nested": 0.6146,
    "pushrod-5mass": None,
}
"""Area ratio of the default job at commit 066e876; None where it was not kept."""
SCENES = {"small": ("motori-1",), "full": tuple(BEFORE)}
FAMILIES = {"Polydyne": camopt.polydyne, "Multi-Pol": camopt.multi_pol, "New Design": camopt.new_design}
RANDOM = {"random 1": 1, "random 2": 2}
"""Seeds of the random cams."""
STARTS = {"small": ("calmest", "Polydyne", "random 1"), "full": ("calmest", *FAMILIES, *RANDOM)}
SOURCES = {"small": ("exact",), "full": ("smooth", "exact")}
SPEEDS = {"small": "nominal", "full": "band"}
ACCURACY = {"small": "draft", "full": "standard"}
DRAWN, DRAWN_STARTS = "kodama", ("calmest", "Polydyne", "Multi-Pol", "random 1")
"""Scene and starts of the figure."""


def main(size: str = "full", folder: Path = RESULTS) -> dict:
    """Searches from every start, prints and writes starts.json and its figure into `folder`."""
    names = SCENES[size]
    cases = [
        {"scene": s, "start": b, "gradient": g, "size": size} for g, s, b in product(SOURCES[size], names, STARTS[size])
    ]
    rows = called("experiments.starts:searched", cases, size, folder / "starts.sqlite")
    by_scene = {s: summary(s, rows) for s in names}
    content = {"accuracy": ACCURACY[size], "speeds": SPEEDS[size], "scenes": by_scene, "rows": rows}
    drawn = {"kodama": figure(rows)} if DRAWN in names else {}
    return write_result("starts", size, content, drawn, folder)


def searched(scene: str, start: str, gradient: str, size: str = "small") -> dict:
    """One search from a start, and the largest of its cams that the full verdict confirms, or why there is none."""
    loaded, lines, speeds, effort = load_scene(scene), [], SPEEDS[size], ACCURACIES[ACCURACY[size]]
    try:
        search = find_cam(loaded, speeds, effort, gradient, show=lines.append, start=start_cam(loaded, start, effort))
        begin = time.process_time()
        chosen = largest_confirmed(loaded, search.confirmed, speeds, effort)
    except InputError as error:
        return {"area_ratio": None, "verdict": None, "why": str(error)}
    return {
        "area_ratio": chosen.cam.area_ratio,
        "verdict": chosen.verdict.verdict,
        "refused": [cam.area_ratio for cam, _ in chosen.refused],
        "rounds": search.steps,
        "jacobians": search.source.jacobians,
        "search_s": search.clock.spent_s("search"),
        "verdict_s": time.process_time() - begin,
        "course": [line["area_ratio"] for line in lines],
    }


def start_cam(scene: Scene, name: str, effort: Accuracy) -> Lift | None:
    """The start of a search; None for the calmest cam, from which it starts by default."""
    if name == "calmest":
        return None
    return random_cam(scene, RANDOM[name], effort) if name in RANDOM else FAMILIES[name](scene)


def random_cam(scene: Scene, seed: int, effort: Accuracy) -> Lift:
    """The free cam within the limits on the shape that is nearest to random coefficients. These are normal; their
    standard deviation is the largest acceleration that the scene allows."""
    design = scene.required_design
    cam = program_cam(design, effort.knot_deg)
    drawn = np.random.default_rng(seed).normal(0.0, largest_acceleration(design), cam.Z.shape[1])
    return cam.lift(ShapeLimits(cam, design).nearest(drawn))


def summary(scene: str, rows: list[dict]) -> dict:
    """By source the least and the largest confirmed area ratio, the numbers of searches and of confirmed ones, and the
    medians of their rounds, Jacobians and processor times [s]. The first smooth search in a process compiles."""
    by_source: dict = {"before": BEFORE[scene]}
    for source in dict.fromkeys(row["gradient"] for row in rows):
        tried = [row for row in rows if (row["scene"], row["gradient"]) == (scene, source)]
        held = [row for row in tried if row["verdict"] == "confirmed"]
        areas = [row["area_ratio"] for row in held]
        by_source[source] = {"tried": len(tried), "confirmed": len(held)} | {
            "least": min(areas, default=None),
            "largest": max(areas, default=None),
            "rounds": median([row["rounds"] for row in held]),
            "jacobians": median([row["jacobians"] for row in held]),
            "seconds": median([row["search_s"] for row in held]),
        }
    return by_source


def median(values: list[float]) -> float | None:
    """The median; None of an empty list."""
    return float(np.median(values)) if values else None


def figure(rows: list[dict]) -> Figure:
    """Area ratio of the cam of each round, by start and source, and the confirmed cam at the end."""
    shown = [r for r in rows if r["scene"] == DRAWN and r["start"] in DRAWN_STARTS and r["area_ratio"] is not None]
    curves: list = [(f"from {r['start']}, {r['gradient']}", range(1, r["rounds"] + 1), r["course"]) for r in shown]
    curves.append(("confirmed", [r["rounds"] for r in shown], [r["area_ratio"] for r in shown]))
    curves.append(("before", [1, max(r["rounds"] for r in shown)], [BEFORE[DRAWN]] * 2))
    areas = np.concatenate([r["course"] for r in shown])
    panel = Panel("area ratio", curves, f"{DRAWN}: the cam of each round", (areas.min() - 0.01, areas.max() + 0.01))
    look = {"confirmed": POINTS, "before": {"linestyle": ":"}}
    return panels([[panel]], "round", width=6.4, row_height=3.0, look=look)


if __name__ == "__main__":
    run_script(main, __doc__)
