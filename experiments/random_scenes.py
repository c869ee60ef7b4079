"""Does any of 2400 scenes drawn across the extremes end in a wrong number without a warning?

2000 of them are linear between contacts, 400 have springs by tables, adjusters, friction or gas force.
Every scene: event-exact at two steps and more, its start disturbed by 1e-9 m to tell chaos from error, and one of the
step-by-step methods in turn, each with its own error estimate, over the first revolution from rest with a Polydyne or
Multi-Pol cam. DOP853 with located switchings decides on the scenes where event-exact's steps are furthest apart and on
whatever looks wrong.
"""

from dataclasses import replace
from functools import cache

import numpy as np

from camopt.cam.families.multi_pol import multi_pol
from camopt.cam.families.polydyne import polydyne
from camopt.cam.lift import Lift
from camopt.scene import InputError, MotionRefused, Scene, Train, build_train, load_scene
from camopt.study.extremes.classification import (
    NOT_CONVERGED,
    RANGE,
    REFUSED,
    WITHIN,
    WRONG,
    doubtful_figure,
    first_answer,
    judge,
    truth,
)
from camopt.study.extremes.extremes import STEP_METHODS
from camopt.verifier.convergence import first_steps
from camopt.verifier.methods import dop853
from camopt.verifier.verdict import event_exact
from experiments.support.drawn_scenes import drawn
from experiments.support.record import RESULTS, run_script, write_result
from experiments.support.sweeping import called

SCENES = {"small": (5, 1), "full": (2000, 400)}
"""Scenes that are linear between contacts, and scenes of real elements."""
DECIDED = {"small": 1, "full": 100}
"""Scenes of either kind on which DOP853 decides."""
DOP853_STEPS = 7200
"""At least; the cube of the step [rad], 7e-10, is the error that DOP853 is permitted."""
SHOWN = {"small": 1, "full": 20}
MOST_DOUBT = 1e12
"""In place of an infinite one."""
REAL = 10_000
"""Numbers from here on stand for trains of real elements."""


def main(size: str, folder=RESULTS) -> dict:
    """Draws, judges, decides, prints and writes `random_scenes.json`."""
    linear, real = SCENES[size]
    content = {**found(range(linear), size), "real": found(range(REAL, REAL + real), size)}
    return write_result("random_scenes", size, content, {}, folder)


def found(numbers: range, size: str) -> dict:
    """What the scenes of these numbers gave, printed too."""
    cams = 3 if size == "full" else 2
    rows = called("experiments.random_scenes:judged", ({"number": n, "cams": cams} for n in numbers), size)
    doubtful = most_doubtful(rows)[: DECIDED[size]]
    suspects = [r for r in rows if r["verdict"] == WRONG and r not in doubtful]
    cases = ({"number": row["number"], "cams": cams} for row in doubtful + suspects)
    decided = called("experiments.random_scenes:against_dop853", cases, size)
    content = counted(rows, decided, SHOWN[size])
    print({k: v for k, v in content.items() if k != "event_exact"})
    return content


def most_doubtful(rows: list[dict]) -> list[dict]:
    """Rows by how far event-exact's steps are apart, the furthest first."""
    return sorted((r for r in rows if r["doubt"] is not None), key=lambda r: -r["doubt"])


def counted(rows: list[dict], decided: list[dict], shown: int) -> dict:
    """How many rows ended in which verdict, and the `shown` ones of which event-exact is least sure."""
    keys = ("number", "scene", "speed_rpm", "doubt")
    return {
        "scenes": len(rows),
        "event_exact": {
            "refused": sum(r["doubt"] is None for r in rows),
            "steps_agree": sum(r["doubt"] is not None and r["doubt"] <= 1.0 for r in rows),
            "worst_doubt": [{k: r[k] for k in keys} for r in most_doubtful(rows)[:shown]],
        },
        "methods": {m: _counts([r for r in rows if r["method"] == m]) for m in STEP_METHODS},
        "decided_by_dop853": _counts(decided),
        "wrong_without_warning": [r for r in rows + decided if r["verdict"] == WRONG],
    }


@cache
def cam(number: int) -> Lift:
    """The cams that take turns; the last is found by a search of seconds."""
    kodama = load_scene("kodama")
    if number == 2:
        return multi_pol(kodama)
    return polydyne(kodama, (2, 4, 26, 30, 36)) if number else polydyne(kodama)


def problem(number: int, cams: int) -> tuple[Scene, float, tuple[Train, Lift, float]]:
    """Scene and speed [r/min], and the train, lift and cam speed [rad/s], of a number, with so many cams in turn."""
    scene, speed = drawn(np.random.default_rng([7, number]), real=number >= REAL)
    return scene, speed, (build_train(scene), cam(number % cams), scene.cam_speed(speed))


def judged(number: int, cams: int) -> dict:
    """One scene: how much event-exact's steps differ, and the verdict on one of the other methods."""
    scene, speed, case = problem(number, cams)
    method = list(STEP_METHODS)[number % len(STEP_METHODS)]
    row = {"number": number, "scene": scene.name, "speed_rpm": speed, "method": method, "doubt": None}
    try:
        true = truth(event_exact, *case)
    except MotionRefused:
        return {**row, "verdict": REFUSED, "error_of": "", "error": None}
    row["doubt"] = min(doubtful_figure(true)[1], MOST_DOUBT)
    try:
        answer = first_answer(STEP_METHODS[method], *case, halvings=3)
    except InputError:  # laws that the method does not carry
        return {**row, "verdict": REFUSED, "error_of": "", "error": None}
    verdict, error_of, error = judge(answer, true)
    return {**row, "verdict": verdict, "error_of": error_of, "error": error}


def against_dop853(number: int, cams: int) -> dict:
    """Verdict on event-exact by DOP853; event-exact counts as converged where its own steps agree."""
    scene, speed, case = problem(number, cams)
    try:
        true = truth(event_exact, *case)
        other = first_answer(dop853.prepare, *case, halvings=0, steps=max(DOP853_STEPS, first_steps(case[0], case[2])))
    except MotionRefused as refusal:
        return {"verdict": REFUSED, "reason": str(refusal)}
    if other.state is None:
        return {"verdict": REFUSED, "reason": "DOP853 does not follow the motion"}
    # what event-exact says of itself, against DOP853's figures
    verdict, error_of, error = judge(replace(other, converged=true.answer.converged, error=true.answer.error), true)
    return {"verdict": verdict, "scene": scene.name, "speed_rpm": speed, "error_of": error_of, "error": error}


def _counts(rows: list[dict]) -> dict[str, int]:
    return {v: sum(r["verdict"] == v for r in rows) for v in (WITHIN, RANGE, NOT_CONVERGED, REFUSED, WRONG)}


if __name__ == "__main__":
    run_script(main, __doc__)
