"""Houbolt 1950: implicit, four-point backward differences, order 2, stable at every step, damps unresolved modes.

J. C. Houbolt, A recurrence matrix solution for the dynamic response of elastic aircraft, J. Aeronautical Sciences 17
(1950). The position of a step solves, with the three positions before it,
(2 M/h^2 + 11 C/(6h) + K) x = F + M (5 x1 - 4 x2 + x3)/h^2 + C (18 x1 - 9 x2 + 2 x3)/(6h).
The closed set is iterated within the step until it reproduces itself. Start: Houbolt's difference equations at the
first point, with fictitious points before it; eliminated, they are the linear acceleration method for the first step,
and the second step reads x(-1) = h^2 a_0 + 2 x_0 - x_1.

MOTORI's explicit form (K. Osman, MOTORI 2004, Int. J. Traffic and Transport Engineering 4 (2014), Eqs. (9) to (11),
after Levy and Wilkinson 1976): the acceleration at the current point is force by mass, a_0 = F_0/m (9), the next
position follows from the second difference with it, x1 = 2 x0 - x(-1) + h^2 a_0, and its velocity from the third-order
difference v1 = (11 x1 - 18 x0 + 9 x(-1) - 2 x(-2))/(6 h) (10); before the start stand two fictitious points of constant
acceleration. The paper does not print how the position is advanced; in this reading (9) is the "additional requirement"
of its text. Order 2, and not the form that "always converges": omega h must stay below
sqrt((20/3 zeta)^2 + 4) - 20/3 zeta (a root of the difference equation reaches -1), that is 2 without damping.
"""

from typing import NamedTuple

import numpy as np

from camopt.cam.lift import Lift
from camopt.programs import compiled
from camopt.scene.response import Response, Revolve
from camopt.scene.train import GROUND, Train

LOST = 0.1
"""Share of a mode's own decay, or of one revolution's, that the method's decay may add."""
STEP_RULE = 0.31
"""Highest frequency times step [rad], Osman 2014, Eq. (11)."""
MOST_SETS = 12
"""Trials of a closed set per step; where none reproduces itself (the force jumps at closing) the last is kept."""


def step_rule(train: Train) -> float:
    """Largest step [s] by Osman 2014, Eq. (11): 0.31 / omega_max, omega_max = sqrt(k_max / m).

    The paper has one mass; with several, omega_max is the largest such value of a mass and an element at it.
    """
    highest = 0.0
    for end in (train.a, train.b):
        at = end != GROUND
        highest = max(highest, np.max(train.stiffness[at] / train.mass[end[at]], initial=0.0))
    return STEP_RULE / float(np.sqrt(highest))


def prepare(
    train: Train, lift: Lift, cam_speed: float, steps_per_revolution: int | None = None, explicit: bool = False
) -> Revolve:
    """One revolution by Houbolt's method as a function of its start state (2n: positions [m], velocities [m/s]).

    `cam_speed` [rad/s]; the step follows `step_rule` where the number of steps is left out; `explicit` takes MOTORI's
    form. Implicit, matrices are built for the contact sets that occur. The response has steps_per_revolution + 1
    samples; its velocities are third-order backward differences. Raises InputError for laws that are not linear.
    """
    train.require_linear("Houbolt's method", 'use method "dop853" or "rkg"')
    period = 2 * np.pi / cam_speed
    steps = int(np.ceil(period / step_rule(train))) if steps_per_revolution is None else steps_per_revolution
    n, h = len(train.mass), period / steps
    angle = np.linspace(-np.pi, np.pi, steps + 1)
    cam = np.stack([lift(angle), lift(angle, 1) * cam_speed], axis=1)
    if explicit:
        return _explicit(train, angle, cam, cam_speed, h)
    first = _ClosedSets(train, 6 / h**2, 3 / h)
    later = _ClosedSets(train, 2 / h**2, 11 / (6 * h))

    def revolve(state: np.ndarray) -> Response:
        x, v = np.zeros((steps + 2, n)), np.zeros((steps + 1, n))  # x[0] is the fictitious point before the start
        force = np.zeros((steps + 1, len(train.a)))
        x[1], v[0] = state[:n], state[n:]
        _start(first, x, v, force, cam, h)
        step, mask = 2, _bits(first.closed(force[1]))
        while step <= steps:
            step, mask = _march(step, mask, _Revolution(x, v, force), cam, h, later.arrays())
            if step <= steps:
                later.build(mask)
        return Response(train, cam_speed, angle, cam[:, 0], x[1:], v, force)

    return revolve


