"""The augmented Lagrangian of an objective with path constraints, and the metric in which its steps are taken.

The contact force or a gap is limited at every angle of one revolution and at every speed. The motion has tied contacts
(`camopt.smooth.tied`), so that these paths have slopes long before a contact opens. Every row h >= 0 is in units of its
limit; a force, whose limit is usually zero, is in units of the median contact force in the start's event. The value v
to be maximised is replaced by

    v - sum_i (max(0, m_i - w h_i)^2 - m_i^2) / (2 w)

with multipliers m >= 0 and a weight w (Powell 1969; Rockafellar 1973). Multipliers and weight, and the angles at which
the valve must be seated, are constant for a round of steps. After a round m becomes max(0, m - w h), and w grows unless
the largest violation has shrunk enough. At each step the revolution starts in the state in which that of the previous
step ended; this state counts as constant in the gradient.
"""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from camopt.cam.lift import Lift
from camopt.optimizer.ascent.objective import FORCE, GAP, SEAT_GAP, BoundObjective
from camopt.optimizer.search.smooth_rows import in_event, on_seat
from camopt.scene.errors import InputError
from camopt.scene.train import build_train
from camopt.scene.units import MM
from camopt.smooth.grid import equal_grid
from camopt.smooth.periodic_slopes import TiedMotions
from camopt.smooth.tied import TiedPaths, path_angles

PATH_OF = {FORCE: (1.0, 1.0, "force"), GAP: (-1.0, MM, "gap"), SEAT_GAP: (-1.0, MM, "seat_gap")}
"""For each constraint: its sign (1 for a lower limit, -1 for an upper one), its unit, and the path that it limits."""
FIRST_WEIGHT, GROWTH = 0.005, 1.5
"""The first weight of a violation, and the factor by which it grows. A hundred times the first weight misleads the
ascent on `kodama`: its steps then follow the limits instead of the area."""
SHRUNK = 0.5
"""The weight stays constant if the largest violation is below this share of that of the previous round."""
RIDGE = 1e-6
"""Share of the Gauss-Newton matrix's largest eigenvalue that is added to all, for directions that change no row."""


class Round(NamedTuple):
    """The constants of the Lagrangian: the start for one step, all others for a round of steps."""

    start: jax.Array  # (2, n + r, b), the state in which the revolution starts
    seated: jax.Array  # (k, b), whether the valve must be on its seat
    force_unit: jax.Array  # N
    multipliers: dict[str, jax.Array]  # of each constraint, in the shape of its rows
    weight: jax.Array
    worst: jax.Array  # the largest violation when the round began


