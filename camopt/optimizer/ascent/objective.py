"""The objective of gradient ascent: area or a metric, less penalties, over several speeds and drawn trains, with path
constraints (`camopt.optimizer.ascent.lagrangian`)."""

from collections.abc import Mapping, Sequence
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
"""Default number of the revolution from rest whose metrics represent the settled motion. It is the first revolution in
which nearly all bounces and jumps that break a limit are within a fifth of the settled ones; in the first one they
may be less than a tenth of them (`experiments.first_revolutions`). Each further revolution costs as much again."""

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
        maximised = () if self.maximise == AREA_RATIO else (self.maximise,)
        return tuple(dict.fromkeys([*maximised, *self.penalties]))

    def penalty(self, metric: str, values: jax.Array) -> jax.Array:
        """The weighted penalty of a metric's values (t, s)."""
        limit = next((m for m in motion_limits(self.scene.design).values() if m.metric == metric), None)
        if limit is None:
            losses = -values if QUANTITIES[metric].less_is_worse else values
        else:
            # `MotionLimit.share` in JAX, but linear below zero too; NaN stays NaN, since it has no slope
            losses = jnp.maximum(1.0 + limit.share_slope * (values - limit.value) - AIM, 0.0)
        return self.penalties[metric] * jnp.mean(losses)


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
        objective, design = self.objective, self.objective.scene.required_design
        cam = {name: jnp.asarray(value, dtype=float) for name, value in parameters.items()}
        factors = cam.pop("train", jnp.ones(len(self.train.names)))
        area = self.cam.area(cam) / (design.max_lift_mm * MM * design.duration_deg * DEG)
        metrics = self._metrics(cam, factors) if objective.metrics else {}
        terms = {AREA_RATIO: area} | {name: jnp.mean(values) for name, values in metrics.items()}
        value = terms[objective.maximise]
        for metric in objective.penalties:
            value = value - objective.penalty(metric, metrics[metric])
        return value, terms

    def _metrics(self, cam: dict[str, jax.Array], factors: jax.Array) -> dict[str, jax.Array]:
        """The metrics (t, s) of every train at every speed."""
        objective, train, moving = self.objective, build_train(self.objective.scene), self.cam.motion_parameters(cam)
        names, revolutions = objective.metrics, objective.revolutions + 1  # a metric's window ends in the next one

        def of_case(case):
            arrays, cam_speed = case
            numbers = self.train.applied(arrays, factors) | moving
            if objective.source == "exact":
                turns = {"revolutions": revolutions, "revolution": revolutions - 2}
                return exact_metrics(train, self.template, cam_speed, numbers, names, **turns)
            settings = {"slowest": objective.scene.cam_speed(min(objective.speeds_rpm)), "eps": objective.metric_width}
            motion = train, self.template, numbers, cam_speed, revolutions, SMOOTH_STEPS
            metrics = differentiable_motion(*motion, **settings)[1]
            return jnp.stack([metrics[name][-1] for name in names])

        cases = jax.tree.map(jnp.asarray, self._cases)
        values = jax.vmap(of_case)(cases) if objective.source == "exact" else jax.lax.map(of_case, cases)
        return {name: values[:, i].reshape(-1, len(objective.speeds_rpm)) for i, name in enumerate(names)}

    @cached_property
    def _cases(self) -> tuple[dict[str, np.ndarray], np.ndarray]:
        """The cases, each a train at a speed: their arrays by name, as in `TrainVariables`, and cam speeds [rad/s]."""
        objective, scenes = self.objective, [self.objective.scene]
        speeds = [objective.scene.cam_speed(speed) for speed in objective.speeds_rpm]
        if objective.trains:
            drawn = trains_as_built(objective.scene, objective.trains, seed=objective.seed)
            scenes = [train.scene for train in drawn]
        if not objective.trains and not self.train.names:
            return {}, np.array(speeds)
        arrays = [self.train.arrays(scene) for scene in scenes]
        numbers = {name: np.repeat([train[name] for train in arrays], len(speeds), axis=0) for name in arrays[0]}
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
    terms = {AREA_RATIO, *QUANTITIES}
    weights = dict(penalties or {})
    for name in (maximise, *weights):
        if name not in terms or (name in weights and name == AREA_RATIO):
            raise InputError(
                f"objective: {name!r}: expected one of {', '.join(sorted(terms))}{did_you_mean(name, terms)}"
            )
    source = source if path is None else path
    if source not in SOURCES:
        raise InputError(f"objective: source {source!r}: expected one of {', '.join(SOURCES)}")
    if scene.design is None or scene.operation is None or scene.seat is None:
        raise InputError(f"scene {scene.name}: an objective needs valve, seat, [operation] and [design]")
    limits = _constraints(constraints, source, trains)
    band = np.linspace(*scene.operation.band_rpm, CONSTRAINED_SPEEDS)
    default = band if limits else scene.operation.speeds_rpm
    speeds = tuple(float(speed) for speed in (default if speeds_rpm is None else speeds_rpm))
    if not speeds or not all(np.isfinite(speed) and speed > 0 for speed in speeds):
        raise InputError(f"objective: speeds_rpm {speeds_rpm}: crankshaft speeds above 0 r/min are needed")
    if revolutions < 1 or trains < 0:
        raise InputError(f"objective: revolutions {revolutions}, trains {trains}: at least 1 and 0 are needed")
    source = "smooth" if limits else "exact" if source == "auto" else source
    layer = smoothing("objective", width_um, tie, steps_per_revolution)
    metric_width = EPS if width_um is None else layer.width
    return Objective(
        scene, speeds, maximise, weights, source, revolutions, trains, seed, limits, layer, metric_width,
    )  # fmt: skip


def _constraints(constraints: Mapping[str, float] | None, source: str, trains: int) -> dict[str, float]:
    """The limits along paths by name, checked together with the arguments that exclude them."""
    limits = dict(constraints or {})
    for name, limit in limits.items():
        if name not in CONSTRAINTS:
            names = ", ".join(CONSTRAINTS)
            raise InputError(
                f"objective: constraint {name!r}: expected one of {names}{did_you_mean(name, CONSTRAINTS)}"
            )
        if not (np.isfinite(limit) and (name == FORCE or limit > 0)):
            raise InputError(f"objective: constraint {name} {limit}: expected a number, and above 0 for a gap, as 0.03")
    if limits and source == "exact":
        raise InputError(
            "objective: constraints with source='exact': the exact source cannot tie contacts: take source='smooth'"
        )
    if limits and trains:
        raise InputError(
            f"objective: constraints with trains={trains}: they hold for the train as designed: leave out trains"
        )
    return {name: float(limit) for name, limit in limits.items()}
