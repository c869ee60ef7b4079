"""What an ascent moves: a free cam's coefficients or a family's own parameters, and factors on numbers of the train.

Both kinds are arrays by name, "cam" (m) and "train" (k). Of a free cam they are its coefficients z [mm/deg^2]; of a
family, factors on its own parameters, with the design conditions as they are. Every point of an ascent holds the
design's limits on the shape: it is the nearest one that does.
"""

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from camopt.cam.families.record import family_named
from camopt.cam.lift import Lift
from camopt.cam.linear_limits import LinearLimit, linear_limits
from camopt.optimizer.ascent.projection import Empty, Polyhedron, ShapeLimits
from camopt.optimizer.ascent.train_variables import TrainVariables
from camopt.optimizer.program.program_cam import program_cam
from camopt.scene.design import ROUNDING, Design
from camopt.scene.errors import InputError
from camopt.scene.schema import Scene
from camopt.scene.units import DEG, MM, MM_PER_DEG2, MM_PER_DEG3, MM_PER_DEG4
from camopt.smooth.families import DifferentiableCam, differentiable

FREE = "free"
NOSE_ANGLES = 41
MOST_ROUNDS = 30
DRAWING_STEP = 0.25 * DEG
ROOM = 1e-4
"""Part of a limit of the drawing that an ascent leaves: between two angles lies a few 1e-5 of it at most."""