def enough_steps(train: Train, cam_speed: float) -> int:
    """Steps per revolution from which the method's own damping leaves the ringing of every mode to the train.

    In terms of D = d/dt the difference (2 - 5/E + 4/E^2 - 1/E^3)/h^2 is D^2 - 11/12 h^2 D^4 + h^3 D^5 - ..., so that an
    undamped mode decays at omega^4 h^3 / 2 [1/s]. At steps much coarser than this all ringing is gone within a
    revolution, and the peak of a force stands too low however the step is halved.
    """
    period, n = 2 * np.pi / cam_speed, len(train.mass)
    rows = _rows(train)
    stiffness = rows.T @ (train.stiffness[:, None] * rows)
    damping = np.diag(train.mass_damping) + rows.T @ (train.damping[:, None] * rows)
    system = np.zeros((2 * n, 2 * n))
    system[:n, n:] = np.eye(n)
    system[n:] = np.hstack([-stiffness, -damping]) / train.mass[:, None]
    roots = np.linalg.eigvals(system)
    ringing = roots[roots.imag > 0]
    allowed = LOST * np.maximum(-ringing.real, 1 / period)
    shortest = np.min((2 * allowed / np.abs(ringing) ** 4) ** (1 / 3), initial=period)
    return int(np.ceil(period / shortest))


prepare.enough_steps = enough_steps  # pyright: ignore[reportFunctionMemberAccess]


def _explicit(train: Train, angle, cam, cam_speed: float, h: float) -> Revolve:
    """MOTORI's form on the samples `angle` (k), with the lift and its velocity at them in `cam` (k, 2)."""
    n, samples = len(train.mass), len(angle)
    masses, elements = (train.mass, train.mass_damping, train.mass_force), _elements(train)

    def revolve(state: np.ndarray) -> Response:
        x, v, force = np.zeros((samples + 2, n)), np.zeros((samples, n)), np.zeros((samples, len(train.a)))
        x[2], v[0] = state[:n], state[n:]  # x[0] and x[1] are the fictitious points before the start
        _march_explicit(_Revolution(x, v, force), cam, h, masses, elements)
        return Response(train, cam_speed, angle, cam[:, 0], x[2:], v, force)

    return revolve


class _Elements(NamedTuple):
    """The elements of a train as the compiled code reads them."""

    rows: np.ndarray  # (e, n) compression of each element by position
    contact: np.ndarray  # (e)
    cam_driven: np.ndarray  # (e)
    stiffness: np.ndarray  # (e)
    damping: np.ndarray  # (e)
    preload: np.ndarray  # (e)
    gap: np.ndarray  # (e)


class _Sets(NamedTuple):
    """Masses, elements, and the matrices of every closed set that has occurred, by `slot` of its bit mask."""

    mass: np.ndarray  # (n)
    elements: _Elements
    slot: np.ndarray  # (2^contacts), -1 where nothing is built
    inverse: np.ndarray  # (s, n, n)
    damping: np.ndarray  # (s, n, n)
    load: np.ndarray  # (s, n, 3) by 1, lift and lift velocity


class _Revolution(NamedTuple):
    """The revolution that is being written, a row a sample; x has one or two fictitious rows before the start."""

    x: np.ndarray
    v: np.ndarray
    force: np.ndarray


def _rows(train: Train) -> np.ndarray:
    """Compression of each element by position, shape (e, n)."""
    padded = np.eye(len(train.mass) + 1)[:, :-1]  # index -1 (ground) reads the row of zeros
    return padded[train.a] - padded[train.b]


def _elements(train: Train) -> _Elements:
    numbers = train.contact, train.cam_driven, train.stiffness, train.damping, train.preload, train.gap
    return _Elements(_rows(train), *numbers)


class _ClosedSets:
    """Inverse effective stiffness and loads by closed set, for x'' = m x + ..., x' = c x + ... at the new point."""

    def __init__(self, train: Train, m: float, c: float):
        self.train, self.m, self.c = train, m, c
        n, contacts = len(train.mass), int(train.contact.sum())
        self.elements = _elements(train)
        self.slot = np.full(2**contacts, -1)
        self.inverse, self.damping, self.load = np.zeros((0, n, n)), np.zeros((0, n, n)), np.zeros((0, n, 3))

    def closed(self, force: np.ndarray) -> np.ndarray:
        """Which contacts push, shape (contacts)."""
        return force[self.train.contact] > 0

    def build(self, mask: int) -> int:
        """Slot of a closed set, built if it is new."""
        if self.slot[mask] >= 0:
            return int(self.slot[mask])
        t, rows = self.train, self.elements.rows
        acting = ~t.contact
        acting[np.flatnonzero(t.contact)] = (mask >> np.arange(int(t.contact.sum()))) & 1 == 1
        k, c = t.stiffness * acting, t.damping * acting
        damping = np.diag(t.mass_damping) + np.einsum("e,ei,ej->ij", c, rows, rows)
        stiffness = np.einsum("e,ei,ej->ij", k, rows, rows)
        effective = self.m * np.diag(t.mass) + self.c * damping + stiffness
        parts = (t.preload * acting - k * t.gap, k * t.cam_driven, c * t.cam_driven)
        load = np.stack([-p @ rows for p in parts], axis=1)
        load[:, 0] += t.mass_force
        self.inverse = np.concatenate([self.inverse, np.linalg.inv(effective)[None]])
        self.damping = np.concatenate([self.damping, damping[None]])
        self.load = np.concatenate([self.load, load[None]])
        self.slot[mask] = len(self.inverse) - 1
        return int(self.slot[mask])

    def arrays(self) -> _Sets:
        return _Sets(self.train.mass, self.elements, self.slot, self.inverse, self.damping, self.load)


