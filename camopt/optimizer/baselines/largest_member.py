"""Baselines as good as their families allow: the largest area of a family, on request within a limit on bounce.

The outer search is differential evolution (Storn and Price 1997) over the family's free parameters, the inner one a
linear program in the levels (see `family_spaces`). Differential evolution only asks which of two members is better, so
no penalty has to be weighed: a member outside the limits on its shape is worse than one that bounces too much, and
that one worse than any that holds; within each kind excess, bounce and area decide. Motion is judged by event-exact,
settled from rest at every speed, and the metrics of the verifier.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import differential_evolution
from tqdm import tqdm

from camopt.cam.families.record import Space
from camopt.cam.lift import Lift
from camopt.cam.waves import sign_changes
from camopt.exact.engine import prepare
from camopt.measure.limits import broken_by_shape, drawing_excess
from camopt.measure.settling import settle
from camopt.optimizer.baselines.family_spaces import family_space
from camopt.scene.design import Design
from camopt.scene.errors import InputError, MotionRefused
from camopt.scene.rest import state_at_rest
from camopt.scene.schema import Scene
from camopt.scene.train import build_train
from camopt.scene.units import MM, MM_PER_DEG2, MM_PER_DEG3, MM_PER_DEG4
from camopt.storage import run_identity
from camopt.storage.journal import Records

POPULATION = 32
NEAR = 0.15
"""Distance from known members, in parts of the bounds' width, within which half of the first population lies."""
HOPELESS = 6.0
"""Bounce in multiples of the limit at which the slower speeds are not looked at: such a member only shows the way."""
FIGURES = ("bounce_mm", "jump_mm", "seating_velocity_m_per_s")


@dataclass(frozen=True)
class MemberLimits:
    """What a member of a family must hold, besides the limits on its shape.

    `jerk` false leaves the jerk limit out. `bounce_max_mm`: largest bounce at `speeds_rpm` [crankshaft r/min, the
    scene's listed ones where None], judged by event-exact.
    """

    jerk: bool = True
    bounce_max_mm: float | None = None
    speeds_rpm: Sequence[float] | None = None

    def design(self, scene: Scene) -> Design:
        """The scene's design with those limits on the shape that count."""
        assert scene.design is not None, "as checked"
        return scene.design if self.jerk else scene.design.model_copy(update={"jerk_max_mm_per_deg3": None})


ON_THE_SHAPE = MemberLimits()
"""The limits on the shape alone."""


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
    limits: MemberLimits = ON_THE_SHAPE,
    *,
    evaluations: int = 600,
    seed: int = 0,
    journal: Path | str | None = None,
    progress: bool = False,
) -> Baseline:
    """The member of `family` with the largest area under a scene's limits on the shape and `limits`.

    `family` as on the command line, with the parameters that tell its readings apart (`new-design:start_ratio=0`).
    About `evaluations` members are designed; the same call finds the same cam. `journal`: a file that keeps what was
    judged, so that an interrupted search goes on when called again. Where no member holds, the one with the least
    bounce, or nearest the limits on the shape, is returned and says so. Raises InputError for an unknown family, a
    scene it cannot serve, and a journal of another search.
    """
    _check(scene, limits, evaluations)
    assert scene.operation is not None, "as checked"
    begun = time.perf_counter()
    design, bounce_max_mm = limits.design(scene), limits.bounce_max_mm
    motion = MemberMotion(scene, scene.operation.speeds_rpm if limits.speeds_rpm is None else limits.speeds_rpm)
    space = family_space(scene, family, limits.jerk)
    if bounce_max_mm is None and space.largest is not None:
        lift, count = space.largest(evaluations, seed), evaluations
    else:
        asked = {"family": family, "jerk": limits.jerk, "bounce_max_mm": bounce_max_mm, "evaluations": evaluations}
        identity = run_identity("baseline", scene, **asked, seed=seed, speeds_rpm=list(motion.speeds_rpm))
        search = _MemberSearch(space, design, motion, bounce_max_mm, Records(journal, "at", identity=identity))
        with tqdm(total=evaluations, disable=None if progress else True, unit="cam", desc=family) as bar:
            lift, count = search.best(evaluations, seed, bar), search.evaluations
    figures = motion.worst(lift)
    over = excess(lift, design)
    holds = over == 0 and (bounce_max_mm is None or figures["bounce_mm"] <= bounce_max_mm)
    area = lift.area_ratio_in(design)
    says = _words(family, over, broken_by_shape(lift, design), figures["bounce_mm"], bounce_max_mm)
    seconds = time.perf_counter() - begun
    return Baseline(family, lift, holds, says, area, figures, count, motion.judged, seconds)


def _check(scene: Scene, limits: MemberLimits, evaluations: int) -> None:
    if scene.design is None or scene.operation is None or scene.seat is None:
        raise InputError(f"scene {scene.name!r}: a baseline needs valve, seat, [operation] and [design]")
    if limits.bounce_max_mm is not None and not limits.bounce_max_mm > 0:
        raise InputError(f"bounce_max_mm {limits.bounce_max_mm:g}: a number above 0 is needed")
    if evaluations < 2 * POPULATION:
        raise InputError(f"evaluations {evaluations}: at least {2 * POPULATION} are needed")


