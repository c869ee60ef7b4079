"""One optimiser at one problem within a budget of processor time: a task of `experiments.optimisers`.

All of them move the same free cam, every cam that is judged holds the limits on the shape, and one judge decides:
event-exact, settled, at the scene's listed speeds. The clock begins when the start is there and what a method needs is
compiled.
"""

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import Any, cast

import cma
import jax
import jax.numpy as jnp
import numpy as np
import optax
from scipy.optimize import BFGS, LinearConstraint, NonlinearConstraint, minimize
from scipy.sparse import csr_array

import camopt
from camopt.optimizer.accuracy import ACCURACIES
from camopt.optimizer.ascent.ascent import AscentState
from camopt.optimizer.ascent.lagrangian import PathLagrangian
from camopt.optimizer.ascent.objective import Objective
from camopt.optimizer.ascent.projection import ShapeLimits
from camopt.optimizer.ascent.variables import FreeVariables, TrainVariables, Variables
from camopt.optimizer.program.kinematic import area_ratio_row
from camopt.optimizer.program.program_cam import program_cam
from camopt.optimizer.search.cams import FOLDER
from camopt.optimizer.search.judge import Judge
from camopt.optimizer.search.region import first_region
from camopt.optimizer.search.search import find_cam
from camopt.scene import load_scene
from camopt.storage.journal import StepFiles

KNOT_DEG = 6.0
CONSTRAINTS = {"contact_force_N": 0.0, "seat_gap_mm": 0.03}
"""Limits along the paths, of every method that sees paths."""
JUDGE_EVERY = 3
"""Steps of an ascent between two cams that are judged."""
SPREAD = 0.2
"""First step of CMA-ES, as a part of the width of the convex search's first box."""
EVERY = 4
"""Steps of the smoothed motion between two angles at which SciPy's methods see a path: a degree."""
RATES = {False: 1e-3, True: 0.05}
"""Of Adam, without and with the metric: the best of a few tried on `kodama` from the calmest cam."""


class Spent(Exception):
    """The budget is spent."""


class Problem:
    """A scene's free cam, the start, and the judge, with every larger cam that holds as (processor second, area)."""

    def __init__(self, scene: str, start: str, seconds: float):
        self.scene, self.seconds = load_scene(scene), seconds
        design, operation = self.scene.required_design, self.scene.required_operation
        self.design, self.speeds_rpm = design, operation.speeds_rpm
        self.cam = program_cam(design, KNOT_DEG)
        self.shape = ShapeLimits(self.cam, design)
        calmest = self.shape.nearest(np.zeros(self.cam.Z.shape[1]))
        self.start = calmest if start == "calmest" else self.shape.nearest_to(camopt.read_cam(start, self.scene))
        self.judge = Judge(self.scene, self.speeds_rpm, workers=1)
        self.judge(self.cam.lift(self.start))  # compiled programs are loaded before the clock begins
        self.began = time.process_time()
        self.begin()

    def begin(self) -> None:
        """The clock begins."""
        self.set_up_s = time.process_time() - self.began
        self.stairs: list[tuple[float, float]] = []
        self.judged, self.least_share, self.started = 0, np.inf, time.process_time()

    def check(self) -> float:
        """Processor seconds since the clock began; raises Spent beyond the budget."""
        if (now := time.process_time() - self.started) > self.seconds:
            raise Spent
        return now

    def share(self, z: np.ndarray) -> tuple[float, float]:
        """Area ratio of the cam nearest to z within the limits on the shape, and its largest share of a limit on the
        motion; one that holds all of them and is larger is noted."""
        lift = self.cam.lift(self.shape.nearest(z))
        area = float(lift.area_ratio(self.design.max_lift_mm * 1e-3))
        share = float(self.judge(lift).share.max(initial=0.0))
        now = self.check()
        self.judged, self.least_share = self.judged + 1, min(self.least_share, share)
        if share <= 1.0 and (not self.stairs or area > self.stairs[-1][1]):
            self.stairs.append((now, area))
        return area, share

    def objective(self) -> Objective:
        """The area, with constraints along the paths."""
        return camopt.objective(self.scene, speeds_rpm=self.speeds_rpm, constraints=CONSTRAINTS)


def run(scene: str, method: str, start: str, seconds: float) -> dict:
    """What a method reached: `stairs`, the last of them, how many cams it had judged, its seconds until the clock began
    and until its end, the least share of a limit of any of its cams, and what ended it."""
    problem = Problem(scene, start, seconds)
    try:
        ended = METHODS[method](problem)
    except Spent:
        ended = "budget spent"
    except (ValueError, ArithmeticError) as error:  # an InputError, or SciPy's word for slopes that are no numbers
        ended = str(error)
    return {
        "area_ratio": problem.stairs[-1][1] if problem.stairs else None,
        "stairs": problem.stairs,
        "judged": problem.judged,
        "least_share": problem.least_share,
        "set_up_s": problem.set_up_s,
        "processor_s": time.process_time() - problem.began,
        "ended": ended,
    }


def climb(problem: Problem, optimiser: optax.GradientTransformation, metric: bool) -> str:
    """Ascents of the augmented Lagrangian; the first step, which compiles, is free."""
    cam = FreeVariables(problem.scene, problem.cam.lift(problem.start), KNOT_DEG)
    ascent = AscentState(problem.objective(), Variables(cam, TrainVariables(problem.scene, {})), optimiser, metric)
    ascent.step(judged=False)
    problem.begin()
    while True:
        problem.share(ascent.variables.cam_vector(ascent.point))
        for _ in range(JUDGE_EVERY):
            problem.check()
            ascent.step(judged=False)


