"""Do trains with springs by tables, adjusters, friction and gas force get a confirmed cam, and what do gradients add?

Each scene goes through `camopt.optimize` at its listed speeds, accuracy draft, Polydyne and Multi-Pol beside it. Then
the search alone with further seeds, which draw its knots: the area of the no-jump program with its tangents, and what
the gradient stage adds to it through the exact adjoint.
"""

import tempfile
import time
from pathlib import Path

import numpy as np
import pandas as pd
from tqdm import tqdm

from camopt.optimizer.accuracy import accuracy_named
from camopt.optimizer.run import optimize
from camopt.optimizer.search.search import find_cam
from camopt.scene import InputError, Scene, load_scene
from experiments.support.record import RESULTS, run_script, write_result

SCENES = {
    "small": ("exhaust-gas",),
    "full": ("exhaust-gas", "finger-hydraulic", "pushrod-hydraulic", "race-nested", "kodama-hertz"),
}
SEEDS = {"small": 1, "full": 5}
BESIDE = ("polydyne", "multi-pol")


def main(size: str = "full", folder: Path = RESULTS) -> dict:
    """The job and the searches of every scene."""
    content = {}
    for name in SCENES[size]:
        scene = load_scene(name)
        content[name] = {**job(scene), **searches(scene, SEEDS[size])}
        print(name, content[name], flush=True)
    write_result("real_trains", size, content, {}, folder)
    return content


def job(scene: Scene) -> dict:
    """What `camopt optimize SCENE --accuracy draft --speeds nominal` comes to."""
    begin = time.process_time()
    with tempfile.TemporaryDirectory() as work:
        try:
            run = optimize(scene, "nominal", "draft", out=Path(work) / "run")
        except InputError as error:
            return {"verdict": None, "says": str(error)}
        table = pd.read_csv(run.folder / "comparison.csv")
    rows = table[(table.limits == "all") & table.cam.isin(BESIDE)].groupby("cam")
    return {
        "verdict": run.verdict.verdict,
        "broken": list(run.verdict.broken),
        "bound": run.record["area_ratio_bound"],
        "area_ratio": run.record["area_ratio"],
        "beside": {
            cam: {"area_ratio": float(found.area_ratio.iloc[0]), "verdicts": sorted(set(found.verdict))}
            for cam, found in rows
        },
        "seconds": time.process_time() - begin,
    }


def searches(scene: Scene, seeds: int) -> dict:
    """The areas of the program's cam and of the gradient stage's, over seeds."""
    program, best = [], []
    for seed in tqdm(range(seeds), desc=scene.name, disable=None):
        search, no_jump = find_cam(scene, "nominal", accuracy_named("draft"), "exact", seed=seed)
        assert search.best is not None, "find_cam raises where it confirms none"
        program.append(no_jump.area_ratio)
        best.append(search.best.area_ratio)
    gain = np.subtract(best, program)
    return {
        "program_area_ratio": program,
        "gradient_area_ratio": best,
        "gain": float(gain.mean()),
        "gain_spread": float(gain.std()),
        "program_spread": float(np.std(program)),
    }


if __name__ == "__main__":
    run_script(main, __doc__)
