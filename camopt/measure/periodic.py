"""The periodic motion as a fixed point of the cycle map, found directly, and its stability.

The cycle map G maps the state at -180 degrees to the state one revolution later. After two plain revolutions Anderson
acceleration follows (D. G. Anderson, Iterative procedures for nonlinear integral equations, J. ACM 12 (1965), in the
least-squares form of Walker and Ni, SIAM J. Numerical Analysis 49 (2011)), and then Newton's method on G(y) - y. A
fixed point is a stable motion only if the spectral radius of G's Jacobian is below one there.

For damped trains plain iteration is as fast; use this only when surge decays slowly, or when the state is needed to
nanometres. The spectral radius costs 2n + r revolutions, and kinks of G by bouncing contacts stop both accelerations.
"""

from dataclasses import dataclass

import numpy as np
from numpy.linalg import LinAlgError

from camopt.scene.errors import MotionRefused
from camopt.scene.response import Revolve, next_state
from camopt.scene.shapes import Float, State

UNIT = (1e-6, 1e-3)
"""Units of position [m] and velocity [m/s] in a scaled state: the tolerances for a settled state."""
ACCURACY = 1e-4
"""Largest change of a periodic state over a revolution, in UNIT: 0.1 nm and 0.1 um/s."""
DIFFERENCE = 1e-2
"""Step of the finite differences, in UNIT. It is far above the round-off of a revolution and far below a bounce."""
PLAIN, DEPTH, MOST_ACCELERATED, MOST_NEWTON = 2, 5, 25, 4
"""Number of initial plain revolutions, number of earlier states in Anderson's combination, and largest numbers of
Anderson's revolutions and of Newton's steps."""
WANDERING = 28
"""Number of plain revolutions to the returned state, away from an unstable one, if no stable state was found."""
LARGEST_RADIUS = 1 - 1e-3
"""Largest spectral radius of a stable fixed point; finite differences cannot distinguish larger ones from one."""
SMALLEST_DIRECTION = 1e-8
"""Relative singular value below which a direction of the mixed states is round-off."""


@dataclass(frozen=True)
class PeriodicState:
    """A stable periodic state or, if none was found, a state after a number of plain revolutions.

    A state (2n + r) is positions [m], velocities [m/s] and memories [m] at -180 degrees.
    """

    periodic: bool
    state: State
    residual: float  # smallest change over a revolution that was reached, in units of 1 um and 1 mm/s
    multipliers: np.ndarray  # (2n + r) Floquet multipliers, the eigenvalues of the map's Jacobian
    revolutions: int  # total number simulated, including those of the finite differences

    @property
    def radius(self) -> float:
        """Spectral radius of the cycle map's Jacobian at the fixed point, or NaN if there is no fixed point."""
        return float(np.abs(self.multipliers).max()) if len(self.multipliers) else np.nan


class _Cycle:
    """The cycle map of states in UNIT, with a count of revolutions. Raises MotionRefused for states not finite."""

    def __init__(self, revolve: Revolve, n: int, memories: int):
        self.revolve, self.count = revolve, 0
        self.scale = np.repeat((*UNIT, UNIT[0]), (n, n, memories))

    def __call__(self, y: State) -> State:
        self.count += 1
        after = next_state(self.revolve, y * self.scale) / self.scale
        if not np.all(np.isfinite(after)):
            raise MotionRefused(
                "the motion has no bound: the step is above the method's stability limit: take a smaller one"
            )
        return after

    def jacobian(self, y: State, after: State) -> Float[np.ndarray, "state state"]:
        """The Jacobian of the map at y, whose image is `after`, by forward differences."""
        columns = [(self(y + DIFFERENCE * unit) - after) / DIFFERENCE for unit in np.eye(len(y))]
        return np.stack(columns, axis=1)


def periodic_state(revolve: Revolve, state: State, *, memories: int = 0) -> PeriodicState:
    """The periodic state of a method's revolution, searched for from `state` (2n + r: [m], [m/s], [m]).

    `memories` is r, the number of elements with a memory. A periodic state changes by at most 0.1 nm and 0.1 um/s over
    a revolution. Raises MotionRefused if the plain motion is unbounded.
    """
    cycle = _Cycle(revolve, (len(state) - memories) // 2, memories)
    y = state / cycle.scale
    for _ in range(PLAIN):
        y = cycle(y)
    plain = y
    y, after = _anderson(cycle, y)
    y, after = _newton(cycle, y, after)
    residual = _size(after - y)
    multipliers = np.linalg.eigvals(cycle.jacobian(y, after)) if residual < ACCURACY else np.empty(0)
    if len(multipliers) and np.abs(multipliers).max() < LARGEST_RADIUS:
        return PeriodicState(True, y * cycle.scale, residual, multipliers, cycle.count)
    for _ in range(WANDERING):
        plain = cycle(plain)
    return PeriodicState(False, plain * cycle.scale, residual, multipliers, cycle.count)


def _size(change: np.ndarray) -> float:
    """The largest component of a change, in UNIT."""
    return float(np.abs(change).max())


def _anderson(cycle: _Cycle, y: State) -> tuple[State, State]:
    """The best state reached by Anderson acceleration from y, and its image; all states are in UNIT.

    If the motion from a combined state is refused, a plain step is taken.
    """
    best = y, cycle(y)
    states, images = [best[0]], [best[1]]
    for _ in range(MOST_ACCELERATED):
        if _size(best[1] - best[0]) < ACCURACY:
            break
        new = _combined(np.array(states), np.array(images))
        try:
            image = cycle(new)
        except MotionRefused:
            states, images = [], []
            new = best[1]
            image = cycle(new)
        states, images = [*states, new][-DEPTH - 1 :], [*images, image][-DEPTH - 1 :]
        if _size(image - new) < _size(best[1] - best[0]):
            best = new, image
    return best


def _combined(states: Float[np.ndarray, "m state"], images: Float[np.ndarray, "m state"]) -> State:
    """The combination of the last m images whose change over a revolution is, to first order, the smallest."""
    change = images - states
    differences = np.diff(change, axis=0).T
    if differences.size == 0:
        return images[-1]
    share = np.linalg.lstsq(differences, change[-1], rcond=SMALLEST_DIRECTION)[0]
    return images[-1] - np.diff(images, axis=0).T @ share


def _newton(cycle: _Cycle, y: State, after: State) -> tuple[State, State]:
    """The state and its image after Newton's method on G(y) - y, which continues while a step halves the change."""
    for _ in range(MOST_NEWTON):
        if _size(after - y) < ACCURACY:
            break
        try:
            new = y - np.linalg.solve(cycle.jacobian(y, after) - np.eye(len(y)), after - y)
            image = cycle(new)
        except (MotionRefused, LinAlgError):  # if friction always sticks, every such state is periodic
            break
        if _size(image - new) > 0.5 * _size(after - y):
            break
        y, after = new, image
    return y, after