class Watched(StepFiles):
    """The journal of a search, whose cams the problem's judge sees too."""

    def __init__(self, problem: Problem):
        super().__init__(None, FOLDER)
        self.problem = problem

    def store(self, step: int, z: np.ndarray, arrays: dict[str, np.ndarray]) -> None:
        self.problem.share(z)


def convex(problem: Problem, source: str) -> str:
    """camopt's search; a first one, which ends at its first cam, compiles."""
    effort, cam = replace(ACCURACIES["standard"], knot_deg=KNOT_DEG), problem.cam.lift(problem.start)
    seconds, problem.seconds = problem.seconds, 0.0
    with suppress(Spent):
        find_cam(problem.scene, "nominal", effort, source, journal=Watched(problem), start=cam)
    problem.seconds = seconds
    problem.begin()
    search = find_cam(problem.scene, "nominal", effort, source, journal=Watched(problem), start=cam)
    return f"ended by itself after {search.steps} rounds"


class PathProgram:
    """The largest area under limits on shape and paths, as SciPy's methods take it, of y with coefficients metric @ y.

    The paths are those of the second revolution from the state in which the motion of the start has settled.
    """

    def __init__(self, problem: Problem):
        self.problem, bound = problem, problem.objective().of(problem.cam.lift(problem.start))
        lagrangian = PathLagrangian(bound)
        held = lagrangian.begin({"z": problem.start}, problem.cam.lift(problem.start))
        self.metric = lagrangian.metric(lambda z: {"z": z}, problem.start, held)
        self.start = np.linalg.solve(self.metric, problem.start)

        def rows(y: jax.Array) -> jax.Array:
            own = {"z": jnp.asarray(self.metric) @ y}
            begun = held._replace(start=lagrangian.paths(own, held, "forward").end)
            found = lagrangian.rows(begun, lagrangian.paths(own, begun, "forward"))
            return jnp.concatenate([row[EVERY - 1 :: EVERY].ravel() for row in found.values()])

        asked = np.flatnonzero(np.isfinite(rows(jnp.asarray(self.start))))
        self.paths, self.slopes = jax.jit(lambda y: rows(y)[asked]), jax.jit(jax.jacfwd(lambda y: rows(y)[asked]))
        _ = self.paths(self.start), self.slopes(self.start)  # compiled before the clock begins
        polyhedron = problem.shape.polyhedron
        self.matrix, self.level = polyhedron.matrix @ self.metric, polyhedron.bound
        self.row = area_ratio_row(problem.design, problem.cam)[0] @ self.metric

    def room(self, y: np.ndarray) -> np.ndarray:
        """By how much each path keeps its limit."""
        self.problem.check()
        return np.asarray(self.paths(y))

    def room_slopes(self, y: np.ndarray) -> np.ndarray:
        """Their Jacobian; a method asks for it once a step, whose cam is judged."""
        self.problem.share(self.metric @ y)
        return np.asarray(self.slopes(y))


def slsqp(problem: Problem) -> str:
    """SciPy's SLSQP."""
    program = PathProgram(problem)
    held = [
        {"type": "ineq", "fun": program.room, "jac": program.room_slopes},
        {"type": "ineq", "fun": lambda y: program.level - program.matrix @ y, "jac": lambda y: -program.matrix},
    ]
    return solved(program, "SLSQP", held, {"maxiter": 10**4, "ftol": 1e-7})


def trust_constr(problem: Problem) -> str:
    """SciPy's trust-constr, an interior-point method (Byrd, Hribar and Nocedal 1999), with sparse algebra."""
    program = PathProgram(problem)

    def slopes(y: np.ndarray) -> csr_array:
        return csr_array(program.room_slopes(y))

    held = [
        NonlinearConstraint(program.room, 0.0, np.inf, jac=cast(Any, slopes), hess=BFGS()),
        LinearConstraint(csr_array(program.matrix), -np.inf, program.level),
    ]
    size = len(program.start)
    options = {"maxiter": 10**4, "sparse_jacobian": True}
    return solved(program, "trust-constr", held, options, hess=lambda y: np.zeros((size, size)))


def solved(program: PathProgram, method: str, held: list, options: dict, **others) -> str:
    """SciPy's word at the end of a method."""
    program.problem.begin()
    row = program.row
    found = minimize(
        lambda y: -float(row @ y), program.start, jac=lambda y: -row, method=method, constraints=held, options=options,
        **others,
    )  # fmt: skip
    program.problem.share(program.metric @ found.x)
    return str(found.message)


def cma_es(problem: Problem) -> str:
    """CMA-ES (Hansen, pycma) over the coefficients: it sees the area, less what is used beyond a limit."""

    def cost(z: np.ndarray) -> float:
        area, share = problem.share(z)
        return -area + min(max(share - 1.0, 0.0), 1e6)

    problem.begin()
    options = {"seed": 1, "verbose": -9, "maxfevals": 10**6}
    cma.fmin2(cost, problem.start, SPREAD * first_region(problem.design).first, options, restarts=9)
    return "ended by itself"


METHODS: dict[str, Callable[[Problem], str]] = {
    "Adam": lambda problem: climb(problem, optax.adam(RATES[False]), metric=False),
    "Adam, metric": lambda problem: climb(problem, optax.adam(RATES[True]), metric=True),
    "L-BFGS": lambda problem: climb(problem, optax.lbfgs(), metric=False),
    "L-BFGS, metric": lambda problem: climb(problem, optax.lbfgs(), metric=True),
    "convex search, smooth rows": lambda problem: convex(problem, "smooth"),
    "convex search, exact rows": lambda problem: convex(problem, "exact"),
    "SLSQP": slsqp,
    "trust-constr": trust_constr,
    "CMA-ES": cma_es,
}
