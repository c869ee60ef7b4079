"""The objective of gradient ascent: area or a metric, less penalties, over several speeds and drawn trains, with path
constraints (`camopt.optimizer.ascent.lagrangian`)."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from camopt.cam.lift import Lift
from camopt.measure.as_built import trains_as_built
from camopt.measure.limits import motion_limits
from camopt.optimizer.ascent.variables import TrainVariables
from camopt.scene import QUANTITIES, InputError, Scene, build_train
from camopt.scene.errors import did_you_mean
from camopt.scene.smoothing import Smoothing, smoothing
from camopt.scene.units import DEG, MM
from camopt.smooth.exact_rule import exact_metrics
from camopt.smooth.families import DifferentiableCam, differentiable
from camopt.smooth.simulate import EPS, differentiable_motion

AREA_RATIO = "area_ratio"
AIM = 0.8
"""Share of a limit above which a penalty counts, so that a cam that ends slightly above it still holds the limit."""
SMOOTH_STEPS = 8
"""Output samples per revolution of the smooth path; unused, because metrics come from the solver's own steps."""
FORCE, GAP, SEAT_GAP = "contact_force_N", "gap_mm", "seat_gap_mm"
CONSTRAINTS = (FORCE, GAP, SEAT_GAP)
"""The quantities that may be limited along a revolution: the least force between cam and valve and their largest gap,
during the event, and the valve's largest gap from its seat, between its closing and the next opening."""
CONSTRAINED_SPEEDS = 9
"""Default number of speeds over the band at which constraints hold: between them a contact force is smooth."""
SOURCES = ("auto", "exact", "smooth")
REPRESENTATIVE = 4
"""Default number of the revolution from rest whose metrics stand for the settled motion. It is the first revolution in
which nearly all bounces and jumps that break a limit are within a fifth of the settled ones; in the one from rest they
may be less than a tenth (`experiments.first_revolutions`). Each further revolution costs as much again."""

Terms = dict[str, jax.Array]
"""Terms of the objective by name: the area ratio, and the mean of every metric over speeds and trains."""


@dataclass(frozen=True, eq=False)  # hashed by identity, as jax.jit requires
class Objective:
    """A number to maximise, for any cam of a scene; `of(cam)` makes it a function of that cam's parameters.

    Its fields are the arguments of `objective`. Smooth motions for metrics have a contact layer of width `metric_width`
    [m]; those for path constraints have the `smoothing`.
    """

    scene: Scene
    speeds_rpm: tuple[float, ...]
    maximise: str
    penalties: Mapping[str, float]
    source: str
    revolutions: int
    trains: int
    seed: int
    constraints: Mapping[str, float]
    smoothing: Smoothing
    metric_width: float

    def of(self, cam: Lift, train: TrainVariables | None = None) -> "BoundObjective":
        """The objective as a function of the parameters of `cam`, a free cam or a family's member, and of factors on
        numbers of the train. Raises InputError for a cam that belongs to no family."""
        return BoundObjective(self, cam, differentiable(self.scene, cam), train or TrainVariables(self.scene, {}))

    @property
    def metrics(self) -> tuple[str, ...]:
        """The metrics of the motion that the objective uses."""
        own = () if self.maximise == AREA_RATIO else (self.maximise,)
        return tuple(dict.fromkeys([*own, *self.penalties]))

    def penalty(self, metric: str, values: jax.Array) -> jax.Array:
        """The weighted penalty of a metric's values (t, s)."""
        limit = next((m for m in motion_limits(self.scene.design).values() if m.metric == metric), None)
        if limit is None:
            each = -values if QUANTITIES[metric].less_is_worse else values
        else:
            # `MotionLimit.share` in JAX, but linear below zero too; NaN stays NaN, since it has no slope
            each = jnp.maximum(1.0 + limit.share_slope * (values - limit.value) - AIM, 0.0)
        return self.penalties[metric] * jnp.mean(each)


