"""One optimiser on one problem within a budget of processor time: a task of `experiments.optimisers`.

All optimisers vary the same free cam. Every evaluated cam keeps the limits on the shape, and all are evaluated in the
same way: by the settled event-exact motion at the scene's listed speeds. The clock starts when the initial cam is
computed and the programs of a method are compiled.
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
"""Limits along the paths, for every method that uses paths."""
JUDGE_EVERY = 3
"""Number of steps of an ascent between two evaluated cams."""
SPREAD = 0.2
"""First step of CMA-ES, as a share of the width of the convex search's first box."""
EVERY = 4
"""Steps of the smoothed motion between two angles at which SciPy's methods constrain a path: one degree."""
RATES = {False: 1e-3, True: 0.05}
"""Learning rates of Adam without and with the metric: the best of a few on `kodama` from the calmest cam."""


class Spent(Exception):
    """Raised when the budget of processor time is spent."""


class Problem:
    """A scene's free cam, start and evaluation, with each new largest cam within limits as (processor time, area)."""

    def __init__(self, scene: str, start: str, seconds: float):
        self.scene, self.seconds = load_scene(scene), seconds
        design, operation = self.scene.required_design, self.scene.required_operation
        self.design, self.speeds_rpm = design, operation.speeds_rpm
        self.cam = program_cam(design, KNOT_DEG)
        self.shape = ShapeLimits(self.cam, design)
        calmest = self.shape.nearest(np.zeros(self.cam.Z.shape[1]))
        self.start = calmest if start == "calmest" else self.shape.nearest_to(camopt.read_cam(start, self.scene))
        self.judge = Judge(self.scene, self.speeds_rpm, workers=1)
        self.judge(self.cam.lift(self.start))  # loads compiled programs before the clock starts
        self.began = time.process_time()
        self.begin()

    def begin(self) -> None:
        """Starts the clock."""
        self.set_up_s = time.process_time() - self.began
        self.stairs: list[tuple[float, float]] = []
        self.judged, self.least_share, self.started = 0, np.inf, time.process_time()

    def check(self) -> float:
        """Processor time [s] since the clock started; raises Spent beyond the budget."""
        if (now := time.process_time() - self.started) > self.seconds:
            raise Spent
        return now

    def share(self, z: np.ndarray) -> tuple[float, float]:
        """Area ratio of the cam nearest to z within the limits on the shape, and its largest ratio to a limit on the
        motion; a new largest cam that keeps all limits is recorded."""
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
    """Result of a method: the `stairs` of new largest areas and the last of them, the number of evaluated cams, the
    least ratio to a limit of any cam, the times [s] of its preparation and in all, and the reason of its end."""
    problem = Problem(scene, start, seconds)
    try:
        ended = METHODS[method](problem)
    except Spent:
        ended = "budget spent"
    except (ValueError, ArithmeticError) as error:  # an InputError, or SciPy's error for slopes that are not finite
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
    """Ascent of the augmented Lagrangian; the first step, which compiles, is not counted."""
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
    """The journal of a search whose cams are evaluated by the problem."""

    def __init__(self, problem: Problem):
        super().__init__(None, FOLDER)
        self.problem = problem

    def store(self, step: int, z: np.ndarray, arrays: dict[str, np.ndarray]) -> None:
        self.problem.share(z)


def convex(problem: Problem, source: str) -> str:
    """camopt's search; a first run, which ends at its first cam, compiles."""
    effort, cam = replace(ACCURACIES["standard"], knot_deg=KNOT_DEG), problem.cam.lift(problem.start)
    seconds, problem.seconds = problem.seconds, 0.0
    with suppress(Spent):
        find_cam(problem.scene, "nominal", effort, source, journal=Watched(problem), start=cam)
    problem.seconds = seconds
    problem.begin()
    search = find_cam(problem.scene, "nominal", effort, source, journal=Watched(problem), start=cam)
    return f"ended by itself after {search.steps} rounds"


class PathProgram:
    """The largest area under limits on shape and paths in SciPy's form, with variables y and coefficients metric @ y.

    The paths are those of the second revolution from the settled state of the initial cam.
    """

    def __init__(self, problem: Problem):
        self.problem, bound = problem, problem.objective().of(problem.cam.lift(problem.start))
        lagrangian = PathLagrangian(bound)
        held = lagrangian.begin({"z": problem.start}, problem.cam.lift(problem.start))
        self.metric = lagrangian.metric(lambda z: {"z": z}, problem.start, held)
        self.start = np.linalg.solve(self.metric, problem.start)

        def rows(y: jax.Array) -> jax.Array:
            variables = {"z": jnp.asarray(self.metric) @ y}
            begun = held._replace(start=lagrangian.paths(variables, held, "forward").end)
            slacks = lagrangian.rows(begun, lagrangian.paths(variables, begun, "forward"))
            return jnp.concatenate([row[EVERY - 1 :: EVERY].ravel() for row in slacks.values()])

        finite = np.flatnonzero(np.isfinite(rows(jnp.asarray(self.start))))
        self.paths, self.slopes = jax.jit(lambda y: rows(y)[finite]), jax.jit(jax.jacfwd(lambda y: rows(y)[finite]))
        _ = self.paths(self.start), self.slopes(self.start)  # compiles before the clock starts
        polyhedron = problem.shape.polyhedron
        self.matrix, self.level = polyhedron.matrix @ self.metric, polyhedron.bound
        self.row = area_ratio_row(problem.design, problem.cam)[0] @ self.metric

    def room(self, y: np.ndarray) -> np.ndarray:
        """Slack of each constraint on a path."""
        self.problem.check()
        return np.asarray(self.paths(y))

    def room_slopes(self, y: np.ndarray) -> np.ndarray:
        """Jacobian of the slacks; it is called once a step, whose cam is evaluated."""
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
    """Message of SciPy at the end of a method."""
    program.problem.begin()
    row = program.row
    result = minimize(
        lambda y: -float(row @ y), program.start, jac=lambda y: -row, method=method, constraints=held, options=options,
        **others,
    )  # fmt: skip
    program.problem.share(program.metric @ result.x)
    return str(result.message)


def cma_es(problem: Problem) -> str:
    """CMA-ES (Hansen, pycma) over the coefficients; its objective is the area less the excess over a limit."""

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
