"""Houbolt 1950: implicit, four-point backward differences, order 2, stable at every step, damps unresolved modes.

J. C. Houbolt, A recurrence matrix solution for the dynamic response of elastic aircraft, J. Aeronautical Sciences 17
(1950). The position at the end of a step follows from the three positions before it,
(2 M/h^2 + 11 C/(6h) + K) x = F + M (5 x1 - 4 x2 + x3)/h^2 + C (18 x1 - 9 x2 + 2 x3)/(6h).
The set of closed contacts, or of pieces, is iterated within the step until it reproduces itself. The method starts with
Houbolt's difference equations at the first point with fictitious points before it. With these eliminated, the first
step is the linear acceleration method, and the second one uses x(-1) = h^2 a_0 + 2 x_0 - x_1.

Only piecewise linear laws are implemented. At the end of a step friction has the force of sticking throughout the step,
returned to -slip or slip if it is beyond (Simo and Hughes 1998, Computational Inelasticity, section 1.4). Oil leaks by
the trapezoidal rule, which also is of order 2 and stable at every step.

MOTORI's explicit form (K. Osman, MOTORI 2004, Int. J. Traffic and Transport Engineering 4 (2014), Eqs. (9) to (11),
after Levy and Wilkinson 1976): the acceleration at the current point is force by mass, a_0 = F_0/m (9); the next
position follows from the second difference, x1 = 2 x0 - x(-1) + h^2 a_0, and its velocity from the third-order
difference v1 = (11 x1 - 18 x0 + 9 x(-1) - 2 x(-2))/(6 h) (10). Two fictitious points of constant acceleration precede
the start. The paper does not print how the position is advanced; here (9) is taken as the "additional requirement" of
its text. This form is of order 2, and not the one that "always converges": omega h must stay below
sqrt((20/3 zeta)^2 + 4) - 20/3 zeta (a root of the difference equation reaches -1), that is 2 without damping.
"""

import numpy as np

from camopt.cam.lift import Lift
from camopt.programs import compiled
from camopt.scene.response import Response, Revolve
from camopt.scene.train import GROUND, Train
from camopt.verifier.methods.of_houbolt import PieceSets, elements_of, explicit_form, forces, hold

LOST = 0.1
"""Largest decay rate that the method may add to a mode, relative to the mode's or, if larger, to one per revolution."""
STEP_RULE = 0.31
"""Highest frequency times step [rad], Osman 2014, Eq. (11)."""
MOST_SETS = 12
"""Most iterations of the set of pieces per step; if none reproduces itself (force jump at closing), the last counts."""


def step_rule(train: Train) -> float:
    """Largest step [s] by Osman 2014, Eq. (11): 0.31 / omega_max, omega_max = sqrt(k_max / m).

    The paper has one mass; with several, omega_max is the largest value over all masses and their elements.
    """
    highest = 0.0
    for end in (train.a, train.b):
        at = end != GROUND
        highest = max(highest, np.max(train.stiffness[at] / train.mass[end[at]], initial=0.0))
    return STEP_RULE / float(np.sqrt(highest))


def prepare(
    train: Train, lift: Lift, cam_speed: float, steps_per_revolution: int | None = None, explicit: bool = False
) -> Revolve:
    """One revolution by Houbolt's method as a function of its start state (2n + r: [m], [m/s], memories [m]).

    `cam_speed` [rad/s]. Without a number of steps the step follows `step_rule`. `explicit` selects MOTORI's form. The
    implicit form builds its matrices for the sets of pieces that occur. The response has steps_per_revolution + 1
    samples; velocities are third-order backward differences. Raises InputError for laws that are not piecewise linear.
    """
    period = 2 * np.pi / cam_speed
    steps = int(np.ceil(period / step_rule(train))) if steps_per_revolution is None else steps_per_revolution
    n, h = len(train.mass), period / steps
    angle = np.linspace(-np.pi, np.pi, steps + 1)
    forcing = (np.interp(angle, f.angle, f.force) for f in train.forcing)
    cam = np.stack([lift(angle), lift(angle, 1) * cam_speed, *forcing], axis=1)
    if explicit:
        return explicit_form(train, angle, cam, cam_speed, h)
    first = PieceSets(train, 6 / h**2, 3 / h, h)
    later = PieceSets(train, 2 / h**2, 11 / (6 * h), h)
    at_once = elements_of(train, 0.0)

    def revolve(state: np.ndarray) -> Response:
        x, v = np.zeros((steps + 2, n)), np.zeros((steps + 1, n))  # x[0] is the fictitious point before the start
        force, z = np.zeros((steps + 1, len(train.a))), np.zeros((steps + 1, len(train.memory)))
        x[1], v[0], held = state[:n], state[n : 2 * n], np.array(state[2 * n :], dtype=float)
        forces(x[1], v[0], cam[0], at_once, held, force[0], z[0])
        motion = x, v, force, z
        step, key = 2, _start(first, motion, cam, h)
        while step <= steps:
            step, key = _march(step, key, motion, cam, h, later.arrays())
            if step <= steps:
                later.build(key)
        return Response(train, cam_speed, angle, cam[:, 0], x[1:], v, force, z)

    return revolve


