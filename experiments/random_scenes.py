"""Does any method give a wrong result without a warning on 2400 random scenes with extreme numbers?

2000 of the scenes are linear between contacts: built-in trains with every number varied, and chains of one to six
masses. 400 have spring tables, adjusters, friction or gas force. Numbers are log-uniform: masses 0.1 g to 1 kg,
contacts and stems 1e6 to 1e10 N/m, damping ratios 1e-4 to 3 or none, gaps 1 um to 1 mm or none, preloads 20 to 2000 N,
300 to 15 000 r/min. Scenes with which the verifier would have to start with more than LARGEST steps per revolution are
drawn again: with twice that number no method would count as converged.

Every scene is computed by event-exact with two or more steps, also from a state disturbed by 1e-9 m to distinguish
chaos from error, and by one of the step-by-step methods in turn, each with its own error estimate, over the first
revolution from rest with a Polydyne or Multi-Pol cam. DOP853 with located switchings decides on the scenes where
event-exact's results with different steps differ most, and where a result appears to be wrong.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import tomli_w

from camopt.cam.families.multi_pol import multi_pol
from camopt.cam.families.polydyne import polydyne
from camopt.cam.lift import Lift
from camopt.scene import InputError, MotionRefused, Scene, Train, build_train, load_scene, parse_scene
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
from camopt.verifier.convergence import FINEST_STEPS, first_steps
from camopt.verifier.methods import dop853
from camopt.verifier.verdict import event_exact
from experiments.support.record import RESULTS, called, run_script, write_result

BASES = ("kodama", "motori-1", "motori-2", "pushrod-5mass")
REAL_BASES = ("exhaust-gas", "finger-hydraulic", "pushrod-hydraulic", "race-nested")
"""Trains with springs by tables, adjusters, friction and forces by the cam angle."""
MASS_KG = 1e-4, 1.0
STIFF_N_PER_M = 1e6, 1e10
SPRING_N_PER_M = 1e4, 1e6
DAMPING_RATIO = 1e-4, 3.0
GAP_MM = 1e-3, 1.0
PRELOAD_N = 20.0, 2000.0
SPEED_RPM = 300.0, 15_000.0
FACTOR = 1e-2, 1e2
"""Range of the factors by which the numbers of a built-in train are multiplied."""
LARGEST = FINEST_STEPS // 8
UNDAMPED = 0.15
NO_GAP = 0.2


def drawn(rng: np.random.Generator, real: bool = False) -> tuple[Scene, float]:
    """A scene that loads, and a crankshaft speed [r/min]; scenes without a state of rest are drawn again.

    If `real`, it is one of REAL_BASES with varied numbers.
    """
    while True:
        data = moved(rng, REAL_BASES) if real else moved(rng) if rng.random() < 0.4 else chain(rng)
        try:
            scene, speed = parse_scene(tomli_w.dumps(data), data["name"]), between(rng, SPEED_RPM)
        except InputError:
            continue
        if first_steps(build_train(scene), scene.cam_speed(speed)) <= LARGEST:
            return scene, speed


def between(rng: np.random.Generator, ends: tuple[float, float]) -> float:
    """A log-uniform random number between two ends."""
    return float(np.exp(rng.uniform(*np.log(ends))))


def damper(rng: np.random.Generator, stiffness: float, mass: float) -> float:
    """Damping [N s/m] of a random damping ratio, or none."""
    return 0.0 if rng.random() < UNDAMPED else 2 * between(rng, DAMPING_RATIO) * float(np.sqrt(stiffness * mass))


def moved(rng: np.random.Generator, bases: tuple[str, ...] = BASES) -> dict:
    """A built-in train with masses, stiffnesses, dampings, gaps, preloads, leakage, slip, and the forces of tables and
    by the cam angle multiplied by random factors."""
    scene = load_scene(str(rng.choice(bases)))
    data = scene.model_dump(exclude_none=True, mode="json")
    preload = between(rng, (0.2, 5.0))
    for mass in data["mass"]:
        mass["mass_kg"] = float(np.clip(mass["mass_kg"] * between(rng, FACTOR), *MASS_KG))
    lightest = min(mass["mass_kg"] for mass in data["mass"])
    for element in data["element"]:
        if element["law"] != "linear" or element["kind"] in ("adjuster", "friction"):
            law_moved(element, rng, preload)
            continue
        stiff = element["stiffness_N_per_m"] > SPRING_N_PER_M[1]
        ends = STIFF_N_PER_M if stiff else SPRING_N_PER_M
        element["stiffness_N_per_m"] = float(np.clip(element["stiffness_N_per_m"] * between(rng, FACTOR), *ends))
        element["damping_N_s_per_m"] = damper(rng, element["stiffness_N_per_m"], lightest)
        element["preload_N"] *= preload
        if element["cam_driven"] or element["gap_mm"] == 0.0:
            continue
        element["gap_mm"] = 0.0 if rng.random() < NO_GAP else between(rng, GAP_MM)
    for force in data["force"]:
        push = between(rng, (0.2, 2.0))
        force["table"] = [(angle, push * value) for angle, value in force["table"]]
    return {**data, "name": f"{scene.name}-moved"}


def law_moved(element: dict, rng: np.random.Generator, preload: float) -> None:
    """Multiplies the numbers of an element whose law is not linear; forces under preload all by the same `preload`."""
    for key, ends in (("stiffness_N_per_m", FACTOR), ("leak_N_s_per_m", FACTOR), ("slip_N", (0.1, 2.0))):
        if element.get(key) is not None:
            element[key] *= between(rng, ends)
    if element["law"] != "linear":
        element["preload_N"] *= preload
        element["damping_N_s_per_m"] *= between(rng, (0.1, 10.0))
    for key, factor in (("stiffness_table", between(rng, (0.3, 3.0))), ("force_table", preload)):
        if element.get(key) is not None:
            element[key] = [(at, factor * value) for at, value in element[key]]


def chain(rng: np.random.Generator) -> dict:
    """Cam, one to six masses joined by springs or contacts, valve spring and seat."""
    n = int(rng.integers(1, 7))
    masses = [{"name": f"m{i}", "mass_kg": between(rng, MASS_KG)} for i in range(n)]
    preload = between(rng, PRELOAD_N)

    def element(name, kind, ends, stiffness, mass, **more) -> dict:
        damping = damper(rng, stiffness, mass)
        return {"name": name, "kind": kind, "between": ends, "stiffness_N_per_m": stiffness,
                "damping_N_s_per_m": damping, **more}  # fmt: skip

    ends, kinds = ["ground", *(m["name"] for m in masses)], ["contact"]
    kinds += [str(rng.choice(["spring", "contact"])) for _ in range(n - 1)]
    gaps = [i for i, kind in enumerate(kinds) if kind == "contact"]
    with_gap = int(rng.choice(gaps))
    elements = []
    for i, kind in enumerate(kinds):
        more = {"cam_driven": i == 0}
        if i == with_gap and rng.random() > NO_GAP:
            more["gap_mm"] = between(rng, GAP_MM)
        if kind == "contact" and i > 0:
            masses[i - 1]["force_N"] = -between(rng, (1.0, preload / 4))
        elements.append(
            element(f"e{i}", kind, ends[i : i + 2], between(rng, STIFF_N_PER_M), masses[i]["mass_kg"], **more)
        )
    valve, mass = ends[-1], masses[-1]["mass_kg"]
    spring = element("spring", "spring", [valve, "ground"], between(rng, SPRING_N_PER_M), mass, preload_N=preload)
    seat = element("seat", "contact", ["ground", valve], between(rng, STIFF_N_PER_M), mass, preload_N=preload)
    operation = {"speeds_rpm": [5000], "band_rpm": [3000, 5000]}
    return {"format": 1, "name": f"chain-{n}", "valve": valve, "seat": "seat", "operation": operation,
            "mass": masses, "element": [*elements, spring, seat]}  # fmt: skip


SCENES = {"small": (5, 1), "full": (2000, 400)}
"""Scenes that are linear between contacts, and scenes of real elements."""
DECIDED = {"small": 1, "full": 100}
"""Number of scenes of each kind that are decided by DOP853."""
DOP853_STEPS = 7200
"""Least number of steps; the cube of the step [rad], 7e-10, is the error allowed to DOP853."""
MOST_DOUBT = 1e12
"""Value in place of an infinite doubt."""
REAL = 10_000
"""First number of the trains with real elements."""


def main(size: str, folder=RESULTS) -> dict:
    """Draws the scenes, classifies the results, prints and writes `random_scenes.json`."""
    linear, real = SCENES[size]
    content = {**results(range(linear), size), "real": results(range(REAL, REAL + real), size)}
    return write_result("random_scenes", size, content, {}, folder)


def results(numbers: range, size: str) -> dict:
    """The counts for the scenes of these numbers."""
    cams = 3 if size == "full" else 2
    rows = called("experiments.random_scenes:judged", ({"number": n, "cams": cams} for n in numbers), size)
    doubtful = most_doubtful(rows)[: DECIDED[size]]
    suspects = [r for r in rows if r["verdict"] == WRONG and r not in doubtful]
    cases = ({"number": row["number"], "cams": cams} for row in doubtful + suspects)
    decided = called("experiments.random_scenes:against_dop853", cases, size)
    return counted(rows, decided)


def most_doubtful(rows: list[dict]) -> list[dict]:
    """Rows in descending order of the difference of event-exact's results with different steps."""
    return sorted((r for r in rows if r["doubt"] is not None), key=lambda r: -r["doubt"])


