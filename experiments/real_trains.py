"""Does the design job find a confirmed cam for trains with spring tables, adjusters, friction and gas force?

One of the trains has Hertz contacts. For each scene `camopt.optimize` runs at the listed speeds and accuracy draft,
verdict included. The plain Polydyne and Multi-Pol are evaluated for comparison, as in the search.
"""

import tempfile
import time
from pathlib import Path

from camopt.optimizer.baselines.comparison import plain_baselines
from camopt.optimizer.run import optimize
from camopt.optimizer.search.judge import Judge
from camopt.scene import InputError, Scene, load_scene
from experiments.support.record import RESULTS, run_script, write_result

SCENES = {
    "small": ("exhaust-gas",),
    "full": ("exhaust-gas", "finger-hydraulic", "kodama-hertz", "pushrod-hydraulic", "race-nested"),
}
GRADIENT = {"small": "exact", "full": "smooth"}
BESIDE = ("polydyne", "multi-pol")


def main(size: str = "full", folder: Path = RESULTS) -> dict:
    """Runs the job of every scene, and evaluates the literature's cams for comparison."""
    content = {}
    for name in SCENES[size]:
        scene = load_scene(name)
        content[name] = {**job(scene, GRADIENT[size]), "beside": beside(scene)}
        print(name, content[name], flush=True)
    return write_result("real_trains", size, content, {}, folder)


def job(scene: Scene, gradient: str) -> dict:
    """Result of `camopt optimize SCENE --accuracy draft --speeds nominal --gradient GRADIENT`."""
    begin = time.process_time()
    with tempfile.TemporaryDirectory() as work:
        try:
            run = optimize(scene, "nominal", "draft", gradient, out=Path(work) / "run", compare=False)
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
    """Area ratio and largest ratio to a limit of the literature's plain cams; a sentence where there is no cam."""
    judge, cams = Judge(scene, scene.required_operation.speeds_rpm), {}
    for name, cam in plain_baselines(scene).items():
        if name in BESIDE:
            cams[name] = cam
        if name in BESIDE and not isinstance(cam, str):
            share = float(judge(cam).share.max())
            ratio = cam.area_ratio_in(scene.required_design)
            cams[name] = {"area_ratio": ratio, "used_part_of_a_limit": min(share, 1e6)}
    return cams


if __name__ == "__main__":
    run_script(main, __doc__)
