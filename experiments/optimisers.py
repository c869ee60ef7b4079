"""How much area does each optimiser reach within the same processor time, from three starts, on four scenes?

There are two scenes with linear force laws, `motori-1` and `kodama`, and two others, `finger-hydraulic` and
`kodama-hertz`, at their listed speeds. The cam is a free cam with knots every 6 deg. The starts are the calmest cam and
the cams within the limits on the shape that are nearest to a plain Multi-Pol (on the first two scenes only) and to a
plain Polydyne (on the first three). These methods have constraints on the contact forces and the gap at the seat along
smoothed, tied paths: ascents of the augmented Lagrangian by Adam and L-BFGS (optax), in the metric of one Gauss-Newton
matrix and without it; SLSQP and trust-constr (SciPy) with the Jacobian of the paths, in the same metric; and camopt's
convex search by rows of the smoothed motion or of the exact response. CMA-ES (Hansen, pycma) uses the evaluated motion
only. IPOPT is not among them: cyipopt must be built from sources with an installed IPOPT, which was not available.
Every evaluated cam keeps the limits on the shape. All cams are evaluated in the same way (event-exact, settled, ratio
to each limit at most 1), and each method has the same budget of processor time, which excludes preparation and
compilation. A step that is running when the budget ends is finished but not counted. Runs without a cam are kept, with
the reason why they ended. An interrupted run resumes.
"""

from collections.abc import Callable
from itertools import product
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from experiments.support.panels import Panel, panels
from experiments.support.record import RESULTS, called, run_script, write_result

METHODS = (
    "Adam",
    "Adam, metric",
    "L-BFGS",
    "L-BFGS, metric",
    "SLSQP",
    "trust-constr",
    "convex search, smooth rows",
    "convex search, exact rows",
    "CMA-ES",
)
SCENES = {"small": ("motori-1",), "full": ("motori-1", "kodama", "finger-hydraulic", "kodama-hertz")}
STARTS = {"small": ("calmest",), "full": ("calmest", "multi-pol", "polydyne")}
LEFT_OUT = {"finger-hydraulic": ("multi-pol",), "kodama-hertz": ("multi-pol", "polydyne")}
"""Starts that are left out on the scenes whose runs take longest."""
TRIED = {"small": ("convex search, exact rows", "CMA-ES"), "full": METHODS}
"""Methods by size; those of the small size compile nothing by JAX."""
SECONDS = {"small": 1.0, "full": 10.0}
NEAR = 0.99
"""Share of a scene's largest area that counts as near it."""
SHOWN = 0.06
"""Height of a panel in area ratio, below the largest one of its scene."""


def tasks(size: str) -> list[dict]:
    """The arguments of every run, one start after the other."""
    cases = [(b, s, m) for b, s, m in product(STARTS[size], SCENES[size], TRIED[size]) if b not in LEFT_OUT.get(s, ())]
    return [{"scene": s, "method": m, "start": b, "seconds": SECONDS[size]} for b, s, m in cases]


def gathered(rows: list[dict], of: Callable[[dict], float | None]) -> dict[str, dict[str, list[float | None]]]:
    """By method and scene a number of the run from each start."""
    by_method: dict[str, dict[str, list[float | None]]] = {}
    for row in rows:
        by_method.setdefault(row["method"], {}).setdefault(row["scene"], []).append(of(row))
    return by_method


def largest(rows: list[dict]) -> dict[str, float]:
    """By scene the largest area ratio of a cam that keeps all limits; zero where there is none."""
    return {row["scene"]: max(r["area_ratio"] or 0.0 for r in rows if r["scene"] == row["scene"]) for row in rows}


def largest_until(stairs: list, time: np.ndarray) -> np.ndarray:
    """The largest area ratio up to each time [s]; minus infinity before the first cam."""
    at, ratios = np.array(stairs, dtype=float).reshape(-1, 2).T
    return np.append(-np.inf, ratios)[np.searchsorted(at, time, side="right")]


def figure(rows: list[dict], budget: float) -> Figure:
    """A panel for each scene: by method the median over the starts (of two the lower) of the largest area so far."""
    time, most, grid = np.geomspace(0.05, budget, 400), largest(rows), []
    for number, (scene, area) in enumerate(most.items()):
        here = [row for row in rows if row["scene"] == scene]
        curves = []
        for method in dict.fromkeys(row["method"] for row in here):
            courses = [largest_until(row["stairs"], time) for row in here if row["method"] == method]
            middle = np.sort(courses, axis=0)[(len(courses) - 1) // 2]
            curves.append((method, time, np.where(np.isfinite(middle), middle, np.nan)))
        if number % 2 == 0:
            grid.append([])
        ylabel = "" if grid[-1] else "area ratio within all limits"
        grid[-1].append(Panel(ylabel, curves, scene, (area - SHOWN, area + 0.05 * SHOWN)))
    return panels(grid, "processor time [s]", (time[0], budget), 9.0, 3.4, scale=("log", "linear"))


def main(size: str = "full", folder: Path = RESULTS) -> dict:
    """Sweeps, prints the areas, and writes `optimisers.json` and its figure."""
    rows = called("experiments.support.optimiser_runs:run", tasks(size), size, folder / "optimisers.sqlite")
    most = largest(rows)

    def seconds(row: dict) -> float | None:
        return next((at for at, area in row["stairs"] if area >= NEAR * most[row["scene"]]), None)

    areas = gathered(rows, lambda row: row["area_ratio"])
    content = {
        "budget_s": SECONDS[size],
        "processor_s": sum(row["processor_s"] for row in rows),
        "starts": STARTS[size],
        "areas": areas,
        "largest": most,
        "seconds_to_near": gathered(rows, seconds),
        "runs": [{key: value for key, value in row.items() if key != "seconds"} for row in rows],
    }
    return write_result("optimisers", size, content, {"area": figure(rows, SECONDS[size])}, folder)


if __name__ == "__main__":
    run_script(main, __doc__)
