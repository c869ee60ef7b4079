"""Does camopt's search earn its place? The same program and judge given to the searches one would try instead.

    python -m experiments.search_methods [small|full]

Every method maximises the area of a free cam that the event-exact judge confirms: on `kodama` at its listed speeds and
over its band, and on `kodama` with its spring's coils a quarter heavier and on `pushrod-5mass` over theirs. camopt's
own search against CMA-ES (Hansen, pycma) and differential evolution (SciPy) over three margins of the same linear
program, CMA-ES on the cam's free coefficients, and SLSQP on them with finite differences. CMA-ES over the margins runs
three times: on the program as one would solve it (SciPy, from the same first rows every time), on camopt's, which goes
on from its basis, and with camopt's brief judgements too. Counted: judged cams and processor time; every better cam
with its second; and when each method first has the area of camopt's first confirmed cam and of its last one, beside
camopt. Failures stay in the table.
"""

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cma
import numpy as np
from scipy.optimize import differential_evolution, linprog, minimize
from threadpoolctl import threadpool_limits

from camopt.cam.families.free import free_cam
from camopt.highs import FEASIBILITY
from camopt.optimizer.accuracy import ACCURACIES, Accuracy, design_speeds
from camopt.optimizer.program.force_rows import Margins
from camopt.optimizer.program.kinematic import area_ratio_row, kinematic_optimum
from camopt.optimizer.program.linear_program import ADDED_PER_ROUND
from camopt.optimizer.program.no_jump import NoCamHoldsContact, no_jump_program
from camopt.optimizer.search.judge import USABLE_SHARE, Judge
from camopt.optimizer.search.search import Logbook, find_cam
from camopt.scene import build_train, load_scene
from camopt.scene.schema import Scene
from experiments.support.record import RESULTS, run_script, write_result
from experiments.support.scenes import heavier_spring

CALLS = {"small": 2, "full": 60}
COEFFICIENT_CALLS = {"small": 4, "full": 600}
SCENE = {"small": "motori-1", "full": "kodama"}
EFFORTS = {"small": replace(ACCURACIES["draft"], knot_deg=12.0, margin_draws=4), "full": ACCURACIES["standard"]}
TIGHT = {"primal_feasibility_tolerance": FEASIBILITY, "dual_feasibility_tolerance": 1e-9}
WORTH = 0.05
"""Area ratio that a share above USABLE_SHARE costs: two hundredths of a limit outweigh what a search gains."""
MOST_OVER = 10.0
FIRST_N, SPREAD_N = 0.0, 20.0
ROUNDING = 1e-9
"""Area ratio by which two solvers of one program may differ."""
COEFFICIENT_SPREAD = 1e-3
"""CMA-ES's first step on z, relative to the coefficients' size."""


class Given:
    """A scene, the program and judge that every method is given, and what the methods tried."""

    def __init__(self, scene: Scene, speeds: str, effort: Accuracy):
        self.scene, design = scene, scene.design
        self.cam = free_cam(design, effort.knot_deg)
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

    def cost(self, area: float, lift, over: float = 0.0, briefly: bool = False) -> float:
        """Minus the area ratio of a cam, and what it uses of limits beyond the share allowed; notes confirmed ones."""
        judged = self.judge(lift, briefly)
        over = max(over, float(np.nan_to_num(judged.share.max(), posinf=MOST_OVER)) - USABLE_SHARE)
        if over <= 0.0:
            self.tried.append((time.process_time() - self.started, area))
        return -area + WORTH * min(max(over, 0.0), MOST_OVER)

    def by_margins(self, margins: np.ndarray, cold: bool = False, briefly: bool = False) -> float:
        """Cost of the program's cam with three margins [N]."""
        z = self.cold(Margins(*margins)) if cold else None
        try:
            z = self.program.solve(Margins(*margins)).z if z is None else z
        except NoCamHoldsContact as short:
            return WORTH * MOST_OVER * (1 + short.shortfall_N / 100)
        return self.cost(float(self.row @ z + self.constant), self.cam.lift(z), briefly=briefly)

    def cold(self, margins: Margins) -> np.ndarray | None:
        """The program's answer by SciPy from the first rows on; None where SciPy finds none."""
        rows, working = self.program.rows, self.program.first_working()
        level = self.program.bound(margins.table(len(self.program.blocks))) / rows.norm
        while True:
            answer = linprog(-self.row * rows.column, rows.scaled[working], level[working], bounds=(None, None),
                             method="highs-ds", options=TIGHT)  # fmt: skip
            if answer.status != 0:
                return None
            excess = rows.scaled @ answer.x - level
            excess[working] = 0.0
            broken = np.flatnonzero(excess > FEASIBILITY)
            if len(broken) == 0:
                return answer.x * rows.column
            working = np.union1d(working, broken[np.argsort(excess[broken])[-ADDED_PER_ROUND:]])

    def by_coefficients(self, z: np.ndarray) -> float:
        """Cost of a cam by its free coefficients; the limits on its shape count as shares of their own scale."""
        bound = self.limits.bound
        over = float(np.max((self.limits.matrix @ z - bound) / np.abs(bound).max()))
        area = float(self.row @ z + self.constant)
        return self.cost(area, self.cam.lift(z), 100 * over)


