"""Projection onto linear limits: the nearest point of a polyhedron, and the free cam nearest to a given cam.

The nearest point of a polyhedron is the solution of a least distance problem, which follows exactly from a non-negative
least-squares problem (Lawson and Hanson 1974, ch. 23). Of thousands of rows only those are used that an intermediate
solution violates: each round adds the most violated ones, until none is left.
"""

from functools import cached_property

import numpy as np
from scipy.optimize import lsq_linear, nnls

from camopt.cam.families.free import FreeCam
from camopt.cam.lift import Lift
from camopt.optimizer.program.kinematic import conflict, with_lift_reached
from camopt.optimizer.program.program_cam import program_cam
from camopt.scene.design import Design
from camopt.scene.errors import InputError
from camopt.scene.schema import Scene

BROKEN = 1e-10
"""Excess of a row, over the size of the point, that violates it; a free cam's limits are tightened by more than that.
"""
DEPENDENT = 1e-9
"""Length of the part of a unit row that is independent of the other rows, below which the row adds nothing to a face.
"""
PROBE = 1e-4
"""Length of the step, relative to the size of the point, that shows which rows block a direction."""
ADDED_PER_ROUND = 60
MOST_ROUNDS = 60
SAMPLES_PER_KNOT = 8
NOT_LEAST = 1e-12
"""Slope of the squared residual by a multiplier, or multiplier over the largest one, that is more than rounding."""
NO_POINT = 1e-9
"""Residual of the least-squares problem below which the rows have no common point; where they have one it is near 1."""


class Empty(ArithmeticError):
    """No point holds all rows."""