class PathLagrangian:
    """The Lagrangian of a bound objective with constraints, in JAX."""

    def __init__(self, bound: BoundObjective):
        objective, half = bound.objective, float(bound.cam.half_duration(bound.cam.parameters))
        self._cam, self._limits, self._train = bound.cam, objective.constraints, build_train(objective.scene)
        event, steps = (-half, half), objective.smoothing.steps  # an ascent keeps the duration
        speeds = np.array([objective.scene.cam_speed(rpm) for rpm in objective.speeds_rpm])
        self._motions = TiedMotions(self._train, speeds, event, objective.smoothing)
        self._event = in_event(path_angles(steps), event)
        self._theta = jnp.asarray(equal_grid(steps))

    def _samples(self, parameters: Mapping[str, Any]) -> jax.Array:
        """Lift and slope of the cam (k + 1, 2) at the ends of the steps."""
        return jnp.stack([self._cam.lift(self._theta, dict(parameters), order) for order in (0, 1)], axis=-1)

    def begin(self, parameters: Mapping[str, Any], lift: Lift) -> Round:
        """The constants of the first round, from the settled motion of a cam. Raises InputError if it is not finite."""
        _, paths = self._motions.settled(jax.jit(self._samples)(parameters))
        if not np.all(np.isfinite(paths.end)):
            raise InputError(
                "ascend: the start's smoothed motion with tied contacts grows without bound at one of the speeds: take "
                "start='calmest', other speeds or a larger width_um"
            )
        unit = jnp.asarray(np.median(np.abs(np.asarray(paths.force)[self._event])))
        weight, worst = (jnp.asarray(number, float) for number in (FIRST_WEIGHT, np.inf))
        current = Round(paths.end, self._seated(lift, paths), unit, {}, weight, worst)
        rows = jax.eval_shape(self.rows, current, paths)
        return current._replace(multipliers={name: jnp.zeros(row.shape) for name, row in rows.items()})

    def paths(self, parameters: Mapping[str, Any], current: Round, adjoint: str = "reverse") -> TiedPaths:
        """The paths of one revolution of the cam with these parameters."""
        return self._motions.revolution(self._samples(parameters), current.start, adjoint)

    def rows(self, current: Round, paths: TiedPaths) -> dict[str, jax.Array]:
        """For each constraint the rows (k, ..., b), which must be >= 0; infinite at angles without it."""
        units, rows = self._units(current), {}
        for name, limit in self._limits.items():
            sign, unit, path = PATH_OF[name]
            room = sign * (getattr(paths, path) - limit * unit)
            limited = current.seated if name == SEAT_GAP else self._event[:, None, None]
            rows[name] = jnp.where(limited, room / units[name], jnp.inf)
        return rows

    def __call__(self, value, parameters: Mapping[str, Any], current: Round) -> tuple[jax.Array, dict, TiedPaths]:
        """The Lagrangian of a value, for each constraint the worst value of its path [its unit], and the paths."""
        paths, worst, units = self.paths(parameters, current), {}, self._units(current)
        for name, row in self.rows(current, paths).items():
            m, w = current.multipliers[name], current.weight
            value = value - jnp.sum(jnp.maximum(0.0, m - w * row) ** 2 - m**2) / (2 * w)
            sign, unit, _ = PATH_OF[name]
            worst[name] = self._limits[name] + sign * jnp.min(row) * units[name] / unit
        return value, worst, paths

    def next(self, lift: Lift, current: Round, paths: TiedPaths) -> Round:
        """The constants of the next round, after a round that ended with these paths of a cam."""
        multipliers, weight, worst = jax.jit(self._multipliers)(current, paths)
        return Round(paths.end, self._seated(lift, paths), current.force_unit, multipliers, weight, worst)

    def _multipliers(self, current: Round, paths: TiedPaths):
        rows = self.rows(current, paths)
        worst = jnp.maximum(0.0, -jnp.min(jnp.stack([jnp.min(row) for row in rows.values()])))
        multipliers = {n: jnp.maximum(0.0, current.multipliers[n] - current.weight * row) for n, row in rows.items()}
        return multipliers, current.weight * jnp.where(worst > SHRUNK * current.worst, GROWTH, 1.0), worst

    def metric(self, parameters: Callable[[jax.Array], Mapping[str, Any]], vector: np.ndarray, current: Round):
        """Matrix (m, m) whose columns are steps of a vector (m). Each step changes the rows by one unit in root mean
        square, and these changes are orthogonal. It follows from one Gauss-Newton matrix at the vector."""

        def scaled_rows(vector):
            rows = self.rows(current, self.paths(parameters(vector), current, "forward"))
            row = jnp.concatenate([row.ravel() for row in rows.values()])
            return jnp.where(jnp.isfinite(row), row, 0.0) / jnp.sqrt(jnp.sum(jnp.isfinite(row)))

        at = jnp.asarray(vector)
        along = jax.vmap(lambda direction: jax.jvp(scaled_rows, (at,), (direction,))[1])
        slopes = np.asarray(jax.jit(along)(jnp.eye(len(vector))))  # (m, r)
        size, directions = np.linalg.eigh(slopes @ slopes.T)
        return directions / np.sqrt(size + RIDGE * size.max())

    def _seated(self, lift: Lift, paths: TiedPaths) -> jax.Array:
        gaps = np.asarray(paths.seat_gap).T
        return jnp.asarray(np.stack([on_seat(lift, self._train.lash, gap) for gap in gaps], axis=-1))

    def _units(self, current: Round) -> dict[str, Any]:
        """The unit of the rows of each constraint [N] or [m]."""
        return {name: current.force_unit if name == FORCE else limit * MM for name, limit in self._limits.items()}
