"""Can Runge-Kutta-Gill and the transition matrix method differ by up to 0.3 mm on one model, as Table 5 of Kodama et
al. states?

The bounce of the three cams on `kodama` is computed by Runge-Kutta-Gill and the transition matrix method with steps of
the paper's kind and with fine ones, with this project's criterion of separation (force) and the paper's (displacement).
It is compared with event-exact as the reference, with its range over revolutions 3 to 8 and over lifts changed by 1e-9
mm, and with the printed numbers. Train and cams are assumed and were fitted to those numbers together: agreement with
them proves nothing.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from camopt.cam.families.multi_pol import multi_pol
from camopt.cam.families.new_design import new_design
from camopt.cam.families.polydyne import polydyne
from camopt.cam.lift import Lift
from camopt.exact import prepare as event
from camopt.measure.metrics import measure
from camopt.plots import last_revolution, valve_motion
from camopt.scene import MotionRefused, Scene, Train, build_train, load_scene
from camopt.scene.response import Response, Revolve, record_of
from camopt.scene.rest import state_at_rest
from camopt.scene.units import DEG, MM
from camopt.verifier.methods import rkg, tmm
from experiments.support.panels import Panel, panels
from experiments.support.record import RESULTS, run_script, write_result

PAPER = {
    ("polydyne", 5000): (0.00, 0.00), ("polydyne", 6000): (0.22, 0.20),
    ("polydyne", 6500): (0.22, 0.28), ("polydyne", 7000): (0.73, 0.43),
    ("multi-pol", 5000): (0.00, 0.00), ("multi-pol", 6000): (0.20, 0.29),
    ("multi-pol", 6500): (0.58, 0.41), ("multi-pol", 7000): (0.57, 0.43),
    ("new-design", 5000): (0.00, 0.00), ("new-design", 6000): (0.21, 0.19),
    ("new-design", 6500): (0.39, 0.23), ("new-design", 7000): (0.53, 0.30),
}  # fmt: skip
"""Bounce [mm] by Runge-Kutta-Gill and by the transition matrix method, as printed."""
STEPS = {"small": (1440, 11520), "full": (720, 1080, 1200, 1440, 2880, 5760, 11520, 46080)}
"""Steps per revolution. The paper gives none; 1440 is a quarter of a degree; the printed tmm is unstable below 1200."""
DRAWS = {"small": 2, "full": 16}
SPEEDS = {"small": (6500,), "full": (5000, 6000, 6500, 7000)}
METHODS = {"rkg": rkg.prepare, "tmm": tmm.prepare}
CRITERIA = ("force", "displacement")
REVOLUTIONS = 9
"""Number of revolutions from rest; the last one only completes the window of the eighth."""
LIFT_CHANGE_MM = 1e-9


def main(size: str, folder=RESULTS) -> dict:
    """The table, the distances between the methods by step, and (full) figures."""
    scene = load_scene("kodama")
    lifts = cams(scene)
    cases = [(c, s) for c, s in PAPER if s in SPEEDS[size]]
    seeds = np.random.SeedSequence(5).spawn(len(cases))
    rows = in_threads(partial(_row, scene, lifts, size), [(*c, seed) for c, seed in zip(cases, seeds, strict=True)])
    content = {
        "cams": {name: lift.parameters for name, lift in lifts.items()},
        "table": rows,
        "distance_mm": [_distance(rows, c, steps) for c in CRITERIA for steps in STEPS[size]],
        "paper_distance_mm": {
            str(s): _rms([r["paper"]["rkg"] - r["paper"]["tmm"] for r in rows if r["speed_rpm"] == s])
            for s in SPEEDS[size]
        },
    }
    figures = {}
    if size == "full":
        train, speeds = build_train(scene), SPEEDS[size]
        motions = {
            (name, float(s)): run(train, event(train, lift, scene.cam_speed(s)))
            for name, lift in lifts.items()
            for s in speeds
        }
        ninth = [last_revolution(cam, speed, response) for (cam, speed), response in motions.items()]
        figures["motion"] = valve_motion(ninth, scene.required_design)  # as Figures 5 to 8 and 12 to 15
        shown: dict[tuple[str, float], Response] = {}
        for s in speeds:
            for name, prepare in METHODS.items():
                revolve = prepare(train, lifts["multi-pol"], scene.cam_speed(s), 1440)
                shown[f"{name}, 1440 steps", s] = run(train, revolve)
            shown["event-exact", s] = motions["multi-pol", s]
        figures["methods"] = methods_figure(shown, "multi-pol")
        figures["steps"] = steps_figure(content["distance_mm"])
    return write_result("table5", size, content, figures, folder)


def cams(scene: Scene, polydyne_ramp_mm: float = 0.250) -> dict[str, Lift]:
    """The three cams of the reproduction, with assumed parameters that were fitted together with the train. The paper's
    Polydyne has another ramp height (0.250 mm instead of 0.265)."""
    exponents, dynamic = (2, 12, 20, 32, 34), (1.02, 9.22 * DEG**2)
    return {
        "polydyne": polydyne(scene, exponents, ramp_height_mm=polydyne_ramp_mm, dynamic=dynamic),
        "multi-pol": multi_pol(scene, (7.5, 11.5, 7.5, 22.7, 22.8), a12=0.0114, j34=-0.00175, j45=-0.00014),
        "new-design": new_design(scene, (15.8, 9.9, 11.0, 35.3), a12=0.0125, j34=0.00044, start_ratio=0.66),
    }


def run(train: Train, revolve: Revolve) -> Response:
    """Nine revolutions of the motion from rest. Raises MotionRefused if the step is above the stability limit."""
    motion = record_of(revolve, state_at_rest(train), REVOLUTIONS)
    if not np.abs(motion.x).max() < 1.0:  # a metre; NaN is caught too
        raise MotionRefused("the step is above the method's stability limit")
    return motion


def bounces(train: Train, revolve: Revolve, lift: Lift) -> np.ndarray:
    """Bounce [mm] of revolutions 1 to 8; NaN where the step is above the stability limit."""
    try:
        return measure(run(train, revolve), lift)["bounce_mm"]
    except MotionRefused:
        return np.full(REVOLUTIONS - 1, np.nan)


def summary(by_revolution: np.ndarray) -> dict[str, float]:
    """Median and range of revolutions 3 to 8, and the second one: the paper's figures show 2 pi to 4 pi."""
    late = by_revolution[2:8]
    return {"median": np.median(late), "low": late.min(), "high": late.max(), "second": by_revolution[1]}