class Polyhedron:
    """The points x (m) with matrix (r, m) @ x <= bound (r)."""

    def __init__(self, matrix: np.ndarray, bound: np.ndarray):
        norm = np.linalg.norm(matrix, axis=1)
        if not np.all(np.isfinite(norm)):
            raise ArithmeticError("the rows of a polyhedron must be finite")
        moving = norm > 1e-12 * norm.max()
        if np.any(bound[~moving] < -BROKEN * np.abs(bound).max()):
            raise Empty
        self.matrix, self.bound = matrix[moving] / norm[moving, None], bound[moving] / norm[moving]

    def nearest(self, x: np.ndarray) -> np.ndarray:
        """The nearest point to x (m); x itself where it holds all rows. Raises Empty where no point does."""
        return self._nearest(x)[0]

    def nearest_and_face(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The nearest point to x (m), and its derivative by x (m, m): the projector onto the face on which the point
        lies, which is given by the rows with positive multipliers (Rosen 1960)."""
        point, rows = self._nearest(x)
        q, r = np.linalg.qr(self.matrix[rows].T)
        q = q[:, np.abs(np.diag(r)) > DEPENDENT]
        return point, np.eye(len(x)) - q @ q.T

    def face(self, x: np.ndarray, direction: np.ndarray) -> np.ndarray:
        """The projector (m, m) onto the directions in which a point x (m) within the polyhedron can move along
        `direction`: the face of the nearest point to x after a step of `PROBE` times its size."""
        longest = max(float(np.abs(direction).max()), 1e-300)
        return self.nearest_and_face(x + direction * (PROBE * float(np.abs(x).max()) / longest))[1]

    def _nearest(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The nearest point and the active rows there.

        Every call starts without active rows, so that the result does not depend on earlier calls, to the last digit.
        """
        distance = float((self.matrix @ x - self.bound).max())  # unit of the steps: the least distance known
        moved, rows, holding = x, np.zeros(0, dtype=int), np.zeros(0, dtype=int)
        for _ in range(MOST_ROUNDS):
            excess, size = self.matrix @ moved - self.bound, float(np.abs(x).max() or np.abs(moved).max())
            broken = np.flatnonzero(excess > BROKEN * size)
            if not len(broken):
                return moved, holding
            worst = broken[np.argsort(-excess[broken])[:ADDED_PER_ROUND]]
            if len(holding) and np.isin(worst, rows).all():
                raise ArithmeticError("the nearest point still breaks rows that it was to hold")
            rows = np.union1d(rows, worst)
            holding = rows[_multipliers(self.matrix[rows], (self.bound[rows] - self.matrix[rows] @ x) / distance) > 0]
            face = self.matrix[holding]
            moved = x + np.linalg.lstsq(face, self.bound[holding] - face @ x, rcond=None)[0]
            distance = max(distance, float(np.linalg.norm(moved - x)))
        raise ArithmeticError(f"the nearest point still breaks rows after {MOST_ROUNDS} rounds")


def _multipliers(matrix: np.ndarray, room: np.ndarray) -> np.ndarray:
    """The rows' multipliers (r) at the shortest u (m) with matrix (r, m) @ u <= room (r). Raises Empty.

    The active rows give u to every digit; the residual gives it accurately only if its length is near 1.
    """
    target = np.zeros(matrix.shape[1] + 1)
    target[-1] = 1.0
    equations = np.vstack([-matrix.T, -room])
    multipliers, _ = nnls(equations, target, maxiter=50 * len(target))
    left = target - equations @ multipliers
    if np.max(equations.T @ left) > NOT_LEAST:  # SciPy's nnls may stop early (scipy #25389); lsq_linear is slower
        multipliers = lsq_linear(equations, target, (0, np.inf), "bvls", tol=1e-14).x
        left = target - equations @ multipliers
    if np.linalg.norm(left) < NO_POINT:
        raise Empty
    return np.where(multipliers > NOT_LEAST * multipliers.max(), multipliers, 0.0)


class ShapeLimits:
    """The limits of a design on a free cam, and the nearest coefficients that hold all of them at every angle."""

    def __init__(self, cam: FreeCam, design: Design):
        self.cam, self.design = cam, design
        limits = cam.limits(design)
        self._rows = with_lift_reached(cam, design, limits.matrix, limits.bound)

    @cached_property
    def polyhedron(self) -> Polyhedron:
        return Polyhedron(*self._rows)

    def nearest(self, z: np.ndarray) -> np.ndarray:
        """The nearest coefficients z (m). Raises InputError where the limits contradict each other."""
        try:
            return self.polyhedron.nearest(z)
        except Empty:
            raise InputError(conflict(self.design, self.cam)) from None

    def nearest_to(self, lift: Lift) -> np.ndarray:
        """The coefficients z (m) of the cam within the limits whose lift differs least in root mean square. Raises as
        `nearest` does."""
        theta = np.linspace(self.cam.breaks[0], self.cam.breaks[-1], SAMPLES_PER_KNOT * len(self.cam.breaks))[:-1]
        basis, offset = self.cam.basis(theta)
        q, r = np.linalg.qr(basis @ self.cam.Z)
        wanted = q.T @ (lift(theta) - offset - basis @ self.cam.x_p)  # of y = r z, whose distances are those of lifts
        matrix, bound = self._rows
        try:
            nearest = np.linalg.solve(r, Polyhedron(np.linalg.solve(r.T, matrix.T).T, bound).nearest(wanted))
        except Empty:
            raise InputError(conflict(self.design, self.cam)) from None
        return self.nearest(nearest)  # rounding in the change of coordinates may violate rows


def nearest_free_cam(scene: Scene, cam: Lift, *, knot_deg: float = 3.0) -> Lift:
    """The free cam within the design's limits on the shape whose lift differs least from that of `cam`, in root mean
    square [m] over the duration.

    `knot_deg` is the longest knot interval. Raises InputError where the limits contradict each other.
    """
    if scene.design is None:
        raise InputError(f"scene {scene.name}: the nearest free cam needs [design]")
    free = program_cam(scene.design, knot_deg)
    return free.lift(ShapeLimits(free, scene.design).nearest_to(cam))
