"""Which optimiser reaches how much area within one budget of processor time, by which start and which gradients?

    python -m experiments.optimisers [small|full]

Problems times optimisers, three seeds each: on `motori-1` and `kodama` at their listed speeds, a free cam with knots
every 6 deg (drawn about that by the seed). Ascents of the area with penalties by Adam, L-BFGS and plain gradient steps,
projected on the limits on the shape, by exact and (on `motori-1`, first seed) smooth gradients, from the free cams
nearest to a Polydyne and a Multi-Pol and from the linear program's cam; the program alone, camopt's search over its
margins, CMA-ES (Hansen, pycma) and differential evolution (SciPy) over them; the same two on the cam's coefficients,
and SLSQP (SciPy) with exact gradients. These three start from the cam of largest area under the limits on the shape.
Every method's every candidate holds the limits on the shape, one judge decides (event-exact, settled, share of each
limit at most 1), and each has the same budget of processor time, in which its start and compilation do not count; what
they took is told apart. A step under way when the budget ends is finished and not counted. It runs on `camopt.sweep`.
"""

from collections.abc import Iterator
from itertools import product
from pathlib import Path

import numpy as np

from experiments.support.optimiser_runs import METHODS, TRANSFORMATIONS, Problem
from experiments.support.optimisers_figure import figure
from experiments.support.record import RESULTS, run_script, write_result
from experiments.support.sweeping import called

STARTS = ("polydyne", "multi-pol", "program")
SCENES = {"small": ("motori-1",), "full": ("motori-1", "kodama")}
SMOOTH = ("motori-1",)
"""Scenes on which the smooth path is tried, whose steps take a second and more."""
SEEDS = {"small": (0,), "full": (0, 2, 3)}
"""Of which the drawn numbers of knots differ."""
SECONDS = {"small": 0.5, "full": 8.0}
FEW = {("L-BFGS", "exact", "program"), ("program alone", "exact", "shape"), ("CMA-ES, coefficients", "exact", "shape")}
"""What the small size takes: method, path, start."""


def cases(size: str, scene: str, seed: int) -> Iterator[tuple[str, str, str]]:
    """Method, path and start."""
    ascents = [(name, path, start) for path in ("exact", "smooth") for name in TRANSFORMATIONS for start in STARTS]
    for name, path, start in [*ascents, *((name, "exact", "shape") for name in METHODS)]:
        if (size == "small" and (name, path, start) not in FEW) or (path == "smooth" and (seed or scene not in SMOOTH)):
            continue
        yield name, path, start


def tasks(size: str) -> Iterator[dict]:
    """The arguments of every run."""
    for seed, scene in product(SEEDS[size], SCENES[size]):
        for method, path, start in cases(size, scene, seed):
            given = {"scene": scene, "method": method, "seed": seed, "path": path, "start": start}
            yield given | {"seconds": SECONDS[size]}


def name_of(row: dict) -> str:
    """What a row's method is called."""
    if row["method"] in TRANSFORMATIONS:
        return f"{row['method']}, {row['path']} gradients, from {row['start']}"
    return row["method"]


def grouped(rows: list[dict]) -> dict[str, dict[str, list[dict]]]:
    """The rows of all seeds by scene and method."""
    found: dict[str, dict[str, list[dict]]] = {}
    for row in rows:
        found.setdefault(row["scene"], {}).setdefault(name_of(row), []).append(row)
    return found


def gains(rows: list[dict]) -> list[dict]:
    """The rows with `gain`, their area beyond that of the linear program's cam on the same knots, and `gains`, the same
    for their stairs."""
    of = {(scene, seed): program_area(scene, seed) for scene, seed in {(row["scene"], row["seed"]) for row in rows}}
    found = []
    for row in rows:
        base, area = of[row["scene"], row["seed"]], row["area_ratio"]
        stairs = [[at, one - base] for at, one in row["stairs"]]
        found.append(row | {"gain": None if area is None else area - base, "gains": stairs})
    return found


def program_area(scene: str, seed: int) -> float:
    """Area ratio of the linear program's cam without margins, which the judge need not confirm."""
    problem = Problem(scene, seed, 0.0)
    return problem.area(problem.start("program"))


def table(found: dict[str, dict[str, list[dict]]]) -> str:
    """In Markdown by method and scene: area ratio (median of the seeds), its gain over the program's cam (least to
    largest), how many seeds reach a confirmed cam, and the second of the last gain (median)."""
    names = list(dict.fromkeys(name for methods in found.values() for name in methods))
    lines = [f"| method | {' | '.join(found)} |", "|---" * (len(found) + 1) + "|"]
    lines += [f"| {name} | {' | '.join(cell(found[scene].get(name, [])) for scene in found)} |" for name in names]
    return "\n".join(lines)


def cell(rows: list[dict]) -> str:
    """One cell of the table."""
    areas = [row["area_ratio"] for row in rows if row["area_ratio"] is not None]
    if not rows:
        return "not tried"
    if not areas:
        return "none confirmed"
    seconds = np.median([row["stairs"][-1][0] for row in rows if row["stairs"]])
    over = sorted({f"{row['gain']:+.4f}" for row in rows if row["gain"] is not None}, key=float)
    some = f", {len(areas)} of {len(rows)} seeds" if len(areas) < len(rows) else ""
    return f"{np.median(areas):.4f} ({' to '.join(dict.fromkeys((over[0], over[-1])))}){some}, {seconds:.1f} s"


def main(size: str, folder: Path = RESULTS, store: Path | None = None) -> dict:
    """Sweeps, prints the table, and writes `optimisers.json` and its figure."""
    runs = [
        {key: value for key, value in row.items() if key != "seconds"}
        for row in called("experiments.support.optimiser_runs:run", tasks(size), size, store)
    ]
    rows = gains(runs)
    content = {"budget_s": SECONDS[size], "processor_s": sum(row["processor_s"] for row in rows), "runs": rows}
    print(table(grouped(rows)))
    write_result("optimisers", size, content, {"area": figure(grouped(rows), SECONDS[size])}, folder)
    return content


if __name__ == "__main__":
    run_script(main, __doc__)