@dataclass(frozen=True, eq=False)
class BoundObjective:
    """The objective of one cam: a function of `parameters`, arrays by name, that JAX differentiates. They are those of
    `camopt.differentiable(scene, cam)` and, under "train", the factors on numbers of the train."""

    objective: Objective
    template: Lift
    cam: DifferentiableCam
    train: TrainVariables

    @property
    def parameters(self) -> dict[str, jax.Array]:
        """The current values of the parameters."""
        return {**self.cam.parameters, **({"train": jnp.ones(len(self.train.names))} if self.train.names else {})}

    def __call__(self, parameters: Mapping[str, Any]) -> jax.Array:
        """The number to maximise."""
        return self.value_and_terms(dict(parameters))[0]

    @partial(jax.jit, static_argnums=0)
    def value_and_terms(self, parameters: dict[str, Any]) -> tuple[jax.Array, Terms]:
        """The number to maximise, and its terms, by one program that is kept on disk."""
        asked = self.objective
        own = {name: jnp.asarray(value, dtype=float) for name, value in parameters.items()}
        factors = own.pop("train", jnp.ones(len(self.train.names)))
        design = asked.scene.required_design
        area = self.cam.area(own) / (design.max_lift_mm * MM * design.duration_deg * DEG)
        terms = {AREA_RATIO: area}
        found = self._metrics(own, factors) if asked.metrics else {}
        terms |= {name: jnp.mean(values) for name, values in found.items()}
        value = terms[asked.maximise]
        for metric in asked.penalties:
            value = value - asked.penalty(metric, found[metric])
        return value, terms

    def _metrics(self, own: Mapping[str, jax.Array], factors: jax.Array) -> dict[str, jax.Array]:
        """The metrics (t, s) of every train at every speed."""
        names, motion = self.objective.metrics, self._motion
        moving = self.cam.motion_parameters(dict(own))

        def one(case):
            numbers, cam_speed = case
            return motion(self.train.applied(numbers, factors) | moving, cam_speed, names)

        cases = jax.tree.map(jnp.asarray, self._cases)
        values = jax.vmap(one)(cases) if self.objective.source == "exact" else jax.lax.map(one, cases)
        shape = -1, len(self.objective.speeds_rpm)
        return {name: values[:, i].reshape(shape) for i, name in enumerate(names)}

    @property
    def _motion(self) -> Callable[[dict, Any, tuple[str, ...]], jax.Array]:
        """Function from numbers of train and cam, the cam speed [rad/s] and names of metrics to these metrics (l)."""
        train, lift, measured = build_train(self.objective.scene), self.template, self.objective.revolutions

        def exact(numbers, cam_speed, names):
            turns = {"revolutions": measured + 1, "revolution": measured - 1}
            return exact_metrics(train, lift, cam_speed, numbers, names, **turns)

        def smooth(numbers, cam_speed, names):
            slowest = self.objective.scene.cam_speed(min(self.objective.speeds_rpm))
            settings = {"slowest": slowest, "eps": self.objective.metric_width}
            found = differentiable_motion(train, lift, numbers, cam_speed, measured + 1, SMOOTH_STEPS, **settings)[1]
            return jnp.stack([found[name][-1] for name in names])

        return exact if self.objective.source == "exact" else smooth

    @cached_property
    def _cases(self) -> tuple[dict[str, np.ndarray], np.ndarray]:
        """The cases, each a train at a speed: their arrays by name, as of `TrainVariables`, and cam speeds [rad/s]."""
        asked = self.objective
        speeds = [asked.scene.cam_speed(speed) for speed in asked.speeds_rpm]
        scenes = [asked.scene]
        if asked.trains:
            scenes = [one.scene for one in trains_as_built(asked.scene, asked.trains, seed=asked.seed)]
        if not asked.trains and not self.train.names:
            return {}, np.array(speeds)
        found = [self.train.arrays(scene) for scene in scenes]
        numbers = {name: np.repeat([one[name] for one in found], len(speeds), axis=0) for name in found[0]}
        return numbers, np.tile(speeds, len(scenes))