def cma_margins(given: Given, calls: int, cold: bool = False, briefly: bool = False) -> None:
    """CMA-ES over opening, closing and seat margin."""
    options = {"maxfevals": calls, "seed": 1, "verbose": -9}
    cma.fmin2(lambda margins: given.by_margins(margins, cold, briefly), [FIRST_N] * 3, SPREAD_N, options)


def cma_rows(given: Given, calls: int) -> list[dict]:
    """CMA-ES over the margins as one would run it, and with what camopt has."""
    return [
        row(given, "CMA-ES on margins, SciPy's program", lambda g: cma_margins(g, calls, cold=True)),
        row(given, "CMA-ES on margins, camopt's program", lambda g: cma_margins(g, calls)),
        row(given, "CMA-ES on margins, program and brief judge", lambda g: cma_margins(g, calls, briefly=True)),
    ]


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
    """What a method reached and when."""
    given.begin()
    before = given.judge.calls
    run(given)
    return _row(method, given.judge.calls - before, time.process_time() - given.started, given.tried)


def own(scene: Scene, speeds: str, gradient: str, effort: Accuracy) -> dict:
    """camopt's search."""
    confirmed = []

    def show(line: dict) -> None:
        if line["confirmed"]:
            confirmed.append((time.process_time() - started, line["area_ratio"]))

    started = time.process_time()
    search, _ = find_cam(scene, speeds, effort, gradient, log=Logbook(show=show))
    return _row(f"camopt, gradient {gradient}", search.judge.calls, time.process_time() - started, confirmed)


def _row(method: str, judged: int, seconds: float, confirmed: list[tuple[float, float]]) -> dict:
    """One row: the best confirmed area, and every cam better than all before it, [seconds, area ratio]."""
    stairs: list[tuple[float, float]] = []
    for at, area in confirmed:
        if not stairs or area > stairs[-1][1]:
            stairs.append((at, area))
    best = stairs[-1][1] if stairs else None
    return {"method": method, "area_ratio": best, "judged": judged, "seconds": seconds, "stairs": stairs}


def reached(rows: list[dict]) -> None:
    """Adds to every row when it first has the area of the first row's first and last confirmed cam, beside that row;
    and how much longer than the first row it took to its own largest area (None: the first row never has it)."""
    for name, (own_seconds, aim) in zip(("first", "last"), (rows[0]["stairs"][0], rows[0]["stairs"][-1]), strict=True):
        for r in rows:
            at = next((s for s, area in r["stairs"] if area >= aim - ROUNDING), None)
            r[f"seconds_to_{name}"] = at
            r[f"ratio_to_{name}"] = None if at is None else at / own_seconds
    for r in rows:
        at, area = r["stairs"][-1] if r["stairs"] else (None, np.inf)
        own_seconds = next((s for s, had in rows[0]["stairs"] if had >= area - ROUNDING), None)
        r["ratio_to_best"] = None if at is None or own_seconds is None else at / own_seconds


@threadpool_limits.wrap(limits=1, user_api="blas")  # as camopt's search has it: it helps all of them
def main(size: str = "full", folder: Path = RESULTS) -> dict:
    """Runs every method and writes search_methods.json into `folder`."""
    few, many, effort = CALLS[size], COEFFICIENT_CALLS[size], EFFORTS[size]
    kodama = load_scene(SCENE[size])  # or its stand-in
    given = Given(kodama, "nominal", effort)
    given.judge(given.cam.lift(start(given)))  # compiled code is loaded before any clock runs
    content = {f"{kodama.name} nominal": [
        own(kodama, "nominal", "none", effort),
        *cma_rows(given, 3 * few),
        row(given, "differential evolution on margins", lambda g: evolution_margins(g, 3 * few)),
        row(given, "CMA-ES on coefficients", lambda g: cma_coefficients(g, many)),
        row(given, "SLSQP on coefficients, finite differences", lambda g: slsqp_coefficients(g, many)),
    ]}  # fmt: skip
    for scene in (kodama, heavier_spring(kodama), load_scene("pushrod-5mass")) if size == "full" else ():
        gradients = [own(scene, "band", gradient, effort) for gradient in ("none", "smooth", "exact")]
        content[f"{scene.name} band"] = [*gradients, *cma_rows(Given(scene, "band", effort), few)]
    for name, found in content.items():
        reached(found)
        print(name)
        for r in found:
            area = "none confirmed" if r["area_ratio"] is None else f"{r['area_ratio']:.5f}"
            print(f"  {r['method']:<44} {area:<15} {r['judged']:5d} judged, {r['seconds']:7.1f} s", end="")
            for aim in ("first", "last"):
                at, ratio = r[f"seconds_to_{aim}"], r[f"ratio_to_{aim}"]
                print(f", camopt's {aim} " + ("never" if at is None else f"{at:.1f} s ({ratio:.1f})"), end="")
            ratio = r["ratio_to_best"]
            print("" if ratio is None else f", its own best {r['stairs'][-1][0]:.1f} s ({ratio:.1f})")
    write_result("search_methods", size, content, {}, folder)
    return content


if __name__ == "__main__":
    run_script(main, __doc__)
