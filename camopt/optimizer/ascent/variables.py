"""The variables of an ascent: a free cam's coefficients or a family's parameters, and factors on numbers of the train.

A point consists of two arrays by name, "cam" (m) and "train" (k). For a free cam, "cam" holds its coefficients z
[mm/deg^2]; for a family, factors on its own parameters, with the design conditions unchanged. Every point of an ascent
is the nearest one that holds the design's limits on the shape.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from camopt.cam.families.free import free_cam_of
from camopt.cam.families.record import family_named
from camopt.cam.lift import Lift
from camopt.cam.linear_limits import LinearLimit, linear_limits
from camopt.optimizer.ascent.projection import Polyhedron, ShapeLimits
from camopt.optimizer.program.program_cam import program_cam
from camopt.scene.design import ROUNDING, Design
from camopt.scene.errors import InputError
from camopt.scene.parameters import SceneNumber, Tied, matching, no_such_number
from camopt.scene.schema import Scene
from camopt.scene.text_file import excerpt
from camopt.scene.train import build_train
from camopt.scene.units import DEG, MM, MM_PER_DEG2, MM_PER_DEG3, MM_PER_DEG4
from camopt.smooth.families import DifferentiableCam, differentiable

FREE = "free"
NOSE_ANGLES = 41
MOST_ROUNDS = 30
DRAWING_STEP = 0.25 * DEG
ROOM = 1e-4
"""Margin to a limit of the drawing, over its size: between two samples it is exceeded by a few 1e-5 at most."""
Names = str | tuple[str, ...]


@dataclass(frozen=True)
class TrainVariables:
    """Factors on numbers of a scene, with their `bounds` by NAME.KEY, or by several of these that share one factor."""

    scene: Scene
    bounds: Mapping[Names, tuple[float, float]]

    def __post_init__(self) -> None:
        for names, (low, high) in self.bounds.items():
            if not 0.0 < low <= 1.0 <= high:
                raise InputError(f"train {names}: factors from {low:g} to {high:g}: the bounds must enclose 1")
        numbers = [number for tied in self._tied for number in tied.numbers]  # raises for unknown names
        if twice := [number.named(self.scene) for number in set(numbers) if numbers.count(number) > 1]:
            raise InputError(f"train: {min(twice)} has two factors: name it once")
        nominal = build_train(self.scene).parameters
        for tied in self._tied:  # the arrays must be affine in every factor
            more, most = (build_train(tied.scaled(self.scene, factor)).parameters for factor in (1.5, 2.0))
            if not all(np.allclose(2.0 * more[n], nominal[n] + most[n], rtol=1e-9, atol=0.0) for n in nominal):
                raise InputError(f"train: {excerpt(tied.name)} changes the train nonlinearly: choose another number")

    @property
    def names(self) -> list[str]:
        """The names of the factors."""
        return [tied.name for tied in self._tied]

    @property
    def limits(self) -> np.ndarray:
        """Least and largest factors (2, k)."""
        return np.array(list(self.bounds.values()), dtype=float).reshape(-1, 2).T

    @cached_property
    def _tied(self) -> list[Tied]:
        """The numbers that each factor multiplies."""
        groups = [[names] if isinstance(names, str) else list(names) for names in self.bounds]
        return [Tied(" = ".join(names), tuple(n for name in names for n in self._numbers(name))) for names in groups]

    def _numbers(self, name: str) -> list[SceneNumber]:
        """The numbers that a name stands for; raises InputError if there are none."""
        numbers = [number for number in matching(self.scene, name) if number.of(self.scene) is not None]
        if not numbers:
            raise no_such_number(self.scene, name, "train")
        return numbers

    def arrays(self, scene: Scene) -> dict[str, np.ndarray]:
        """The arrays of a train by name, each with a first axis (1 + k): its own numbers, then their change by each
        factor."""
        nominal = build_train(scene).parameters
        doubled = [build_train(tied.scaled(scene, 2.0)).parameters for tied in self._tied]
        return {name: np.stack([array, *(train[name] - array for train in doubled)]) for name, array in nominal.items()}

    def applied(self, arrays: Mapping[str, Any], factors: Any) -> dict[str, Any]:
        """A train's arrays by name, in JAX, with the factors (k) applied; `arrays` are those of the method `arrays`."""
        weights = jnp.concatenate([jnp.ones(1), jnp.asarray(factors) - 1.0])
        return {name: jnp.tensordot(weights, array, 1) for name, array in arrays.items()}

    def scene_with(self, factors: np.ndarray) -> Scene:
        """The scene with the factors (k) on its numbers."""
        scene = self.scene
        for tied, factor in zip(self._tied, factors, strict=True):
            scene = tied.scaled(scene, float(factor))
        return scene


