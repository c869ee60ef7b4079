"""Do trains with springs by tables, adjusters, friction and gas force get a confirmed cam, and what do gradients add?

One train with Hertz contacts is among them. Each scene goes through `camopt.optimize` at its listed speeds, accuracy
draft, to a verdict. Beside it stand the plain Polydyne and Multi-Pol, before the search's own judge. Then the search
alone with further seeds, which draw its knots: the area of the no-jump program with its tangents, and what the gradient
stage adds to it through the exact adjoint.
"""

import tempfile
import time
from pathlib import Path

import numpy as np

from camopt.optimizer.accuracy import accuracy_named
from camopt.optimizer.baselines.comparison import plain_baselines
from camopt.optimizer.run import optimize
from camopt.optimizer.search.judge import Judge
from camopt.optimizer.search.search import find_cam
from camopt.scene import InputError, Scene, load_scene
from experiments.support.record import RESULTS, run_script, write_result
from experiments.support.sweeping import called

SCENES = {
    "small": ("exhaust-gas",),
    "full": ("exhaust-gas", "finger-hydraulic", "kodama-hertz", "pushrod-hydraulic", "race-nested"),
}
SEEDS = {"small": (0,), "full": (0, 2, 3, 4)}
"""Each has other knots; those of 1 are as many as those of 0."""
BESIDE = ("polydyne", "multi-pol")


def main(size: str = "full", folder: Path = RESULTS) -> dict:
    """The job and the searches of every scene."""
    content = {}
    for name in SCENES[size]:
        scene = load_scene(name)
        content[name] = {**job(scene), "beside": beside(scene), **searches(name, SEEDS[size], size)}
        print(name, content[name], flush=True)
    write_result("real_trains", size, content, {}, folder)
    return content


def job(scene: Scene) -> dict:
    """What `camopt optimize SCENE --accuracy draft --speeds nominal` comes to."""
    begin = time.process_time()
    with tempfile.TemporaryDirectory() as work:
        try:
            run = optimize(scene, "nominal", "draft", out=Path(work) / "run", compare=False)
        except InputError as error:
            return {"verdict": None, "says": str(error)}
    return {
        "verdict": run.verdict.verdict,
        "broken": list(run.verdict.broken),
        "bound": run.record["area_ratio_bound"],
        "area_ratio": run.record["area_ratio"],
        "seconds": time.process_time() - begin,
    }


def beside(scene: Scene) -> dict:
    """Area ratio and largest used part of a limit of the literature's plain cams; a sentence where there is none."""
    assert scene.design is not None and scene.operation is not None, "the scenes have both"
    judge, found = Judge(scene, scene.operation.speeds_rpm), {}
    for name, cam in plain_baselines(scene).items():
        if name in BESIDE:
            found[name] = cam
        if name in BESIDE and not isinstance(cam, str):
            share = float(judge(cam).share.max())
            found[name] = {"area_ratio": cam.area_ratio_in(scene.design), "used_part_of_a_limit": min(share, 1e6)}
    return found


def searched(scene: str, seed: int) -> dict:
    """The areas of one search: of the program's cam, and with the gradient stage."""
    search, no_jump = find_cam(load_scene(scene), "nominal", accuracy_named("draft"), "exact", seed=seed)
    assert search.best is not None, "find_cam raises where it confirms none"
    return {"program": no_jump.area_ratio, "best": search.best.area_ratio}


def searches(name: str, seeds: tuple[int, ...], size: str) -> dict:
    """The areas of the program's cam and of the gradient stage's, over seeds."""
    cases = ({"scene": name, "seed": seed} for seed in seeds)
    rows = called("experiments.real_trains:searched", cases, size)
    program, best = ([row[of] for row in rows] for of in ("program", "best"))
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