def excess(lift: Lift, design: Design) -> float:
    """By how much a cam breaks the worst of its design's limits on the shape, relative to that limit; 0 if none.

    A step in velocity or acceleration where a limit forbids it counts as 1.
    """
    broken = broken_by_shape(lift, design)
    if not broken:
        return 0.0
    lowest, highest = lift.extremes(2)
    values = {
        "max_lift_mm": (lift.max_lift, design.max_lift_mm * MM),
        "reach_max_lift": (2 * design.max_lift_mm * MM - lift.max_lift, design.max_lift_mm * MM),
    }
    if design.acceleration_max_mm_per_deg2 is not None:
        values["acceleration_max_mm_per_deg2"] = highest, design.acceleration_max_mm_per_deg2 * MM_PER_DEG2
    if design.acceleration_min_mm_per_deg2 is not None:
        values["acceleration_min_mm_per_deg2"] = lowest, design.acceleration_min_mm_per_deg2 * MM_PER_DEG2
    if design.jerk_max_mm_per_deg3 is not None:
        steepest = float(np.abs(lift.extremes(3)).max())
        values["jerk_max_mm_per_deg3"] = steepest, design.jerk_max_mm_per_deg3 * MM_PER_DEG3
    if design.snap_max_mm_per_deg4 is not None:
        snap = float(np.abs(lift.extremes(4, -lift.half_duration, lift.half_duration)).max())
        values["snap_max_mm_per_deg4"] = snap, design.snap_max_mm_per_deg4 * MM_PER_DEG4
    if design.waves_max is not None:
        values["waves_max"] = float(len(sign_changes(lift))), float(design.waves_max)
    over = {name: value / limit - 1 for name, (value, limit) in values.items()} | drawing_excess(lift, design)
    return max(over[name] if over.get(name, 0.0) > 0 else 1.0 for name in broken)


def member_within(space: Space, x: np.ndarray, design: Design) -> tuple[Lift | None, float]:
    """The member of a vector x (d) with a cost of 0; none with a cost of 3, or from 2 by its excess over the limits on
    the shape."""
    try:
        lift = space.member(x)
    except InputError:
        return None, 3.0
    over = excess(lift, design)
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


class _MemberSearch:
    """Differential evolution on the score: below 1 what holds, then what bounces, then what breaks limits."""

    def __init__(self, space: Space, design: Design, motion: MemberMotion, limit: float | None, judged: Records):
        self.space, self.design, self.motion, self.limit, self.judged = space, design, motion, limit, judged
        self.evaluations = 0

    def best(self, evaluations: int, seed: int, bar: tqdm) -> Lift:
        """The best of about `evaluations` members."""
        if not self.space.bounds:
            self.evaluations = 1
            return self.space.member(np.zeros(0))

        def cost(x: np.ndarray) -> float:
            self.evaluations += 1
            bar.update(1)
            if (found := self.judged.get(x.tolist())) is None:
                found = {"at": x.tolist(), "score": self.score(x)}
                self.judged.add(found)
            return found["score"]

        found = differential_evolution(
            cost,
            self.space.bounds,
            init=_first_population(self.space, seed),  # pyright: ignore[reportArgumentType]  # as in `largest_area`
            maxiter=evaluations // POPULATION - 1,
            tol=0.0,
            polish=False,
            rng=np.random.default_rng(seed),
        )
        return self.space.member(found.x)

    def score(self, x: np.ndarray) -> float:
        """How bad a member is."""
        lift, cost = member_within(self.space, x, self.design)
        if lift is None:
            return cost
        if self.limit is not None:
            bounce = self.motion.worst(lift, HOPELESS * self.limit)["bounce_mm"]
            if bounce > self.limit:
                return 1.0 + (1.0 if np.isinf(bounce) else bounce / (1.0 + bounce))
        return 1.0 - lift.area_ratio_in(self.design)


def _first_population(space: Space, seed: int) -> np.ndarray:
    """Vectors (POPULATION, d): the known ones, as many near them as to make up half, and the rest anywhere."""
    from scipy.stats import qmc  # which loads longer than a plain comparison takes

    low, high = np.array(space.bounds).T
    unit = qmc.Sobol(len(low), rng=np.random.default_rng(seed)).random(POPULATION)
    first = low + (high - low) * unit
    for i in range(POPULATION // 2 if space.known else 0):
        near = 0.0 if i < len(space.known) else NEAR * (2 * unit[i] - 1) * (high - low)
        first[i] = np.clip(np.array(space.known[i % len(space.known)]) + near, low, high)
    return first


def _words(family: str, over: float, broken: list[str], bounce: float, limit: float | None) -> str:
    if over > 0:
        return (
            f"no {family} cam found within the limits on the shape: this one breaks {', '.join(broken)} by {over:.2%}"
        )
    if limit is None:
        return f"largest area of {family} within the limits on the shape"
    if bounce <= limit:
        return f"largest area of {family} found with at most {limit:g} mm of bounce"
    return f"no {family} cam found with at most {limit:g} mm of bounce: {bounce:.4g} mm is the least reached"