def counted(rows: list[dict], decided: list[dict]) -> dict:
    """Numbers of rows by verdict, and the rows that are wrong without a warning."""
    return {
        "scenes": len(rows),
        "methods": {m: _counts([r for r in rows if r["method"] == m]) for m in STEP_METHODS},
        "decided_by_dop853": _counts(decided),
        "wrong_without_warning": [r for r in rows + decided if r["verdict"] == WRONG],
    }


@cache
def cam(number: int) -> Lift:
    """The cams, which take turns; the last one needs a search of some seconds."""
    kodama = load_scene("kodama")
    if number == 2:
        return multi_pol(kodama)
    return polydyne(kodama, (2, 4, 26, 30, 36)) if number else polydyne(kodama)


def problem(number: int, cams: int) -> tuple[Scene, float, tuple[Train, Lift, float]]:
    """Scene and speed [r/min], and (train, lift, cam speed [rad/s]), of a number, with `cams` cams in turn."""
    scene, speed = drawn(np.random.default_rng([7, number]), real=number >= REAL)
    return scene, speed, (build_train(scene), cam(number % cams), scene.cam_speed(speed))


def judged(number: int, cams: int) -> dict:
    """One scene: the doubt in event-exact by different steps, and the verdict on one of the other methods."""
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
    except InputError:  # laws that the method does not support
        return {**row, "verdict": REFUSED, "error_of": "", "error": None}
    verdict, error_of, error = judge(answer, true)
    return {**row, "verdict": verdict, "error_of": error_of, "error": error}


def against_dop853(number: int, cams: int) -> dict:
    """Verdict on event-exact by DOP853; event-exact counts as converged where its own steps agree."""
    scene, speed, case = problem(number, cams)
    try:
        true = truth(event_exact, *case)
        steps = max(DOP853_STEPS, first_steps(case[0], case[2]))
        located = first_answer(dop853.prepare, *case, halvings=0, steps=steps)
    except MotionRefused as refusal:
        return {"verdict": REFUSED, "reason": str(refusal)}
    if located.state is None:
        return {"verdict": REFUSED, "reason": "DOP853 could not compute the motion"}
    # event-exact's own error estimate, with DOP853's metrics
    verdict, error_of, error = judge(replace(located, converged=true.answer.converged, error=true.answer.error), true)
    return {"verdict": verdict, "scene": scene.name, "speed_rpm": speed, "error_of": error_of, "error": error}


def _counts(rows: list[dict]) -> dict[str, int]:
    return {v: sum(r["verdict"] == v for r in rows) for v in (WITHIN, RANGE, NOT_CONVERGED, REFUSED, WRONG)}


if __name__ == "__main__":
    run_script(main, __doc__)
