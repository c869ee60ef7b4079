"""Does camopt's search earn its place? The same program and judge given to the searches one would try instead.

    python -m experiments.search_methods [small|full]

Every method maximises the area of a free cam that the event-exact judge confirms: on `kodama` at its listed speeds and
over its band, and on `kodama` with its spring's coils a quarter heavier and on `pushrod-5mass` over theirs. camopt's
own search against CMA-ES (Hansen, pycma) and differential evolution (SciPy) over three margins of the same linear
program, CMA-ES on the cam's free coefficients, and SLSQP on them with finite differences. Counted: judged cams, and
processor time, until the end and until the best area was first reached. Failures stay in the table.
"""

import time
from collections.abc import Callable
from pathlib import Path

import cma
import numpy as np
from scipy.optimize import differential_evolution, minimize

from camopt.cam.families.free import free_cam
from camopt.optimize.accuracy import ACCURACIES, design_speeds
from camopt.optimize.judge import SHARE, Judge
from camopt.optimize.kinematic import area_ratio_row, kinematic_optimum
from camopt.optimize.no_jump import Margins, NoCamHoldsContact, no_jump_program
from camopt.optimize.search import find_cam
from camopt.scene import build_train, load_scene
from camopt.scene.schema import Scene
from experiments.record import RESULTS, run_script, write_result
from experiments.scenes import heavier_spring

CALLS = {"small": 6, "full": 60}
COEFFICIENT_CALLS = {"small": 8, "full": 600}
WORTH = 0.05
"""Area ratio that a share of a limit above SHARE costs: two hundredths of a limit outweigh what a search gains."""
MOST_OVER = 10.0
FIRST_N, SPREAD_N = 0.0, 20.0
COEFFICIENT_SPREAD = 1e-3
"""CMA-ES's first step on z, relative to the coefficients' size."""


class Given:
    """A scene, the program and judge that every method is given, and what the methods tried."""

    def __init__(self, scene: Scene, speeds: str, knot_deg: float):
        effort = ACCURACIES["standard"]
        self.scene, design = scene, scene.design
        self.cam = free_cam(design, knot_deg)
        listed, judged = design_speeds(scene.operation, speeds, effort)
        self.program = no_jump_program(build_train(scene), design, self.cam, [scene.cam_speed(s) for s in listed])
        self.judge = Judge(scene, judged, effort.judge_stride if speeds == "band" else 1)
        self.limits = self.cam.limits(design)
        self.row, self.constant = area_ratio_row(design, self.cam)
        self.begin()

    def begin(self) -> None:
        """A new method begins."""
        self.tried: list[tuple[float, float]] = []  # seconds, area ratio of a confirmed cam
        self.started = time.process_time()

    def cost(self, area: float, lift, over: float = 0.0) -> float:
        """Minus the area ratio of a cam, and what it uses of limits beyond the share allowed; notes confirmed ones."""
        judged = self.judge(lift)
        over = max(over, float(np.nan_to_num(judged.share.max(), posinf=MOST_OVER)) - SHARE)
        if over <= 0.0:
            self.tried.append((time.process_time() - self.started, area))
        return -area + WORTH * min(max(over, 0.0), MOST_OVER)

    def by_margins(self, margins: np.ndarray) -> float:
        """Cost of the program's cam with three margins [N]."""
        try:
            found = self.program.solve(Margins(*margins))
        except NoCamHoldsContact as short:
            return WORTH * MOST_OVER * (1 + short.shortfall_N / 100)
        return self.cost(found.area_ratio, found.lift)

    def by_coefficients(self, z: np.ndarray) -> float:
        """Cost of a cam by its free coefficients; the limits on its shape count as shares of their own scale."""
        bound = self.limits.bound
        over = float(np.max((self.limits.matrix @ z - bound) / np.abs(bound).max()))
        area = float(self.row @ z + self.constant)
        return self.cost(area, self.cam.lift(z), 100 * over)


def cma_margins(given: Given, calls: int) -> None:
    """CMA-ES over opening, closing and seat margin."""
    options = {"maxfevals": calls, "seed": 1, "verbose": -9}
    cma.fmin2(given.by_margins, [FIRST_N] * 3, SPREAD_N, options)


