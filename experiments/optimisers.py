"""Which optimiser reaches how much area within one budget of processor time, by which start and which gradients?

    python -m experiments.optimisers [small|full]

Problems times optimisers, three seeds each: on `motori-1` and `kodama` at their listed speeds, a free cam with knots
every 6 deg (drawn about that by the seed). Ascents of the area with penalties by Adam, L-BFGS and plain gradient steps,
projected on the limits on the shape, by exact and (on `motori-1`, first seed) smooth gradients, from the free cams
nearest to a Polydyne and a Multi-Pol and from the linear program's cam; the program alone, camopt's search, CMA-ES
(Hansen, pycma) and differential evolution (SciPy) over the program's margins; the same two on the cam's coefficients,
and SLSQP (SciPy) with exact gradients. These three start from the cam of largest area under the limits on the shape.
Every method's every candidate holds the limits on the shape, one judge decides (event-exact, settled, share of each
limit at most 1), and each has the same budget of processor time, in which its start and compilation do not count; what
they took is told apart. A step under way when the budget ends is finished and not counted. It runs on `camopt.sweep`.
"""

from collections.abc import Iterator
from itertools import product
from pathlib import Path

from experiments.support.optimiser_runs import METHODS, TRANSFORMATIONS, Problem
from experiments.support.optimisers_figure import figure
from experiments.support.optimisers_table import grouped, table
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