def _bits(closed: np.ndarray) -> int:
    return int(closed @ (1 << np.arange(len(closed))))


def _start(sets: _ClosedSets, x, v, force, cam, h: float) -> None:
    """First step by linear acceleration; fills x[0] (fictitious), x[2], v[1] and the forces of both points."""
    t, elements = sets.train, sets.elements
    mask = _forces(x[1], v[0], cam[0], elements, force[0])
    a0 = (t.mass_force - t.mass_damping * v[0] - force[0] @ elements.rows) / t.mass
    past_acceleration = 6 / h**2 * x[1] + 6 / h * v[0] + 2 * a0
    past_velocity = 3 / h * x[1] + 2 * v[0] + h / 2 * a0
    for _ in range(MOST_SETS):
        s = sets.build(mask)
        right = sets.load[s] @ np.array([1.0, *cam[1]]) + t.mass * past_acceleration + sets.damping[s] @ past_velocity
        x[2] = sets.inverse[s] @ right
        v[1] = 3 / h * x[2] - past_velocity
        found = _forces(x[2], v[1], cam[1], elements, force[1])
        if found == mask:
            break
        mask = found
    x[0] = h**2 * a0 + 2 * x[1] - x[2]


@compiled
def _forces(x, v, cam, elements, force):
    """Element forces into `force` (e) by the contact law; returns the bit mask of the contacts that push."""
    mask, bit = 0, 1
    for e in range(len(elements.contact)):
        compression, rate = -elements.gap[e], 0.0
        for i in range(len(x)):
            compression += elements.rows[e, i] * x[i]
            rate += elements.rows[e, i] * v[i]
        if elements.cam_driven[e]:
            compression += cam[0]
            rate += cam[1]
        spring = elements.preload[e] + elements.stiffness[e] * compression
        force[e] = spring + elements.damping[e] * rate
        if elements.contact[e]:
            if spring > 0.0 and force[e] > 0.0:
                mask += bit
            else:
                force[e] = 0.0
            bit *= 2
    return mask


@compiled
def _march(start, mask, motion, cam, h, sets):
    """Steps from `start` on, x being one row ahead of v; returns the step reached and the set in use or missing."""
    n, x, v = len(sets.mass), motion.x, motion.v
    inverse, damping, load = sets.inverse, sets.damping, sets.load
    past_velocity, right = np.empty(n), np.empty(n)
    for step in range(start, len(v)):
        x1, x2, x3 = x[step], x[step - 1], x[step - 2]
        for i in range(n):
            past_velocity[i] = (18.0 * x1[i] - 9.0 * x2[i] + 2.0 * x3[i]) / (6.0 * h)
        for _ in range(MOST_SETS):
            s = sets.slot[mask]
            if s < 0:
                return step, mask
            for i in range(n):
                right[i] = load[s, i, 0] + load[s, i, 1] * cam[step, 0] + load[s, i, 2] * cam[step, 1]
                right[i] += sets.mass[i] * (5.0 * x1[i] - 4.0 * x2[i] + x3[i]) / h**2
                for j in range(n):
                    right[i] += damping[s, i, j] * past_velocity[j]
            for i in range(n):
                x[step + 1, i] = 0.0
                for j in range(n):
                    x[step + 1, i] += inverse[s, i, j] * right[j]
                v[step, i] = 11.0 / (6.0 * h) * x[step + 1, i] - past_velocity[i]
            found = _forces(x[step + 1], v[step], cam[step], sets.elements, motion.force[step])
            if found == mask:
                break
            mask = found
    return len(v), mask


@compiled
def _march_explicit(motion, cam, h, masses, elements):
    """All steps from x[2], v[0] on, x being two rows ahead of v; forces at every point."""
    mass, mass_damping, mass_force = masses
    x, v, force = motion.x, motion.v, motion.force
    for step in range(len(v)):
        _forces(x[step + 2], v[step], cam[step], elements, force[step])
        for i in range(len(mass)):
            acceleration = mass_force[i] - mass_damping[i] * v[step, i]
            for e in range(len(elements.rows)):
                acceleration -= elements.rows[e, i] * force[step, e]
            acceleration /= mass[i]
            x0 = x[step + 2, i]
            if step == 0:
                x[1, i] = x0 - h * v[0, i] + 0.5 * h**2 * acceleration
                x[0, i] = x0 - 2.0 * h * v[0, i] + 2.0 * h**2 * acceleration
            if step + 1 < len(v):
                x1 = 2.0 * x0 - x[step + 1, i] + h**2 * acceleration
                v[step + 1, i] = (11.0 * x1 - 18.0 * x0 + 9.0 * x[step + 1, i] - 2.0 * x[step, i]) / (6.0 * h)
                x[step + 3, i] = x1