def enough_steps(train: Train, cam_speed: float) -> int:
    """Fewest steps per revolution at which the method's numerical damping hardly changes the decay of any mode.

    In terms of D = d/dt the difference (2 - 5/E + 4/E^2 - 1/E^3)/h^2 is D^2 - 11/12 h^2 D^4 + h^3 D^5 - ..., so that an
    undamped mode decays at omega^4 h^3 / 2 [1/s]. At much coarser steps all vibration decays within a revolution, and
    the peak of a force remains too low when such a step is halved.
    """
    period, n = 2 * np.pi / cam_speed, len(train.mass)
    rows = elements_of(train, 0.0).rows
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


def _start(sets: PieceSets, motion: tuple[np.ndarray, ...], cam, h: float) -> int:
    """First step by linear acceleration; fills x[0] (fictitious), x[2], v[1], and forces and memories of the new point.

    `motion` is (x, v, force, z), one row per sample. Returns the number of the new point's set of pieces.
    """
    t, elements, (x, v, force, z) = sets.train, sets.elements, motion
    forcing = np.zeros((2, len(t.mass)))
    for j, mass in enumerate(elements.forced):
        forcing[:, mass] += cam[:2, 2 + j]
    a0 = (t.mass_force - t.mass_damping * v[0] - force[0] @ elements.rows + forcing[0]) / t.mass
    past_acceleration = 6 / h**2 * x[1] + 6 / h * v[0] + 2 * a0
    past_velocity = 3 / h * x[1] + 2 * v[0] + h / 2 * a0
    held = np.empty(z.shape[1])
    hold(elements, force[0], z[0], held)
    key = forces(x[1], v[0], cam[0], elements, held, force[1], z[1])
    for _ in range(MOST_SETS):
        s = sets.build(key)
        right = sets.load[s] @ np.array([1.0, *cam[1, :2], *held]) + forcing[1]
        right += t.mass * past_acceleration + sets.damping[s] @ past_velocity
        x[2] = sets.inverse[s] @ right
        v[1] = 3 / h * x[2] - past_velocity
        new_key = forces(x[2], v[1], cam[1], elements, held, force[1], z[1])
        if new_key == key:
            break
        key = new_key
    x[0] = h**2 * a0 + 2 * x[1] - x[2]
    return key


@compiled
def _march(start, key, motion, cam, h, sets):
    """Steps from `start` on; x is one row ahead of v. Returns the step reached and the current set of pieces, whose
    matrices are missing unless all steps are done."""
    n, (x, v, force, z) = len(sets.mass), motion
    inverse, damping, load, forced = sets.inverse, sets.damping, sets.load, sets.elements.forced
    past_velocity, right, held = np.empty(n), np.empty(n), np.empty(z.shape[1])
    s = -1
    for step in range(start, len(v)):
        x1, x2, x3 = x[step], x[step - 1], x[step - 2]
        hold(sets.elements, force[step - 1], z[step - 1], held)
        for i in range(n):
            past_velocity[i] = (18.0 * x1[i] - 9.0 * x2[i] + 2.0 * x3[i]) / (6.0 * h)
        for _ in range(MOST_SETS):
            s = _place(sets.keys, key, s)
            if s < 0:
                return step, key
            for i in range(n):
                right[i] = load[s, i, 0] + load[s, i, 1] * cam[step, 0] + load[s, i, 2] * cam[step, 1]
                for j in range(len(held)):
                    right[i] += load[s, i, 3 + j] * held[j]
                right[i] += sets.mass[i] * (5.0 * x1[i] - 4.0 * x2[i] + x3[i]) / h**2
                for j in range(n):
                    right[i] += damping[s, i, j] * past_velocity[j]
            for j in range(len(forced)):
                right[forced[j]] += cam[step, 2 + j]
            for i in range(n):
                x[step + 1, i] = 0.0
                for j in range(n):
                    x[step + 1, i] += inverse[s, i, j] * right[j]
                v[step, i] = 11.0 / (6.0 * h) * x[step + 1, i] - past_velocity[i]
            new_key = forces(x[step + 1], v[step], cam[step], sets.elements, held, force[step], z[step])
            if new_key == key:
                break
            key = new_key
    return len(v), key


@compiled
def _place(keys, key, last):
    """Index of `key` in `keys`, -1 if it is missing; index `last` is tried first."""
    if 0 <= last and keys[last] == key:
        return last
    for s in range(len(keys)):
        if keys[s] == key:
            return s
    return -1