def objective(
    scene: Scene,
    *,
    speeds_rpm: Sequence[float] | None = None,
    maximise: str = AREA_RATIO,
    penalties: Mapping[str, float] | None = None,
    source: str = "auto",
    revolutions: int = REPRESENTATIVE,
    trains: int = 0,
    seed: int = 0,
    constraints: Mapping[str, float] | None = None,
    tie: float = 1.0,
    width_um: float | None = None,
    steps_per_revolution: int = 1440,
    path: str | None = None,
) -> Objective:
    """A number that `camopt.ascend` maximises: the area ratio or a metric, less penalties, differentiable by JAX.

    `speeds_rpm` (s) are crankshaft speeds [r/min], by default the scene's listed ones. `maximise` is "area_ratio" or a
    metric. `penalties` are weights by metric. For a metric that the scene limits, the weight multiplies the share of
    the limit that is used beyond 0.8; for any other metric it multiplies the value in the metric's unit. Metrics are
    means over the speeds and over `trains` trains drawn within the scene's tolerances by `seed` (0: the train as
    designed; grinding errors are left out). They are taken in the revolution of the number `revolutions` from rest; the
    default stands for the settled motion. `source` is "exact", "smooth", or "auto", which is "smooth" with constraints
    and else "exact"; `path` is an older name of it. `objective(...).of(cam)` is a function of that cam's parameters.

    `constraints` are limits that `ascend` keeps at every angle of a revolution and at every speed, on the smooth path
    and by default at nine speeds of the band: "contact_force_N" the least force between cam and valve [N] and "gap_mm"
    their largest gap, both from 2 deg after the ramp's top to the end of the duration, and "seat_gap_mm" the valve's
    largest gap from its seat after its closing. A share `tie` of the contact law between cam and valve is bilateral
    there (1: contacts pull and cannot open, 0: the law of the scene). Other contacts begin to push across a layer of
    `width_um` [um], and the revolution has `steps_per_revolution`. The default width is 1 um for constraints, and 0.002
    um for metrics on the smooth path, whose steps adapt to it.

    Raises InputError for unknown metrics, constraints and sources, unusable speeds, constraints on the exact path or
    with drawn trains, and scenes without valve, seat or [design].
    """
    known = {AREA_RATIO, *QUANTITIES}
    weights = dict(penalties or {})
    for name in (maximise, *weights):
        if name not in known or (name in weights and name == AREA_RATIO):
            raise InputError(
                f"objective: {name!r}: expected one of {', '.join(sorted(known))}{did_you_mean(name, known)}"
            )
    source = source if path is None else path
    if source not in SOURCES:
        raise InputError(f"objective: source {source!r}: expected one of {', '.join(SOURCES)}")
    if scene.design is None or scene.operation is None or scene.seat is None:
        raise InputError(f"scene {scene.name}: an objective needs valve, seat, [operation] and [design]")
    limits = _constraints(constraints, source, trains)
    band = np.linspace(*scene.operation.band_rpm, CONSTRAINED_SPEEDS)
    asked = speeds_rpm if speeds_rpm is not None else band if limits else scene.operation.speeds_rpm
    speeds = tuple(float(speed) for speed in asked)
    if not speeds or not all(np.isfinite(speed) and speed > 0 for speed in speeds):
        raise InputError(f"objective: speeds_rpm {speeds_rpm}: crankshaft speeds above 0 r/min are needed")
    if revolutions < 1 or trains < 0:
        raise InputError(f"objective: revolutions {revolutions}, trains {trains}: at least 1 and 0 are needed")
    followed = "smooth" if limits else "exact" if source == "auto" else source
    how = smoothing("objective", width_um, tie, steps_per_revolution)
    of_metrics = EPS if width_um is None else how.width
    return Objective(
        scene, speeds, maximise, weights, followed, revolutions, trains, seed, limits, how, of_metrics,
    )  # fmt: skip


def _constraints(asked: Mapping[str, float] | None, source: str, trains: int) -> dict[str, float]:
    """The limits along paths by name, checked together with the arguments that exclude them."""
    limits = dict(asked or {})
    for name, limit in limits.items():
        if name not in CONSTRAINTS:
            known = ", ".join(CONSTRAINTS)
            raise InputError(
                f"objective: constraint {name!r}: expected one of {known}{did_you_mean(name, CONSTRAINTS)}"
            )
        if not (np.isfinite(limit) and (name == FORCE or limit > 0)):
            raise InputError(f"objective: constraint {name} {limit}: expected a number, and above 0 for a gap, as 0.03")
    if limits and source == "exact":
        raise InputError(
            "objective: constraints with source='exact': its contacts cannot be tied: take source='smooth'"
        )
    if limits and trains:
        raise InputError(
            f"objective: constraints with trains={trains}: they hold for the train as designed: leave out trains"
        )
    return {name: float(limit) for name, limit in limits.items()}