class FreeVariables:
    """The coefficients of the free cam nearest to a given cam, of a free one with its own knots.

    `start` (m) belongs to `cam`. `parameters` of a vector (m) are those of `camopt.differentiable(scene, cam)`, in JAX;
    `nearest` is the nearest vector whose cam holds the design's limits on the shape, with its derivative (m, m) in
    `nearest_and_face`; `face` is the projector (m, m) onto the directions along which these limits still hold.
    """

    def __init__(self, scene: Scene, cam: Lift, knot_deg: float):
        own = cam.family == FREE
        self._free = program_cam(scene.required_design, cam.parameters["knot_deg"] if own else knot_deg)
        self._limits = ShapeLimits(self._free, scene.required_design)
        given = np.array(cam.parameters["coefficients_mm_per_deg2"]) if own else None
        near = self._limits.nearest_to(cam) if given is None else self._free.Z.T @ (given - self._free.x_p)
        self.start = self._limits.nearest(near)
        self.cam = self.lift(self.start)

    def parameters(self, vector: Any) -> dict[str, Any]:
        return {"z": vector}

    def lift(self, vector: np.ndarray) -> Lift:
        return self._free.lift(vector)

    def nearest(self, vector: np.ndarray) -> np.ndarray:
        return self._limits.nearest(vector)

    def nearest_and_face(self, vector: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self._limits.polyhedron.nearest_and_face(vector)

    def face(self, vector: np.ndarray, direction: np.ndarray) -> np.ndarray:
        return self._limits.polyhedron.face(vector, direction)

    def in_metric(self, metric: np.ndarray) -> Polyhedron:
        """The limits on vectors y with coefficients metric (m, m) @ y."""
        return Polyhedron(self._limits.polyhedron.matrix @ metric, self._limits.polyhedron.bound)


class FamilyVariables:
    """Factors on the own parameters of a family's member, with what `FreeVariables` has.

    The lift laws of other points have these parameters by the names of `camopt.differentiable`, and are no members by
    name: a family's own function may take others, or fewer.
    """

    def __init__(self, scene: Scene, cam: Lift):
        self._cam, self._design = differentiable(scene, cam), scene.required_design
        construction = family_named(cam.family).construction
        assert construction is not None, "differentiable() asks for it"
        self._own = {name: self._cam.parameters[name] for name in construction(scene, cam)[0]}
        count = sum(int(np.size(value)) for value in self._own.values())
        if not count:
            raise InputError(f"ascend: {cam.family} has no parameters of its own to vary: take form='free'")
        self.cam, self.start = cam, np.ones(count)
        self.start = self.nearest(self.start)

    def parameters(self, vector: Any) -> dict[str, Any]:
        found, at = dict(self._cam.parameters), 0
        for name, value in self._own.items():
            size = int(np.size(value))
            found[name] = value * jnp.reshape(vector[at : at + size], np.shape(value))
            at += size
        return found

    def lift(self, vector: np.ndarray) -> Lift:
        parameters = self.parameters(vector)
        borders, coefficients = (np.asarray(part) for part in self._cam.moving_pieces(parameters))
        wide = np.diff(borders) > 0.0
        own = {name: np.asarray(parameters[name]).tolist() for name in self._own}
        half, family = float(self._cam.half_duration(parameters)), f"{self.cam.family} (ascended)"
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
            except (Empty, ArithmeticError):
                break
            if not np.all(np.isfinite(moved)) or np.abs(moved - self.start).max() > 1.0:
                break
        raise InputError(
            f"ascend: no member of {self.cam.family} near this one holds the design's limits on the shape: take "
            f"form='free', which varies the free cam nearest to it, or loosen the limits"
        )

    def nearest_and_face(self, vector: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        moved = self.nearest(vector)
        return moved, self.face(moved, vector - moved)

    def face(self, vector: np.ndarray, direction: np.ndarray) -> np.ndarray:
        excess, slopes = self._excess(vector)
        return Polyhedron(slopes, slopes @ vector - np.minimum(excess, 0.0)).face(vector, direction)

    def _excess(self, vector: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How far each limit is broken, over the limit (r), and its slopes by the variables (r, m)."""
        slopes, excess = self._compiled(jnp.asarray(vector))
        return np.asarray(excess), np.asarray(slopes)

    @cached_property
    def _compiled(self):
        def twice(vector):
            excess = shape_excess(self._cam, self.parameters(vector), self._design)
            return excess, excess

        return jax.jit(jax.jacfwd(twice, has_aux=True))


def shape_excess(cam: DifferentiableCam, parameters: Mapping[str, Any], design: Design) -> jax.Array:
    """How far a cam breaks each limit on its shape, over the limit (r), in JAX; of the nose, over the lowest level."""
    own = dict(parameters)
    parts = [cam.peak(own) / (design.max_lift_mm * MM) - 1.0]
    if design.reach_max_lift:
        parts.append(1.0 - cam.peak(own) / (design.max_lift_mm * MM))
    if (upper := design.acceleration_max_mm_per_deg2) is not None:
        parts.append(cam.peak(own, 2) / (upper * MM_PER_DEG2) - 1.0)
    if (lower := design.acceleration_min_mm_per_deg2) is not None:
        parts.append(cam.peak(own, 2, lowest=True) / (lower * MM_PER_DEG2) - 1.0)
    if (jerk := design.jerk_max_mm_per_deg3) is not None:
        parts += [sign * cam.peak(own, 3, lowest=sign < 0) / (jerk * MM_PER_DEG3) - 1.0 for sign in (1.0, -1.0)]
    if (snap := design.snap_max_mm_per_deg4) is not None:
        parts += [sign * cam.peak(own, 4, lowest=sign < 0) / (snap * MM_PER_DEG4) - 1.0 for sign in (1.0, -1.0)]
    if design.nose_deg:
        theta = np.linspace(-design.nose_deg, design.nose_deg, NOSE_ANGLES) * DEG
        parts.append(jnp.max(cam.lift(theta, own, 2)) / MM_PER_DEG2)
    return jnp.stack(parts + [drawing_excess(cam, own, limit) for limit in linear_limits(design)])


def drawing_excess(cam: DifferentiableCam, parameters: Mapping[str, Any], limit: LinearLimit) -> jax.Array:
    """The same of one limit of the drawing, over its size, at angles so close that `ROOM` covers what lies between."""
    level = limit.level
    theta = np.linspace(level.low, level.high, 1 + int(np.ceil((level.high - level.low) / DRAWING_STEP)))
    most = level.taylor(theta, theta)[:, 0] - level.error
    total = sum(w * cam.lift(theta, dict(parameters), k) for k, w in enumerate(limit.weights) if w)
    size, room = limit.size, ROOM if len(theta) > 1 else 0.0
    return jnp.max(total - most) / size + room


class Variables:
    """Everything that an ascent moves: arrays "cam" and, where numbers of the train vary, "train".

    With a `metric` (m, m) of a free cam, "cam" is y of the coefficients z = metric @ y, and what is nearest is so in y.
    """

    def __init__(self, cam: FreeVariables | FamilyVariables, train: TrainVariables, metric: np.ndarray | None = None):
        self.cam, self.train, self._metric = cam, train, metric
        self._limits = cam if metric is None or not isinstance(cam, FreeVariables) else cam.in_metric(metric)

    @property
    def start(self) -> dict[str, np.ndarray]:
        """Where an ascent begins."""
        begin = self.cam.start if self._metric is None else np.linalg.solve(self._metric, self.cam.start)
        return {"cam": begin, "train": np.ones(len(self.train.names))}

    def cam_vector(self, point: Mapping[str, Any]) -> Any:
        """The vector (m) of the cam's variables at a point."""
        return point["cam"] if self._metric is None else self._metric @ point["cam"]

    def parameters(self, point: Mapping[str, Any]) -> dict[str, Any]:
        """Those of a bound objective."""
        return self.cam.parameters(self.cam_vector(point)) | ({"train": point["train"]} if self.train.names else {})

    def nearest(self, point: Mapping[str, Any]) -> dict[str, np.ndarray]:
        """The nearest point within all limits and bounds."""
        factors = np.clip(np.asarray(point["train"], dtype=float), *self.train.limits)
        return {"cam": self._limits.nearest(np.asarray(point["cam"], dtype=float)), "train": factors}

    def faces(self, point: Mapping[str, np.ndarray], gradient: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Projectors onto the directions in which a point may move along its gradient."""
        low, high = self.train.limits
        factors, uphill = point["train"], gradient["train"]
        held = ((factors <= low) & (uphill < 0)) | ((factors >= high) & (uphill > 0))
        return {"cam": self._limits.face(point["cam"], gradient["cam"]), "train": np.diag(1.0 - held)}

    def nearest_and_faces(self, point: Mapping[str, Any]) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        """`nearest`, and its derivative: projectors onto the faces on which that point lies."""
        (low, high), factors = self.train.limits, np.asarray(point["train"], dtype=float)
        cam, face = self._limits.nearest_and_face(np.asarray(point["cam"], dtype=float))
        free = (low <= factors) & (factors <= high)
        return {"cam": cam, "train": np.clip(factors, low, high)}, {"cam": face, "train": np.diag(1.0 * free)}
