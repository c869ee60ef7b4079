"""Baselines as good as their families allow: the largest area of a family, on request within a limit on bounce.

The outer search is differential evolution (Storn and Price 1997) over the family's free parameters, the inner one a
linear program in the levels. Differential evolution only asks which of two members is better, so no penalty has to be
weighed: a member outside the limits on its shape is worse than one that bounces too much, and that one worse than any
that holds. Motion is judged by event-exact, settled from rest at every speed.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.optimize import differential_evolution
from tqdm import tqdm

from camopt.cam.families.record import Space, family_named
from camopt.cam.lift import Lift
from camopt.cam.read import family_and_keywords, read_cam
from camopt.exact.engine import prepare
from camopt.measure.limits import shape_excess
from camopt.measure.settling import settle
from camopt.scene.design import Design
from camopt.scene.errors import InputError, MotionRefused
from camopt.scene.rest import state_at_rest
from camopt.scene.schema import Scene
from camopt.scene.train import build_train

POPULATION, SEED = 32, 0
NEAR = 0.15
"""Distance from known members, in parts of the bounds' width, within which half of the first population lies."""
HOPELESS = 6.0
"""Bounce in multiples of the limit at which the slower speeds are not looked at: such a member only shows the way."""
FIGURES = ("bounce_mm", "jump_mm", "seating_velocity_m_per_s")


@dataclass(frozen=True)
class Baseline:
    """The best member of a family that a search found, with the worst figures of its motion over the speeds asked.

    `holds`: it keeps the limits on its shape and, where one was given, on bounce; `says` is that in words. Bounce is
    infinite where the valve never seats or the motion is refused. `evaluations` counts members designed, `judged` the
    motions looked at (one per speed).
    """

    family: str
    lift: Lift
    holds: bool
    says: str
    area_ratio: float
    figures: dict[str, float]
    evaluations: int
    judged: int
    seconds: float


def largest_area_member(
    scene: Scene,
    family: str,
    *,
    jerk: bool = True,
    bounce_max_mm: float | None = None,
    speeds_rpm: Sequence[float] | None = None,
    evaluations: int = 600,
    progress: bool = False,
) -> Baseline:
    """The member of `family` with the largest area under a scene's limits on the shape and one on bounce.

    `family` as on the command line, with the parameters that tell its readings apart (`new-design:start_ratio=0`).
    `jerk` false leaves the jerk limit out. `bounce_max_mm`: largest bounce at `speeds_rpm` [crankshaft r/min, the
    scene's listed ones where None]. About `evaluations` members are designed; the same call finds the same cam. Where
    no member holds, the one with the least bounce, or nearest the limits on the shape, is returned and says so. Raises
    InputError for an unknown family and a scene it cannot serve.
    """
    design, operation = scene.design, scene.operation
    if design is None or operation is None or scene.seat is None:
        raise InputError(f"scene {scene.name!r}: a baseline needs valve, seat, [operation] and [design]")
    if bounce_max_mm is not None and not bounce_max_mm > 0:
        raise InputError(f"bounce_max_mm {bounce_max_mm:g}: a number above 0 is needed")
    if evaluations < 2 * POPULATION:
        raise InputError(f"evaluations {evaluations}: at least {2 * POPULATION} are needed")
    begun = time.perf_counter()
    design = design if jerk else design.model_copy(update={"jerk_max_mm_per_deg3": None})
    motion = MemberMotion(scene, operation.speeds_rpm if speeds_rpm is None else speeds_rpm)
    space = family_space(scene, family, jerk)
    if bounce_max_mm is None and space.largest is not None:
        lift, count = space.largest(evaluations, SEED), evaluations
    else:
        score = partial(_score, space, design, motion, bounce_max_mm)
        with tqdm(total=evaluations, disable=None if progress else True, unit="cam", desc=family) as bar:
            lift, count = _best(space, score, evaluations, bar)
    figures = motion.worst(lift)
    over = shape_excess(lift, design)
    holds = not over and (bounce_max_mm is None or figures["bounce_mm"] <= bounce_max_mm)
    area = lift.area_ratio_in(design)
    says = _words(family, over, figures["bounce_mm"], bounce_max_mm)
    seconds = time.perf_counter() - begun
    return Baseline(family, lift, holds, says, area, figures, count, motion.judged, seconds)


