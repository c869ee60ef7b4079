"""Baselines as good as their families allow: a family's member of the largest area, also within a limit on bounce.

The outer search is differential evolution (Storn and Price 1997) over the family's free parameters, the inner one a
linear program in the levels. Differential evolution only compares two members, so that no penalty needs a weight: a
member outside the limits on its shape is worse than one that bounces too much, and that one is worse than any that
holds. The motion is by event-exact, settled from rest at every speed.
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
"""Largest distance from known members, relative to the width of the bounds, of half of the first population."""
HOPELESS = 6.0
"""Bounce, in multiples of the limit, above which slower speeds are left out: such a member only guides the search."""
FIGURES = ("bounce_mm", "jump_mm", "seating_velocity_m_per_s")


@dataclass(frozen=True)
class Baseline:
    """The best member of a family that a search found, with the worst metrics of its motion over the speeds.

    `holds` states whether it keeps the limits on its shape and, if one was given, that on bounce; `says` is the same in
    words. Bounce is infinite if the valve never seats or the motion is refused. `evaluations` counts designed members,
    `judged` computed motions (one per speed).
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
    """The member of `family` with the largest area under a scene's limits on the shape and, optionally, one on bounce.

    `family` is as on the command line, with the parameters that distinguish its variants (`new-design:start_ratio=0`).
    With `jerk` false the jerk limit is left out. `bounce_max_mm` is the largest bounce permitted at `speeds_rpm`
    [crankshaft r/min, the scene's listed ones where None]. About `evaluations` members are designed; the same call
    finds the same cam. If no member holds, the one with the least bounce, or nearest to the limits on the shape, is
    returned, and `says` states this. Raises InputError for an unknown family, and for a scene without the necessary
    parts.
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
    """The search space of a family, as in `largest_area_member`, under a scene's limits, the jerk limit only with
    `jerk`. Raises InputError for an unknown family, for a parameter that the search chooses, and for a scene whose two
    ramps differ."""
    name, keywords = family_and_keywords(family)
    record = family_named(name)
    chosen = sorted(p.keyword for p in record.parameters.values() if p.searched and p.keyword in keywords)
    if chosen:
        raise InputError(f"baseline {family!r}: the search chooses {', '.join(chosen)}: leave it out")
    if record.space is None:
        return Space([], lambda _: read_cam(family, scene))
    return record.space(scene, jerk, **keywords)


def member_within(space: Space, x: np.ndarray, design: Design) -> tuple[Lift | None, float]:
    """The member of a vector x (d) and a cost of 0 if it holds the limits on the shape; else None, with a cost of 3 if
    there is no member, or from 2 to 3 by its largest excess."""
    try:
        lift = space.member(x)
    except InputError:
        return None, 3.0
    over = max(shape_excess(lift, design).values(), default=0.0)
    return (lift, 0.0) if over == 0 else (None, 2.0 + over / (1.0 + over))


class MemberMotion:
    """Computes motions of cams of a scene at fixed speeds, each from rest: metrics do not depend on earlier cams."""

    def __init__(self, scene: Scene, speeds_rpm: Sequence[float]):
        self.speeds_rpm = tuple(sorted((float(s) for s in speeds_rpm), reverse=True))  # the highest bounces most
        self.judged = 0
        self._cam_speeds = [scene.cam_speed(s) for s in self.speeds_rpm]
        self._train = build_train(scene)
        self._rest = state_at_rest(self._train)

    def worst(self, lift: Lift, enough_mm: float = np.inf) -> dict[str, float]:
        """Largest metrics over the speeds; those below a speed with more bounce than `enough_mm` are left out."""
        worst: dict[str, float] = dict.fromkeys(FIGURES, 0.0)
        for cam_speed in self._cam_speeds:
            self.judged += 1
            try:
                figures = settle(prepare(self._train, lift, cam_speed), self._rest).metrics(lift)
            except MotionRefused:
                return dict.fromkeys(FIGURES, np.inf)
            for name in FIGURES:
                worst[name] = max(worst[name], float(np.nan_to_num(figures.worst(name), nan=np.inf)))
            if worst["bounce_mm"] > enough_mm:
                break
        return worst


def _best(space: Space, score: Callable[[np.ndarray], float], evaluations: int, bar: tqdm) -> tuple[Lift, int]:
    """The member of the least score of about `evaluations`, and their number."""
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
    """Score: below 1 if it holds, from 1 if it bounces too much, from 2 if it breaks limits on the shape."""
    lift, cost = member_within(space, x, design)
    if lift is None:
        return cost
    if limit is not None:
        bounce = motion.worst(lift, HOPELESS * limit)["bounce_mm"]
        if bounce > limit:
            return 1.0 + (1.0 if np.isinf(bounce) else bounce / (1.0 + bounce))
    return 1.0 - lift.area_ratio_in(design)


def _first_population(space: Space) -> np.ndarray:
    """Vectors (POPULATION, d): the known ones and others near them, together half of them, and the rest anywhere."""
    from scipy.stats import qmc  # its import takes longer than a plain comparison

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