def evolution_margins(given: Given, calls: int) -> None:
    """Differential evolution over the three margins."""
    population = 15
    differential_evolution(
        given.by_margins, [(-60.0, 60.0)] * 3, popsize=5, maxiter=max(0, calls // population - 1), rng=1, polish=False
    )


def start(given: Given) -> np.ndarray:
    """The free coefficients of largest area under the limits on the shape alone."""
    return kinematic_optimum(given.scene.design, given.cam).z


def cma_coefficients(given: Given, calls: int) -> None:
    """CMA-ES on z from the kinematic optimum."""
    z = start(given)
    scale = COEFFICIENT_SPREAD * np.abs(z).max()
    cma.fmin2(given.by_coefficients, z, scale, {"maxfevals": calls, "seed": 1, "verbose": -9, "CMA_diagonal": True})


def slsqp_coefficients(given: Given, calls: int) -> None:
    """SLSQP on z from the kinematic optimum, the shape's limits as linear constraints, slopes by finite differences."""
    z, limits = start(given), given.limits
    scale = np.abs(z).max()
    steps = max(1, calls // (len(z) + 1))
    minimize(
        lambda u: given.by_coefficients(u * scale), z / scale, method="SLSQP",
        constraints={"type": "ineq", "fun": lambda u: limits.bound - limits.matrix @ (u * scale),
                     "jac": lambda u: -limits.matrix * scale},
        options={"maxiter": steps, "eps": 1e-6},
    )  # fmt: skip


def row(given: Given, method: str, run: Callable[[Given], None]) -> dict:
    """What a method reached: the best confirmed area, when, and after how many judged cams."""
    given.begin()
    before = given.judge.calls
    run(given)
    total = time.process_time() - given.started
    best = max((area for _, area in given.tried), default=None)
    first = next((s for s, area in given.tried if area == best), None)
    return {"method": method, "area_ratio": best, "judged": given.judge.calls - before,
            "seconds": total, "seconds_to_best": first}  # fmt: skip


def own(scene: Scene, speeds: str, gradient: str) -> dict:
    """camopt's search."""
    seconds, best = [], []

    def show(line: dict) -> None:
        seconds.append(time.process_time() - started)
        best.append(line["best_area_ratio"])

    started = time.process_time()
    search, _ = find_cam(scene, speeds, ACCURACIES["standard"], gradient, show=show)
    area = search.best.area_ratio
    return {"method": f"camopt, gradient {gradient}", "area_ratio": area, "judged": search.judge.calls,
            "seconds": time.process_time() - started, "seconds_to_best": seconds[best.index(area)]}  # fmt: skip


def main(size: str = "full", folder: Path = RESULTS) -> dict:
    """Runs every method and writes search_methods.json into `folder`."""
    kodama, few = load_scene("kodama"), CALLS[size]
    content = {"kodama nominal": [own(kodama, "nominal", "none")]}
    given, rows = Given(kodama, "nominal", ACCURACIES["standard"].knot_deg), content["kodama nominal"]
    rows.append(row(given, "CMA-ES on margins", lambda g: cma_margins(g, 3 * few)))
    rows.append(row(given, "differential evolution on margins", lambda g: evolution_margins(g, 3 * few)))
    many = COEFFICIENT_CALLS[size]
    rows.append(row(given, "CMA-ES on coefficients", lambda g: cma_coefficients(g, many)))
    rows.append(row(given, "SLSQP on coefficients, finite differences", lambda g: slsqp_coefficients(g, many)))
    if size == "full":
        scenes = (kodama, heavier_spring(kodama), load_scene("pushrod-5mass"))
        for scene in scenes:
            given = Given(scene, "band", ACCURACIES["standard"].knot_deg)
            content[f"{scene.name} band"] = [
                own(scene, "band", "none"),
                own(scene, "band", "smooth"),
                own(scene, "band", "exact"),
                row(given, "CMA-ES on margins", lambda g: cma_margins(g, few)),
            ]
    for name, found in content.items():
        print(name)
        for r in found:
            area = "none confirmed" if r["area_ratio"] is None else f"{r['area_ratio']:.5f}"
            print(f"  {r['method']:<44} {area:<15} {r['judged']:5d} judged, {r['seconds']:7.1f} s, best after "
                  f"{r['seconds_to_best'] or float('nan'):7.1f} s")  # fmt: skip
    write_result("search_methods", size, content, {}, folder)
    return content


if __name__ == "__main__":
    run_script(main, __doc__)