class FreeVariables:
    """The coefficients of the free cam nearest to a given cam; a given free cam keeps its own knots.

    `start` (m) is the vector of `template`. `parameters` of a vector (m) are those of `camopt.differentiable(scene,
    cam)`, in JAX. `limits` gives the nearest vector whose cam holds the design's limits on the shape, the derivative of
    that projection, and the projectors onto the directions along which these limits still hold.
    """

    def __init__(self, scene: Scene, cam: Lift, knot_deg: float):
        design, is_free = scene.required_design, cam.family == FREE
        self._free = program_cam(design, cam.parameters["knot_deg"] if is_free else knot_deg)
        shape = ShapeLimits(self._free, design)
        self.start = shape.nearest(free_cam_of(design, cam)[1] if is_free else shape.nearest_to(cam))
        self.limits, self.template = shape.polyhedron, self.lift(self.start)

    def parameters(self, vector: Any) -> dict[str, Any]:
        return {"z": vector}

    def lift(self, vector: np.ndarray) -> Lift:
        return self._free.lift(vector)


class FamilyVariables:
    """Factors on the own parameters of a family's member, with the interface of `FreeVariables`; they are their own
    `limits`.

    The lift laws of other points have these parameters, under the names of `camopt.differentiable`. They cannot be
    rebuilt from the family's name: its own function may take other parameters, or fewer.
    """

    def __init__(self, scene: Scene, cam: Lift):
        self._cam, self._design = differentiable(scene, cam), scene.required_design
        construction = family_named(cam.family).construction
        assert construction is not None, "differentiable() has checked it"
        self._own = {name: self._cam.parameters[name] for name in construction(scene, cam)[0]}
        count = sum(int(np.size(value)) for value in self._own.values())
        if not count:
            raise InputError(f"ascend: {cam.family} has no parameters of its own to vary: take form='free'")
        self.template, self.limits, self.start = cam, self, np.ones(count)
        self.start = self.nearest(self.start)

    def parameters(self, vector: Any) -> dict[str, Any]:
        parameters, first = dict(self._cam.parameters), 0
        for name, value in self._own.items():
            last = first + int(np.size(value))
            parameters[name] = value * jnp.reshape(vector[first:last], np.shape(value))
            first = last
        return parameters

    def lift(self, vector: np.ndarray) -> Lift:
        parameters = self.parameters(vector)
        borders, coefficients = map(np.asarray, self._cam.moving_pieces(parameters))
        wide = np.diff(borders) > 0.0
        own = {name: np.asarray(parameters[name]).tolist() for name in self._own}
        half, family = float(self._cam.half_duration(parameters)), f"{self.template.family} (ascended)"
        return Lift(np.append(borders[:-1][wide], borders[-1]), coefficients[wide], half, family, own)

    def nearest(self, vector: np.ndarray) -> np.ndarray:
        """Projection by successive linearisation of the limits."""
        moved = vector
        for _ in range(MOST_ROUNDS):
            excess, slopes = self._excess(moved)
            if np.all(excess <= ROUNDING):
                return moved
            try:
                moved = Polyhedron(slopes, slopes @ moved - excess).nearest(vector)
            except ArithmeticError:
                break
            if not np.all(np.isfinite(moved)) or np.abs(moved - self.start).max() > 1.0:
                break
        raise InputError(
            f"ascend: no member of {self.template.family} near this one holds the design's limits on the shape: take "
            f"form='free', which varies the free cam nearest to it, or loosen the limits"
        )

    def nearest_and_face(self, vector: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        moved = self.nearest(vector)
        return moved, self.face(moved, vector - moved)

    def face(self, vector: np.ndarray, direction: np.ndarray) -> np.ndarray:
        excess, slopes = self._excess(vector)
        return Polyhedron(slopes, slopes @ vector - np.minimum(excess, 0.0)).face(vector, direction)

    def _excess(self, vector: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The excess over each limit, relative to it (r), and its slopes by the variables (r, m)."""
        slopes, excess = self._compiled(jnp.asarray(vector))
        return np.asarray(excess), np.asarray(slopes)

    @cached_property
    def _compiled(self):
        def excess_and_aux(vector):
            excess = shape_excess(self._cam, self.parameters(vector), self._design)
            return excess, excess

        return jax.jit(jax.jacfwd(excess_and_aux, has_aux=True))


def shape_excess(cam: DifferentiableCam, parameters: Mapping[str, Any], design: Design) -> jax.Array:
    """The excess of a cam over each limit on its shape, relative to it (r), in JAX; on the nose, the largest
    acceleration [mm/deg^2]."""
    p = dict(parameters)
    excess = [cam.peak(p) / (design.max_lift_mm * MM) - 1.0]
    if design.reach_max_lift:
        excess.append(1.0 - cam.peak(p) / (design.max_lift_mm * MM))
    if (upper := design.acceleration_max_mm_per_deg2) is not None:
        excess.append(cam.peak(p, 2) / (upper * MM_PER_DEG2) - 1.0)
    if (lower := design.acceleration_min_mm_per_deg2) is not None:
        excess.append(cam.peak(p, 2, lowest=True) / (lower * MM_PER_DEG2) - 1.0)
    for order, key, unit in ((3, "jerk_max_mm_per_deg3", MM_PER_DEG3), (4, "snap_max_mm_per_deg4", MM_PER_DEG4)):
        if (limit := getattr(design, key)) is not None:
            excess += [s * cam.peak(p, order, lowest=s < 0) / (limit * unit) - 1.0 for s in (1.0, -1.0)]
    if design.nose_deg:
        theta = np.linspace(-design.nose_deg, design.nose_deg, NOSE_ANGLES) * DEG
        excess.append(jnp.max(cam.lift(theta, p, 2)) / MM_PER_DEG2)
    return jnp.stack(excess + [drawing_excess(cam, p, limit) for limit in linear_limits(design)])


def drawing_excess(cam: DifferentiableCam, parameters: Mapping[str, Any], limit: LinearLimit) -> jax.Array:
    """The excess over one limit of the drawing, over its size; `ROOM` covers the excess between the samples."""
    level = limit.level
    theta = np.linspace(level.low, level.high, 1 + int(np.ceil((level.high - level.low) / DRAWING_STEP)))
    most = level.taylor(theta, theta)[:, 0] - level.error
    total = sum(w * cam.lift(theta, dict(parameters), k) for k, w in enumerate(limit.weights) if w)
    size, room = limit.size, ROOM if len(theta) > 1 else 0.0
    return jnp.max(total - most) / size + room


class Variables:
    """All variables of an ascent: the arrays "cam" and "train", the latter empty if no numbers of the train vary.

    With a `metric` (m, m) of a free cam, "cam" holds y of the coefficients z = metric @ y, and distances are measured
    in y.
    """

    def __init__(self, cam: FreeVariables | FamilyVariables, train: TrainVariables, metric: np.ndarray | None = None):
        self.cam, self.train, self._metric, self._limits = cam, train, metric, cam.limits
        if metric is not None and isinstance(cam, FreeVariables):
            self._limits = Polyhedron(cam.limits.matrix @ metric, cam.limits.bound)

    @property
    def start(self) -> dict[str, np.ndarray]:
        """The point at which an ascent begins."""
        begin = self.cam.start if self._metric is None else np.linalg.solve(self._metric, self.cam.start)
        return {"cam": begin, "train": np.ones(len(self.train.names))}

    def cam_vector(self, point: Mapping[str, Any]) -> Any:
        """The vector (m) of the cam's variables at a point."""
        return point["cam"] if self._metric is None else self._metric @ point["cam"]

    def lift(self, point: Mapping[str, Any]) -> Lift:
        """The lift law at a point."""
        return self.cam.lift(self.cam_vector(point))

    def parameters(self, point: Mapping[str, Any]) -> dict[str, Any]:
        """The parameters of a bound objective at a point."""
        return self.cam.parameters(self.cam_vector(point)) | ({"train": point["train"]} if self.train.names else {})

    def nearest(self, point: Mapping[str, Any]) -> dict[str, np.ndarray]:
        """The nearest point within all limits and bounds."""
        factors = np.clip(np.asarray(point["train"], dtype=float), *self.train.limits)
        return {"cam": self._limits.nearest(np.asarray(point["cam"], dtype=float)), "train": factors}

    def faces(self, point: Mapping[str, np.ndarray], gradient: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Projectors onto the directions in which a point can move along its gradient."""
        low, high = self.train.limits
        factors, uphill = point["train"], gradient["train"]
        held = ((factors <= low) & (uphill < 0)) | ((factors >= high) & (uphill > 0))
        return {"cam": self._limits.face(point["cam"], gradient["cam"]), "train": np.diag(1.0 - held)}

    def nearest_and_faces(self, point: Mapping[str, Any]) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        """The result of `nearest`, and its derivative: projectors onto the faces on which that point lies."""
        (low, high), factors = self.train.limits, np.asarray(point["train"], dtype=float)
        cam, face = self._limits.nearest_and_face(np.asarray(point["cam"], dtype=float))
        free = (low <= factors) & (factors <= high)
        return {"cam": cam, "train": np.clip(factors, low, high)}, {"cam": face, "train": np.diag(1.0 * free)}