def in_threads(work: Callable, arguments: Iterable[tuple]) -> list:
    """work(*arguments) on two threads, in order; the compiled methods release Python's global lock."""
    with ThreadPoolExecutor(2) as pool:
        return list(pool.map(lambda a: work(*a), arguments))


def _row(scene: Scene, lifts: dict[str, Lift], size: str, cam: str, speed: int, seed: np.random.SeedSequence) -> dict:
    """One line of Table 5: printed numbers, reference and methods [mm]."""
    train, lift, cam_speed = build_train(scene), lifts[cam], scene.cam_speed(speed)
    nearby = [bounces(train, event(train, near, cam_speed), lift) for near in _neighbours(lift, seed, size)]
    medians = [summary(b)["median"] for b in nearby]
    methods = [
        {"method": name, "criterion": criterion, "steps_per_revolution": steps}
        | summary(bounces(train, prepare(train, lift, cam_speed, steps, criterion=criterion), lift))
        for name, prepare in METHODS.items()
        for criterion in CRITERIA
        for steps in STEPS[size]
    ]
    truth = summary(bounces(train, event(train, lift, cam_speed), lift))
    return {
        "cam": cam,
        "speed_rpm": speed,
        "paper": dict(zip(METHODS, PAPER[cam, speed], strict=True)) | {"average": float(np.mean(PAPER[cam, speed]))},
        "event": truth | {"medians_of_changed_lifts": [min(medians), max(medians)]},
        "methods": methods,
    }


