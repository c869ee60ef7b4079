"""What do gradients of the dynamics add to the linear program's cam?

    python -m experiments.gradient_value [small|full]

`kodama` at its listed speeds, accuracy draft: the area at equal confirmed limits with `--gradient none`, `smooth` and
`exact`, over ten seeds (which draw the knots); then with few coefficients (knots every 12 deg). The event-exact judge
is the same for all.
"""

import time
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np

from camopt.optimizer.accuracy import ACCURACIES
from camopt.optimizer.search.search import find_cam
from camopt.scene import load_scene
from experiments.support.record import RESULTS, run_script, write_result
from experiments.support.sweeping import called

PATHS = ("none", "smooth", "exact")
SEEDS = {"small": 1, "full": 10}
FEW_DEG = 12.0
STEPS = {"small": 2, "full": 16}


def searched(path: str, seed: int, gradient_steps: int, knot_deg: float) -> dict:
    """Area ratio of one search, and its processor time; the first one in a process bears the compilation."""
    effort = replace(ACCURACIES["draft"], gradient_steps=gradient_steps, knot_deg=knot_deg)
    started = time.process_time()
    search, _ = find_cam(load_scene("kodama"), "nominal", effort, path, seed=seed)
    assert search.best is not None, "find_cam raises where it confirms none"
    return {"area_ratio": search.best.area_ratio, "seconds": time.process_time() - started}


def areas(rows: list[dict]) -> dict:
    """Area ratios over seeds, and the median of their processor times."""
    ratios = [row["area_ratio"] for row in rows]
    return {"area_ratio": ratios, "mean": float(np.mean(ratios)), "spread": float(np.std(ratios)),
            "seconds": float(np.median([row["seconds"] for row in rows]))}  # fmt: skip


def main(size: str = "full", folder: Path = RESULTS) -> dict:
    """Searches, prints the table and writes gradient_value.json into `folder`."""
    content, knots = {}, {"few coefficients": FEW_DEG}
    if size == "full":
        knots = {"draft": ACCURACIES["draft"].knot_deg} | knots
    given = {"gradient_steps": STEPS[size]}
    cases = [
        {"path": path, "seed": seed, "knot_deg": knot, **given}
        for knot, path, seed in product(knots.values(), PATHS, range(SEEDS[size]))
    ]
    rows = called("experiments.gradient_value:searched", cases, size)
    for name, knot in knots.items():
        content[name] = {
            path: areas([row for row in rows if (row["knot_deg"], row["path"]) == (knot, path)]) for path in PATHS
        }
        base = content[name]["none"]["area_ratio"]
        for path, found in content[name].items():
            found["gain"] = float(np.mean(np.array(found["area_ratio"]) - base))
            print(f"{name:<18} {path:<7} mean {found['mean']:.5f} spread {found['spread']:.5f} "
                  f"gain {found['gain']:.5f} {found['seconds']:.1f} s", flush=True)  # fmt: skip
    write_result("gradient_value", size, content, {}, folder)
    return content


if __name__ == "__main__":
    run_script(main, __doc__)
