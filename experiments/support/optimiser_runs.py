"""One optimiser at one problem within a budget of processor time: a task of `experiments.optimisers`.

All of them move the same free cam, every candidate holds the limits on the shape, and one judge decides: event-exact,
settled, at the scene's listed speeds. The clock begins when the start is there and what a method needs is compiled.
"""

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import cache

import cma
import jax
import jax.numpy as jnp
import numpy as np
import optax
from scipy.optimize import differential_evolution, minimize

import camopt
from camopt.cam.families.free import free_cam
from camopt.cam.lift import Lift
from camopt.measure.limits import motion_limits
from camopt.optimizer.accuracy import ACCURACIES
from camopt.optimizer.ascent.ascent import AscentState
from camopt.optimizer.ascent.projection import ShapeLimits
from camopt.optimizer.ascent.train_variables import TrainVariables
from camopt.optimizer.ascent.variables import FreeVariables, Variables
from camopt.optimizer.program.force_rows import Margins
from camopt.optimizer.program.kinematic import kinematic_optimum
from camopt.optimizer.program.no_jump import NoCamHoldsContact, no_jump_program
from camopt.optimizer.search.cams import BETWEEN_SHARE, Logbook
from camopt.optimizer.search.judge import Judge
from camopt.optimizer.search.search import find_cam
from camopt.scene import InputError, build_train, load_scene

KNOT_DEG, KNOT_SPREAD = 6.0, 0.1
"""Knot interval of the free cam, and the share of itself by which a seed changes it."""
JUDGE_EVERY = 5
REVOLUTION = 1
"""The revolution whose metrics are penalised: that with which the stored result was made."""
MOST_N = 60.0
SPREAD = 0.03
"""First step of CMA-ES on the coefficients, and a tenth of the box of differential evolution, over the largest one."""
TRANSFORMATIONS: dict[str, Callable[[bool], optax.GradientTransformation]] = {
    "Adam": lambda near: optax.adam(optax.exponential_decay(2e-5 if near else 1e-3, 50, 0.5)),
    "L-BFGS": lambda near: optax.lbfgs(),
    "gradient": lambda near: optax.sgd(1e-6 if near else 1e-4),
}
"""By whether they start near their goal; the rates are the best of a few tried on the first seed."""


class Spent(Exception):
    """The budget is spent."""


class Problem:
    """A scene's free cam and the judge, with every better confirmed cam as (processor second, area ratio)."""

    def __init__(self, scene: str, seed: int, seconds: float):
        self.scene, self.seed, self.seconds = load_scene(scene), seed, seconds
        design, operation = self.scene.design, self.scene.operation
        assert design is not None and operation is not None, "built-in scenes with a design"
        self.design, self.speeds_rpm = design, operation.speeds_rpm
        drawn = KNOT_DEG * (1 + KNOT_SPREAD * np.random.default_rng(seed).uniform(-1, 1))
        self.cam = free_cam(design, drawn)
        self.shape = ShapeLimits(self.cam, design)
        self.program = no_jump_program(
            build_train(self.scene), design, self.cam, [self.scene.cam_speed(s) for s in self.speeds_rpm]
        )
        self.judge = Judge(self.scene, self.speeds_rpm, workers=1)
        self.stairs: list[tuple[float, float]] = []
        self.judged, self.started = 0, time.process_time()

    def begin(self) -> None:
        """The clock begins."""
        self.stairs, self.judged, self.started = [], 0, time.process_time()

    def check(self) -> float:
        """Processor seconds since the clock began; raises Spent beyond the budget."""
        if (now := time.process_time() - self.started) > self.seconds:
            raise Spent
        return now

    def share(self, lift: Lift) -> float:
        """The largest share of a limit on the motion; a cam that holds all of them and is better is noted."""
        share, area = float(self.judge(lift).share.max(initial=0.0)), self.area(lift)
        self.judged += 1
        now = self.check()
        if share <= 1.0 and (not self.stairs or area > self.stairs[-1][1]):
            self.stairs.append((now, area))
        return share

    def area(self, lift: Lift) -> float:
        """Its area ratio."""
        return float(lift.area_ratio(self.design.max_lift_mm * 1e-3))

    def cost(self, lift: Lift) -> float:
        """What a method without gradients makes small: minus the area, and what is used beyond `BETWEEN_SHARE`."""
        return -self.area(lift) + float(np.nan_to_num(max(self.share(lift) - BETWEEN_SHARE, 0.0), posinf=1e6))

    def lift_of(self, z: np.ndarray) -> Lift:
        """The nearest cam within the limits on the shape."""
        return self.cam.lift(self.shape.nearest(z))

    def start(self, name: str) -> Lift:
        """A free cam within the limits: the one of largest area under them ("shape"), the linear program's, or that
        nearest to a family's plain member."""
        if name == "shape":
            return kinematic_optimum(self.design, self.cam).lift
        if name == "program":
            return self.program.solve(Margins(0.0, 0.0, 0.0)).lift
        return camopt.nearest_free_cam(self.scene, member(self.scene.name, name), knot_deg=self.cam.knot_deg)


@cache
def member(scene: str, family: str) -> Lift:
    """A family's plain member."""
    return camopt.read_cam(family, load_scene(scene))


def run(scene: str, method: str, seed: int, seconds: float, *, start: str = "shape", path: str = "exact") -> dict:
    """What a method reached: `stairs`, the last of them, how many cams it had judged, and its seconds until the clock
    began; and why it ended before its budget, if it did."""
    begin = time.process_time()
    problem = Problem(scene, seed, seconds)
    first = problem.start(start)
    problem.judge(first)  # compiled programs are loaded before the clock begins
    reason = ""
    try:
        if method in TRANSFORMATIONS:
            climb(problem, first, TRANSFORMATIONS[method](start == "program"), path)
        else:
            METHODS[method](problem)
        reason = "ended by itself"
    except Spent:
        pass
    except InputError as error:
        reason = str(error)
    area = problem.stairs[-1][1] if problem.stairs else None
    return {
        "area_ratio": area,
        "stairs": problem.stairs,
        "judged": problem.judged,
        "set_up_s": problem.started - begin,
        "processor_s": time.process_time() - begin,
        "ended": reason,
    }