def _neighbours(lift: Lift, seed: np.random.SeedSequence, size: str) -> list[Lift]:
    """Lifts scaled by random factors that change the maximum lift by about 1e-9 mm."""
    draws = np.random.default_rng(seed).normal(size=DRAWS[size]) * LIFT_CHANGE_MM * MM / lift.max_lift
    return [replace(lift, coefficients=lift.coefficients * (1 + change)) for change in draws]


def _distance(rows: list[dict], criterion: str, steps: int) -> dict:
    """RMS over the cams, by speed, of the differences of the methods from each other and from the reference [mm].

    The differences are those of the medians of revolutions 3 to 8, and of the second revolution. NaN: a method was
    unstable.
    """
    out: dict = {"criterion": criterion, "steps_per_revolution": steps}
    for speed in dict.fromkeys(row["speed_rpm"] for row in rows):
        here = [row for row in rows if row["speed_rpm"] == speed]
        summaries = {name: [_of(row, name, criterion, steps) for row in here] for name in METHODS}
        median = {name: np.array([m["median"] for m in of]) for name, of in summaries.items()}
        second = {name: np.array([m["second"] for m in of]) for name, of in summaries.items()}
        truth = np.array([row["event"]["median"] for row in here])
        out[str(speed)] = {
            "rkg_to_tmm": _rms(median["rkg"] - median["tmm"]),
            "rkg_to_tmm_second": _rms(second["rkg"] - second["tmm"]),
            "rkg_to_event": _rms(median["rkg"] - truth),
            "tmm_to_event": _rms(median["tmm"] - truth),
        }
    return out


def _of(row: dict, *way) -> dict:
    """The summary in a row of a method, criterion and number of steps."""
    keys = ("method", "criterion", "steps_per_revolution")
    return next(m for m in row["methods"] if tuple(m[key] for key in keys) == way)


def _rms(values) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


Motions = Mapping[tuple[str, float], Response]
"""Motions by (cam or method, speed [r/min])."""


def methods_figure(motions: Motions, title: str) -> Figure:
    """The closing and the contact forces of one cam by several methods, a column per speed."""
    speeds = list(dict.fromkeys(speed for _, speed in motions))
    one = next(iter(motions.values()))
    contacts = [one.train.element_names[e] for e in one.train.cam_side]
    rows: list[list[Panel]] = [[] for _ in range(1 + len(contacts))]
    for i, speed in enumerate(speeds):
        here = [(name, last_revolution(name, speed, r)) for (name, s), r in motions.items() if s == speed]
        head = f"{title}, {speed:g} r/min"
        closing = [(name, m.cam_angle_deg, m.valve_mm) for name, m in here]
        rows[0].append(Panel("valve above\nseat touch [mm]" if i == 0 else "", closing, head, (-0.1, 0.8)))
        for row, contact in zip(rows[1:], contacts, strict=True):
            curves = [(name, m.cam_angle_deg, m.contact_force_N[contact] / 1e3) for name, m in here]
            row.append(Panel(f"{contact}\nforce [kN]" if i == 0 else "", curves))
    return panels(rows, "cam angle [deg]", (55, 140), 13, 2.0, sharey=True)


def steps_figure(distances: Sequence[Mapping]) -> Figure:
    """Differences of the methods from each other and the reference against the steps, a column per criterion."""
    columns = []
    criteria = list(dict.fromkeys(d["criterion"] for d in distances))
    for criterion in criteria:
        here = [d for d in distances if d["criterion"] == criterion]
        steps = np.array([d["steps_per_revolution"] for d in here], dtype=float)
        speeds = [key for key in here[0] if key.isdigit()]
        column = []
        for between, label in (("rkg_to_tmm", "methods apart"), ("rkg_to_event", "Runge-Kutta-Gill\nto truth"),
                               ("tmm_to_event", "transition matrix\nto truth")):  # fmt: skip
            curves = [(f"{s} r/min", np.log2(steps / 1440), np.array([d[s][between] for d in here])) for s in speeds]
            head = f"separation by {criterion}" if not column else ""
            column.append(Panel(f"{label} [mm]", curves, head, (0, 0.15)))
        columns.append(column)
    return panels([*zip(*columns, strict=True)], "halvings of 1440 steps per revolution", width=8.6)


if __name__ == "__main__":
    run_script(main, __doc__)
