"""What does an accurate motion cost by each method?

Error of the valve's lift against time per cam revolution. `kodama` with plain `polydyne` at 7000 r/min, two revolutions
from rest; error: largest difference of the valve's position to event-exact in 45 times smaller steps, at 300 angles per
revolution (tests hold event-exact to a located DOP853 within 1e-6 mm). Time: processor time of one thread, minimum of
repeats in rounds that are spread over the run, because a shared machine is slower for minutes at a time; ratios have a
range over the rounds. Compilation, tables and preparation are apart, as the excess of the first call. In the second
revolution the motion multiplies any error a million times: ratios are those at 1e-6 mm of the first. What fails stays
in the table.

Where `CAMOPT_OLDER_TREE` names the folder of an older checkout, its own `work_precision` runs after this one, and the
time of every method is stored as a ratio to the older one's at the same settings.
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from scipy.integrate import solve_ivp

from camopt.cam.families.polydyne import polydyne
from camopt.exact import prepare
from camopt.plots.style import INK, LIMIT, new_figure, styled
from camopt.scene import build_train, load_scene
from camopt.scene.response import end_state
from camopt.scene.rest import state_at_rest
from camopt.scene.units import MM
from camopt.study.measurements import fastest
from camopt.verifier.methods import METHOD_NAMES, houbolt, rkg, tmm
from experiments.job_time import OLDER_TREE
from experiments.support.dormand_prince import dormand_prince, problem, right_hand_side
from experiments.support.record import RESULTS, run_script, write_result

try:
    from sksundae.cvode import CVODE
except ImportError:
    CVODE = None

TARGET_MM = 1e-6
SPEED_RPM = 7000
SAMPLES = 300
FINE = {"small": 14_400, "full": 64_800}
STEPS = {"small": (1800,), "full": (1800, 7200, 28_800, 115_200)}
TOLERANCES = {"small": (1e-6,), "full": (1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12)}
SLOW_TOLERANCES = {"small": (1e-4,), "full": (1e-6, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12)}
ROUNDS = {"small": 1, "full": 5}
REPEATS = {"small": 1, "full": 3}
SLOW_REPEATS = {"small": 1, "full": 1}


class Case:
    """The scene, cam and speed, the instants compared at and the reference there."""

    def __init__(self, size: str):
        scene = load_scene("kodama")
        self.scene, self.train, self.lift = scene, build_train(scene), polydyne(scene)
        self.cam_speed = scene.cam_speed(SPEED_RPM)
        self.rest = state_at_rest(self.train)
        self.times = np.linspace(0.0, 4 * np.pi / self.cam_speed, 2 * SAMPLES + 1)
        self.arrays = problem(self.train, self.lift, self.cam_speed)
        self.truth = self.states(self.two(prepare(self.train, self.lift, self.cam_speed, FINE[size])))

    def two(self, revolve) -> tuple:
        first = revolve(self.rest)
        return first, revolve(end_state(first))

    def states(self, responses) -> np.ndarray:
        """Valve positions at `times` [m] from two revolutions."""
        angle = np.linspace(-np.pi, np.pi, SAMPLES + 1)
        at = [np.searchsorted(r.angle, angle - 1e-9).clip(max=len(r.angle) - 1) for r in responses]
        x = [r.x[i, self.train.valve] for r, i in zip(responses, at, strict=True)]
        return np.concatenate([x[0], x[1][1:]])

    def ends(self, states) -> np.ndarray:
        """As `states`, of a motion known only at the end of each revolution: the reference elsewhere."""
        valve = self.truth.copy()
        valve[[SAMPLES, 2 * SAMPLES]] = [state[self.train.valve] for state in states]
        return valve

    def errors(self, valve: np.ndarray) -> list[float]:
        """Largest error of each revolution [mm]."""
        error = np.abs(valve - self.truth) / MM
        return [float(error[: SAMPLES + 1].max()), float(error[SAMPLES:].max())]


def measured(case: Case, method: str, setting: str, run: Callable, valve: Callable, repeats: int) -> dict:
    """One row: errors of both revolutions [mm], time per revolution and what the first call took above it [ms]."""
    row = {"method": method, "setting": setting, "error_mm": [None, None], "ms": None, "first_call_ms": None}
    try:
        first, result = fastest(run, 1, time.thread_time, first=False)
        if not getattr(result, "success", True):
            raise RuntimeError(result.message)
        best, result = fastest(run, repeats, time.thread_time, first=False)
    except (ArithmeticError, RuntimeError, ValueError) as failure:
        return {**row, "failure": str(failure)}
    row |= {"ms": 1e3 * best / 2, "first_call_ms": 1e3 * (first - best)}
    return row | {"error_mm": case.errors(valve(result))}


def by_revolution(case: Case, size: str) -> list[dict]:
    """Event-exact and the verifier's methods."""
    rows, most = [], REPEATS[size]
    for steps in (SAMPLES, *STEPS[size]):
        revolve = prepare(case.train, case.lift, case.cam_speed, steps)
        setting = f"{steps} samples"
        rows.append(
            measured(case, METHOD_NAMES["event"], setting, lambda r=revolve: case.two(r), case.states, 10 * most)
        )
    revolve = prepare(case.train, case.lift, case.cam_speed)
    advance, name = revolve.advance, "event-exact, end state"
    two = lambda: ((first := advance(case.rest)), advance(first))  # noqa: E731
    rows.append(measured(case, name, "default step", two, case.ends, 10 * most))
    methods = {
        METHOD_NAMES["rkg"]: rkg.prepare,
        METHOD_NAMES["tmm"]: lambda *a: tmm.prepare(*a, exponential=True),
        METHOD_NAMES["houbolt"]: houbolt.prepare,
    }
    for name, make in methods.items():
        for steps in STEPS[size]:
            revolve = make(case.train, case.lift, case.cam_speed, steps)
            repeats = min(most, max(1, 40_000 // steps))
            rows.append(measured(case, name, f"{steps} steps", lambda r=revolve: case.two(r), case.states, repeats))
    return rows


def adaptive(case: Case, size: str) -> list[dict]:
    """The compiled Dormand-Prince, SciPy's LSODA and DOP853, CVODE Adams: all on one compiled right-hand side."""
    rows, valve = [], case.train.valve
    derivative = np.empty(len(case.rest))
    longest = case.times[-1] / 400  # from rest the step grows without bound: CVODE leaps over the whole event

    def by_return(t, y):
        right_hand_side(t, y, derivative, case.arrays)
        return derivative.copy()

    def in_place(t, y, out):
        right_hand_side(t, np.asarray(y), derivative, case.arrays)
        out[:] = derivative

    for rtol in TOLERANCES[size]:
        rows.append(measured(
            case, "Dormand-Prince, compiled", f"rtol {rtol:g}",
            lambda r=rtol: dormand_prince(case.rest, case.times, r, r * 1e-3, case.arrays),
            lambda out: out[0][:, valve], REPEATS[size],
        ))  # fmt: skip
    for rtol in SLOW_TOLERANCES[size]:
        for name in ("LSODA", "DOP853"):
            rows.append(measured(
                case, f"SciPy {name}", f"rtol {rtol:g}",
                lambda r=rtol, n=name: solve_ivp(
                    by_return, (0.0, case.times[-1]), case.rest, n, case.times, rtol=r, atol=r * 1e-3, max_step=longest
                ),
                lambda out: out.y[valve], SLOW_REPEATS[size],
            ))  # fmt: skip
        if CVODE is not None:
            solver = CVODE(in_place, method="Adams", rtol=rtol, atol=rtol * 1e-3, max_num_steps=10**7, max_step=longest)
            rows.append(measured(
                case, "CVODE Adams", f"rtol {rtol:g}", lambda s=solver: s.solve(case.times, case.rest),
                lambda out: out.y[:, valve], SLOW_REPEATS[size],
            ))  # fmt: skip
    return rows


def fastest_rows(rounds: list[list[dict]]) -> list[dict]:
    """Each row of the rounds with its least time and the first call of the first round, which alone compiles."""
    rows = []
    for same in zip(*rounds, strict=True):
        times = [row["ms"] for row in same if row["ms"] is not None]
        rows.append({**same[0], "ms": min(times, default=None)})
    return rows


def ratios(rows: list[dict]) -> dict[str, dict[str, float] | None]:
    """Time at TARGET_MM of the first revolution over event-exact's, by method: with 300 samples, and to the end state.

    Interpolated on the logarithms between the first setting that gets there and the one before; None where none does.
    The compared methods take the same time for both.
    """
    sampled = next(r["ms"] for r in rows if r["method"] == "event-exact")
    end = next(r["ms"] for r in rows if r["method"] == "event-exact, end state")
    found = {}
    for name in dict.fromkeys(r["method"] for r in rows if not r["method"].startswith("event-exact")):
        points = [(r["error_mm"][0], r["ms"]) for r in rows if r["method"] == name and r["ms"] is not None]
        ms = _time_at(points)
        found[name] = None if ms is None else {"ms": ms, "sampled": ms / sampled, "end_state": ms / end}
    return found


def _time_at(points: list[tuple[float, float]]) -> float | None:
    for i, (error, ms) in enumerate(points):
        if error <= TARGET_MM:
            if i == 0:
                return ms
            (e0, t0), (e1, t1) = np.log(points[i - 1]), np.log((max(error, 1e-15), ms))
            return float(np.exp(t0 + (t1 - t0) * (e0 - np.log(TARGET_MM)) / (e0 - e1)))
    return None


def older_rows(tree: str, size: str) -> list[dict]:
    """The rows of the older tree's own `work_precision`, which it also writes into its results."""
    command = [sys.executable, "-m", "experiments.work_precision", size]
    subprocess.run(command, cwd=tree, env=os.environ | {"PYTHONPATH": tree}, check=True, stdout=subprocess.DEVNULL)
    return json.loads((Path(tree) / "experiments/results/work_precision.json").read_text(encoding="utf-8"))["methods"]


def ratios_to(older: list[dict], rows: list[dict]) -> dict[str, dict[str, float]]:
    """By method: least, median and greatest ratio of the time of a setting to the older tree's time."""
    before = {(row["method"], row["setting"]): row["ms"] for row in older}
    found = {}
    for row in rows:
        if row["ms"] is not None and before.get((row["method"], row["setting"])):
            found.setdefault(row["method"], []).append(row["ms"] / before[row["method"], row["setting"]])
    return {
        name: {"least": min(values), "median": float(np.median(values)), "greatest": max(values)}
        for name, values in found.items()
    }


def band_seconds(case, speeds: int) -> dict:
    """Wall seconds of 8 revolutions at `speeds` speeds from 5000 to 7000 r/min, tables included, on 1 and 2 threads."""
    cam_speeds = [case.scene.cam_speed(s) for s in np.linspace(5000, 7000, speeds)]
    seconds = {}
    for workers in (1, 2):
        train = build_train(case.scene)  # a new train: no tables yet
        begin = time.perf_counter()
        with ThreadPoolExecutor(workers) as pool:
            motions = [prepare(train, case.lift, speed) for speed in cam_speeds]
            list(pool.map(lambda motion: motion.advance(case.rest, 8), motions))
        seconds[f"threads_{workers}_s"] = time.perf_counter() - begin
    return {"speeds": speeds, "revolutions": 8, **seconds}


@styled
def figure(rows: list[dict]) -> Figure:
    """Error of the first revolution against time per revolution, both logarithmic."""
    drawing = new_figure(6.4, 4.6)
    axes = drawing.subplots()
    rows = [r for r in rows if r["method"] != "event-exact, end state"]
    colours = ("#0072B2", "#D55E00", "#009E73", "#B0518E", "#E69F00", "#56B4E9", "#7A5C2E", INK)
    names = dict.fromkeys(r["method"] for r in rows)
    for name, colour, marker in zip(names, colours, "os^vDPX*", strict=False):
        points = [(r["ms"], r["error_mm"][0]) for r in rows if r["method"] == name and r["ms"] is not None]
        axes.plot(*zip(*sorted(points), strict=True), marker=marker, markersize=4.5, color=colour, label=name)
    axes.axhline(TARGET_MM, color=LIMIT, linestyle=(0, (5, 3)), linewidth=0.9)
    axes.set(xscale="log", yscale="log", xlabel="time per cam revolution [ms]", ylabel="error of the valve's lift [mm]")
    drawing.legend(loc="outside upper left", ncols=3)
    return drawing


def main(size: str, folder=RESULTS) -> dict:
    """Measures, prints and writes `work_precision.json` and the figure."""
    case = Case(size)
    rounds = [by_revolution(case, size) + adaptive(case, size) for _ in range(ROUNDS[size])]
    rows = fastest_rows(rounds)
    content = {
        "methods": rows,
        "times_slower_than_event_exact": ratios(rows),
        "times_slower_by_round": [ratios(one) for one in rounds],
        "band": band_seconds(case, 200 if size == "full" else 4),
    }
    if size == "full" and OLDER_TREE in os.environ:
        content["over_older"] = ratios_to(older_rows(os.environ[OLDER_TREE], size), rows)
    if CVODE is None:
        content["missing"] = "CVODE Adams: scikit-sundae is not installed"
    return write_result("work_precision", size, content, {"error": figure(rows)}, folder)


if __name__ == "__main__":
    run_script(main, __doc__)
