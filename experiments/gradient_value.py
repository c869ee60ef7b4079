"""What do gradients of the dynamics add to the linear program's cam?

    python -m experiments.gradient_value [small|full]

`kodama` at its listed speeds, accuracy draft: the area at equal confirmed limits with `--gradient none`, `smooth` and
`exact`, over ten seeds (which draw the knots); then with few coefficients (knots every 12 deg). The event-exact judge
is the same for all.
"""

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from tqdm import tqdm

from camopt.optimizer.accuracy import ACCURACIES
from camopt.optimizer.search.search import find_cam
from camopt.scene import load_scene
from experiments.support.record import RESULTS, run_script, write_result

PATHS = ("none", "smooth", "exact")
SEEDS = {"small": 1, "full": 10}
FEW_DEG = 12.0
STEPS = {"small": 2, "full": 16}


def areas(scene, effort, path: str, seeds: int) -> dict:
    """Area ratios of a path over seeds, and processor time without the first seed, whose compilation it bears."""
    ratios, seconds = [], []
    for seed in tqdm(range(seeds), desc=f"{path}, knots {effort.knot_deg:g} deg", disable=None):
        started = time.process_time()
        search, _ = find_cam(scene, "nominal", effort, path, seed=seed)
        ratios.append(search.best.area_ratio)
        seconds.append(time.process_time() - started)
    return {"area_ratio": ratios, "mean": float(np.mean(ratios)), "spread": float(np.std(ratios)),
            "seconds": float(np.median(seconds))}  # fmt: skip


def main(size: str = "full", folder: Path = RESULTS) -> dict:
    """Searches, prints the table and writes gradient_value.json into `folder`."""
    scene, content = load_scene("kodama"), {}
    draft = replace(ACCURACIES["draft"], gradient_steps=STEPS[size])
    efforts = {"few coefficients": replace(draft, knot_deg=FEW_DEG)}
    if size == "full":
        efforts = {"draft": draft} | efforts
    for name, effort in efforts.items():
        content[name] = {path: areas(scene, effort, path, SEEDS[size]) for path in PATHS}
        base = content[name]["none"]["area_ratio"]
        for path, found in content[name].items():
            found["gain"] = float(np.mean(np.array(found["area_ratio"]) - base))
            print(f"{name:<18} {path:<7} mean {found['mean']:.5f} spread {found['spread']:.5f} "
                  f"gain {found['gain']:.5f} {found['seconds']:.1f} s", flush=True)  # fmt: skip
    write_result("gradient_value", size, content, {}, folder)
    return content


if __name__ == "__main__":
    run_script(main, __doc__)
