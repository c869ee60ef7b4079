"""What does coarse-to-fine save in the optimiser, and does it end in the same design?

The search for a band as it is: a linear program at a few speeds to which only failing ones are added; a judge that
looks at the two most critical speeds first where only the answer counts, then at one in four, at all only for a cam
that holds there, and that settles from the states of the cam before. Beside it the same search with the judge, and with
both, fine from the start. Time is processor time; designs are compared by area, by their largest difference in lift,
and by the verdict of the accuracy's methods.
"""

import time
from dataclasses import replace
from unittest import mock

import numpy as np

from camopt.optimizer.accuracy import ACCURACIES, Accuracy
from camopt.optimizer.candidates import largest_confirmed
from camopt.optimizer.search.judge import Judge, Judged
from camopt.optimizer.search.search import Logbook, find_cam
from camopt.scene import Scene, load_scene
from camopt.scene.units import DEG, UM
from camopt.verifier.accuracy import EFFORTS
from experiments.support.record import RESULTS, run_script, write_result

SCENE = {"small": "motori-1", "full": "kodama"}
EFFORT = {"small": Accuracy(6.0, 2, 9, 4, 0, 0, 2, 0, EFFORTS["draft"], False), "full": ACCURACIES["standard"]}
GRADIENT = {"small": "none", "full": "exact"}
FINE_PROGRAM = 4
"""By what the program's speeds are multiplied where it is fine from the start."""
ANGLES = np.arange(-180.0, 180.0, 0.1) * DEG


def variants(effort: Accuracy) -> dict[str, Accuracy]:
    """The effort as it is and with its coarse parts fine from the start."""
    program = FINE_PROGRAM * (effort.program_speeds - 1) + 1
    return {
        "coarse to fine": effort,
        "every speed judged": replace(effort, judge_stride=1),
        "fine throughout": replace(effort, judge_stride=1, program_speeds=program),
    }


class JudgeAtEverySpeed(Judge):
    """The search's judge without its short answers."""

    def __call__(self, lift, briefly: bool = False) -> Judged:
        return super().__call__(lift)


def measured(scene: Scene, effort: Accuracy, gradient: str) -> tuple[dict, np.ndarray]:
    """One search: its row, and the lift of its cam [m] at ANGLES."""
    judged: list[int] = []
    log = Logbook(show=lambda line: judged.append(line["confirmed"]))
    begin = time.process_time()
    judge = JudgeAtEverySpeed if effort.judge_stride == 1 else Judge
    with mock.patch("camopt.optimizer.search.search.Judge", judge):
        search, _ = find_cam(scene, "band", effort, gradient, log=log)
    seconds = time.process_time() - begin
    chosen = largest_confirmed(scene, search.confirmed, "nominal", effort)
    row = {
        "processor_s": seconds,
        "cams_judged": len(judged),
        "cams_failed": judged.count(False),
        "area_ratio": chosen.cam.area_ratio,
        "verdict": chosen.verdict.verdict,
    }
    return row, np.asarray(chosen.cam.lift(ANGLES))


def main(size: str, folder=RESULTS) -> dict:
    """Searches, prints and writes `coarse_to_fine.json`."""
    scene, rows, lifts = load_scene(SCENE[size]), [], []
    if size == "full":
        find_cam(scene, "nominal", replace(EFFORT["small"], gradient_steps=4), GRADIENT[size])  # compiles
    for name, effort in variants(EFFORT[size]).items():
        row, lift = measured(scene, effort, GRADIENT[size])
        lifts.append(lift)
        rows.append({"search": name, **row, "lift_apart_um": float(np.abs(lift - lifts[0]).max() / UM)})
        print(rows[-1], flush=True)
    content = {"scene": scene.name, "gradient": GRADIENT[size], "rows": rows}
    write_result("coarse_to_fine", size, content, {}, folder)
    return content


if __name__ == "__main__":
    run_script(main, __doc__)