def family_space(scene: Scene, family: str, jerk: bool) -> Space:
    """The search space of a family, as of `largest_area_member`, under a scene's limits, the jerk limit only with
    `jerk`. Raises InputError for an unknown family, for a parameter that the search chooses, and for a scene whose two
    ramps differ."""
    name, given = family_and_keywords(family)
    record = family_named(name)
    chosen = sorted(p.keyword for p in record.parameters.values() if p.searched and p.keyword in given)
    if chosen:
        raise InputError(f"baseline {family!r}: the search chooses {', '.join(chosen)}: leave it out")
    if record.space is None:
        return Space([], lambda _: read_cam(family, scene))
    return record.space(scene, jerk, **given)


def member_within(space: Space, x: np.ndarray, design: Design) -> tuple[Lift | None, float]:
    """The member of a vector x (d) with a cost of 0; none with a cost of 3, or from 2 by its excess over the limits on
    the shape."""
    try:
        lift = space.member(x)
    except InputError:
        return None, 3.0
    over = max(shape_excess(lift, design).values(), default=0.0)
    return (lift, 0.0) if over == 0 else (None, 2.0 + over / (1.0 + over))


class MemberMotion:
    """Judges cams of one scene at fixed speeds, each from rest: a cam's figures hang on nothing judged before."""

    def __init__(self, scene: Scene, speeds_rpm: Sequence[float]):
        self.speeds_rpm = tuple(sorted((float(s) for s in speeds_rpm), reverse=True))  # the highest bounces most
        self.judged = 0
        self._cam_speeds = [scene.cam_speed(s) for s in self.speeds_rpm]
        self._train = build_train(scene)
        self._rest = state_at_rest(self._train)

    def worst(self, lift: Lift, enough_mm: float = np.inf) -> dict[str, float]:
        """Largest figures over the speeds; speeds below one at which bounce exceeds `enough_mm` are left out."""
        found: dict[str, float] = dict.fromkeys(FIGURES, 0.0)
        for cam_speed in self._cam_speeds:
            self.judged += 1
            try:
                figures = settle(prepare(self._train, lift, cam_speed), self._rest).metrics(lift)
            except MotionRefused:
                return dict.fromkeys(FIGURES, np.inf)
            for name in FIGURES:
                found[name] = max(found[name], float(np.nan_to_num(figures.worst(name), nan=np.inf)))
            if found["bounce_mm"] > enough_mm:
                break
        return found


def _best(space: Space, score: Callable[[np.ndarray], float], evaluations: int, bar: tqdm) -> tuple[Lift, int]:
    """The member of the least score of about `evaluations`, and how many there were."""
    if not space.bounds:
        return space.member(np.zeros(0)), 1

    def cost(x: np.ndarray) -> float:
        bar.update(1)
        return score(x)

    best = differential_evolution(
        cost,
        space.bounds,
        init=_first_population(space),  # pyright: ignore[reportArgumentType]  # as in `largest_area`
        maxiter=evaluations // POPULATION - 1,
        tol=0.0,
        polish=False,
        rng=np.random.default_rng(SEED),
    )
    return space.member(best.x), best.nfev


def _score(space: Space, design: Design, motion: MemberMotion, limit: float | None, x: np.ndarray) -> float:
    """How bad a member is: below 1 what holds, then what bounces more than the limit, then what breaks limits."""
    lift, cost = member_within(space, x, design)
    if lift is None:
        return cost
    if limit is not None:
        bounce = motion.worst(lift, HOPELESS * limit)["bounce_mm"]
        if bounce > limit:
            return 1.0 + (1.0 if np.isinf(bounce) else bounce / (1.0 + bounce))
    return 1.0 - lift.area_ratio_in(design)


def _first_population(space: Space) -> np.ndarray:
    """Vectors (POPULATION, d): the known ones, as many near them as to make up half, and the rest anywhere."""
    from scipy.stats import qmc  # which loads longer than a plain comparison takes

    low, high = np.array(space.bounds).T
    unit = qmc.Sobol(len(low), rng=np.random.default_rng(SEED)).random(POPULATION)
    first = low + (high - low) * unit
    for i in range(POPULATION // 2 if space.known else 0):
        near = 0.0 if i < len(space.known) else NEAR * (2 * unit[i] - 1) * (high - low)
        first[i] = np.clip(np.array(space.known[i % len(space.known)]) + near, low, high)
    return first


def _words(family: str, over: dict[str, float], bounce: float, limit: float | None) -> str:
    if over:
        breaks = f"{', '.join(over)} by {max(over.values()):.2%}"
        return f"no {family} cam found within the limits on the shape: this one breaks {breaks}"
    if limit is None:
        return f"largest area of {family} within the limits on the shape"
    if bounce <= limit:
        return f"largest area of {family} found with at most {limit:g} mm of bounce"
    return f"no {family} cam found with at most {limit:g} mm of bounce: {bounce:.4g} mm is the least reached"