def climb(problem: Problem, first: Lift, optimiser: optax.GradientTransformation, path: str) -> None:
    """Ascents of the area less penalties on every limit on the motion; the first step, which compiles, is free."""
    ascent = AscentState(objective(problem, path), variables(problem, first), optimiser)
    ascent.step(judged=False)
    problem.begin()
    problem.share(first)
    while True:
        problem.share(ascent.variables.cam.lift(ascent.point["cam"]))
        for _ in range(JUDGE_EVERY):
            problem.check()
            ascent.step(judged=False)


def objective(problem: Problem, path: str):
    """The area ratio less a penalty on every metric that the scene limits."""
    penalties = {limit.metric: 1.0 for limit in motion_limits(problem.design).values()}
    return camopt.objective(problem.scene, penalties=penalties, path=path, revolutions=REVOLUTION)


def variables(problem: Problem, first: Lift) -> Variables:
    """Those of an ascent."""
    return Variables(FreeVariables(problem.scene, first, KNOT_DEG), TrainVariables(problem.scene, {}))


def program_alone(problem: Problem) -> None:
    """The no-jump program's cam."""
    problem.begin()
    problem.share(problem.start("program"))


def own_search(problem: Problem) -> None:
    """camopt's search, with rows of the exact response; it ends by itself."""
    effort = replace(ACCURACIES["standard"], knot_deg=problem.cam.knot_deg)
    problem.begin()

    def show(line: dict) -> None:
        problem.judged += 1
        now = problem.check()
        if line["confirmed"] and (not problem.stairs or line["area_ratio"] > problem.stairs[-1][1]):
            problem.stairs.append((now, line["area_ratio"]))

    find_cam(problem.scene, "nominal", effort, "exact", log=Logbook(show=show))


def by_margins(problem: Problem, margins: np.ndarray) -> float:
    """The cost of the program's cam with three margins [N]."""
    try:
        return problem.cost(problem.program.solve(Margins(*margins)).lift)
    except NoCamHoldsContact as short:
        problem.check()
        return 1e6 * (1.0 + min(short.shortfall_N, 1e6))


def cma_es(problem: Problem, cost: Callable[[np.ndarray], float], start: np.ndarray, step: float) -> None:
    """CMA-ES until the budget is spent."""
    cma.fmin2(cost, start, step, {"seed": problem.seed + 1, "verbose": -9, "maxfevals": 10**6}, restarts=9)


def cma_margins(problem: Problem) -> None:
    """CMA-ES over the margins."""
    problem.begin()
    cma_es(problem, lambda margins: by_margins(problem, margins), np.zeros(3), MOST_N / 3)


def evolution_margins(problem: Problem) -> None:
    """Differential evolution over the margins."""
    problem.begin()
    box = [(-MOST_N, MOST_N)] * 3
    differential_evolution(lambda margins: by_margins(problem, margins), box, popsize=5, rng=problem.seed, polish=False)


def free_start(problem: Problem) -> tuple[np.ndarray, float]:
    """The coefficients of largest area under the limits on the shape alone, and the largest of them."""
    z = kinematic_optimum(problem.design, problem.cam).z
    return z, float(np.abs(z).max())


def cma_coefficients(problem: Problem) -> None:
    """CMA-ES over the coefficients."""
    z, size = free_start(problem)
    problem.begin()
    cma_es(problem, lambda x: problem.cost(problem.lift_of(x)), z, SPREAD * size)


def evolution_coefficients(problem: Problem) -> None:
    """Differential evolution over the coefficients, in a box about the start."""
    z, size = free_start(problem)
    box = [(one - 10 * SPREAD * size, one + 10 * SPREAD * size) for one in z]
    problem.begin()
    differential_evolution(
        lambda x: problem.cost(problem.lift_of(x)), box, popsize=2, x0=z, rng=problem.seed, polish=False
    )


def slsqp(problem: Problem) -> None:
    """SLSQP on the ascents' objective and its exact gradient, the limits on the shape as linear constraints."""
    z, size = free_start(problem)
    bound = objective(problem, "exact").of(problem.cam.lift(z))
    matrix, level = problem.shape.polyhedron.matrix, problem.shape.polyhedron.bound
    slopes = jax.jit(jax.value_and_grad(lambda u: -bound({"z": size * u})))
    slopes(jnp.asarray(z / size))
    problem.begin()

    def value(u: np.ndarray) -> tuple[float, np.ndarray]:
        found, gradient = slopes(jnp.asarray(u))
        problem.share(problem.lift_of(size * u))
        return float(found), np.asarray(gradient)

    held = {"type": "ineq", "fun": lambda u: level / size - matrix @ u, "jac": lambda u: -matrix}
    with suppress(ValueError):  # SLSQP's word for slopes that are no numbers
        minimize(value, z / size, jac=True, method="SLSQP", constraints=held, options={"maxiter": 10**4})


METHODS: dict[str, Callable[[Problem], None]] = {
    "program alone": program_alone,
    "camopt's search": own_search,
    "CMA-ES, margins": cma_margins,
    "diff. evolution, margins": evolution_margins,
    "CMA-ES, coefficients": cma_coefficients,
    "diff. evolution, coefficients": evolution_coefficients,
    "SLSQP, coefficients": slsqp,
}
"""Methods without a start of their choice."""
