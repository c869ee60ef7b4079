"""Parts of `work_precision`: ratios at equal error, where event-exact's time goes, the band, figure."""

import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from matplotlib.figure import Figure
from numba import njit

from camopt.exact import prepare
from camopt.exact.engine import AT_ONCE
from camopt.exact.kernel.advance import advance, apply
from camopt.exact.kernel.switching import first_suspect, next_switch
from camopt.plots.style import INK, LIMIT, new_figure, styled
from camopt.programs import ProgramCompiler
from camopt.scene import build_train
from camopt.study.measurements import fastest

TARGET_MM = 1e-6
FLOOR_MS = 0.040
"""Time of a revolution if nothing but its matrix elements were loaded and its series summed (estimate by hand)."""


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


@njit(nogil=True, pipeline_class=ProgramCompiler)
def _spans(times, tables, slot, y, columns, count, out):
    steps = 0
    for _ in range(times):
        apply(tables.span[slot], y, columns, len(y) + 2 * count * (AT_ONCE + 1), out)
        steps += first_suspect(out, len(y), count, AT_ONCE)
    return steps


@njit(nogil=True, pipeline_class=ProgramCompiler)
def _searches(times, tables, slot, y, columns, out, scratch):
    found = 0.0
    for _ in range(times):
        found += next_switch(tables, slot, y, columns, out, 1.0, 0.0, scratch)[0]
    return found


@njit(nogil=True, pipeline_class=ProgramCompiler)
def _jumps(times, tables, slot, h, columns, y, work):
    for i in range(times):
        advance(tables, slot, h, columns, 0.03 + (i % 60) / 16.0, y.copy(), work)


def parts(case, repeats: int) -> dict:
    """Where event-exact's time goes, first revolution, end state only: counts, unit times and products."""
    run = prepare(case.train, case.lift, case.cam_speed)
    response = run(case.rest)
    stops = np.flatnonzero(np.diff(response.angle) == 0)
    borders = case.lift.borders[1:]
    ends = np.sort(np.concatenate([[0.0], (borders + np.pi) / case.cam_speed, response.time[stops]]))
    spans = int(np.sum(np.diff(ends) // (AT_ONCE * run.step)))
    total = 1e3 * _wall_seconds(lambda: run.advance(case.rest), 20 * repeats)
    unit = _unit_times(run, case, repeats)
    counts = {"span": spans + len(ends) - 1, "jump": len(ends) - 1, "search": len(stops)}
    rows = {k: {"count": n, "each_us": 1e6 * unit[k], "ms": 1e3 * n * unit[k]} for k, n in counts.items()}
    rest = total - sum(row["ms"] for row in rows.values())
    return {**rows, "rest_ms": rest, "total_ms": total, "floor_ms": FLOOR_MS, "switchings": len(stops)}


def _unit_times(run, case, repeats: int) -> dict[str, float]:
    """Seconds of one span, jump and search, on the lift's nose."""
    with run._lent(AT_ONCE) as one:
        tables = one.tables
    n2, q = len(case.rest), case.lift.coefficients.shape[1]
    slot = int(np.argmax(tables.keys[: tables.built[0]]))
    y = np.concatenate([case.rest, np.full(q, 1e-6)])
    count, columns, out = int(tables.count[slot]), len(y), np.zeros(tables.span.shape[2])
    scratch = np.zeros(len(y)), np.zeros(23), np.zeros(17), np.zeros(17)
    work, times = (np.zeros(len(y)), np.zeros(n2 + 2), np.zeros(n2 // 2)), 2000
    calls = {
        "span": lambda: _spans(times, tables, slot, y, columns, count, out),
        "jump": lambda: _jumps(times, tables, slot, run.step, columns, y, work),
    }
    seconds = {name: _wall_seconds(call, 5 * repeats) / times for name, call in calls.items()}
    out[:] = 1.0
    out[len(y)] = -1.0  # one suspect watch
    seconds["search"] = (
        _wall_seconds(lambda: _searches(times, tables, slot, y, columns, out, scratch), 5 * repeats) / times
    )
    return seconds


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


def _wall_seconds(call: Callable, repeats: int) -> float:
    return float(fastest(call, repeats, time.perf_counter)[0])


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
