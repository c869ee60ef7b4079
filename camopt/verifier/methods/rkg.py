"""Runge-Kutta-Gill: explicit, order 4 on smooth motion, order 1 across a damped closing (no event is located), order 2
across a corner of a force: a row of a table, friction that starts or stops sliding, oil that starts or stops pushing.

S. Gill, A process for the step-by-step integration of differential equations in an automatic digital computing machine,
Proc. Cambridge Philosophical Society 47 (1951). The method is stable up to about omega h = 2.8. The right-hand side is
assembled element by element at every stage. A contact has the force f = max(0, p + c d') while its elastic force p > 0,
and 0 otherwise. All laws of a scene are implemented: p = preload + k d; p = k u^exponent for a contact compressed by u,
with f = p (1 + dissipation d') under "hunt-crossley"; p = preload + integral of the stiffness table from 0 to d; and p
by linear interpolation in a force table. A memory z is a component of the state. Friction has f = k (d - z), clipped to
-slip and slip, at every stage, and z is updated at the end of a step (the return mapping of plasticity: Simo and Hughes
1998, Computational Inelasticity, section 1.4). Oil has f = k max(0, d - min(z, d) - travel) and z' = f / leak; at the
end of a step, z is set to d if it is larger.
The criterion "displacement" is the one that Kodama prints, for reproduction only: a contact is open if it is not
compressed (their x_3 > x_2), and until then its damper may pull, f = p + c d' of either sign.
"""

from typing import NamedTuple

import numpy as np

from camopt.cam.lift import Lift
from camopt.programs import compiled
from camopt.scene.errors import InputError
from camopt.scene.response import Response, Revolve
from camopt.scene.train import Train

ROOT = np.sqrt(0.5)
WEIGHT = np.array([0.5, 1.0 - ROOT, 1.0 + ROOT, 1.0 / 6.0])
CARRIED = np.array([2.0, 1.0, 1.0, 2.0])
RENEWED = np.array([0.5, 1.0 - ROOT, 1.0 + ROOT, 0.5])
STAGE = np.array([0, 1, 1, 2])
"""Stage times in half steps."""
LINEAR, HERTZ, PROGRESSIVE, TABLE, OIL, FRICTION, HUNT_CROSSLEY = WRITTEN = range(7)
"""Numbers of the laws that are implemented here, as in `camopt.scene.laws.KINDS`."""
MAY_PULL = {"force": False, "displacement": True}
"""Whether the force of a compressed contact may be below zero, by separation criterion."""


def prepare(train: Train, lift: Lift, cam_speed: float, steps_per_revolution: int, criterion: str = "force") -> Revolve:
    """One revolution by Runge-Kutta-Gill as a function of its start state (2n + r: [m], [m/s], memories [m]).

    `cam_speed` [rad/s]; `criterion` states whether a contact opens by "force" or by "displacement" alone (Kodama's).
    The response has steps_per_revolution + 1 samples. Raises InputError for another criterion.
    """
    if criterion not in MAY_PULL:
        raise InputError(f"separation criterion {criterion!r}: expected {' or '.join(MAY_PULL)}")
    train.require_kinds("Runge-Kutta-Gill", WRITTEN, "camopt/verifier/methods/rkg.py")
    steps = steps_per_revolution
    h = 2 * np.pi / cam_speed / steps
    halves = np.linspace(-np.pi, np.pi, 2 * steps + 1)
    rise, rate = lift(halves), lift(halves, 1) * cam_speed
    masses = train.mass, train.mass_damping, train.mass_force
    ends = train.a, train.b, train.contact, train.cam_driven
    numbers = train.damping, train.preload, train.gap, MAY_PULL[criterion]
    forced = np.array([f.on for f in train.forcing], dtype=int)
    arrays = _TrainAsRead(*masses, *ends, *_elastic_arrays(train), *numbers, *_memory_arrays(train), forced)
    push = np.zeros((2 * steps + 1, len(forced)))
    for j, f in enumerate(train.forcing):
        push[:, j] = np.interp(halves, f.angle, f.force)

    def revolve(state: np.ndarray) -> Response:
        states = np.empty((steps + 1, len(state)))
        force = np.empty((steps + 1, len(train.a)))
        _march(np.asarray(state, dtype=float), (rise, rate, push), h, arrays, states, force)
        n = len(train.mass)
        x, v, z = states[:, :n], states[:, n : 2 * n], states[:, 2 * n :]
        return Response(train, cam_speed, halves[::2], rise[::2], x, v, force, z)

    return revolve


class _TrainAsRead(NamedTuple):
    """The arrays of a train for the compiled code."""

    mass: np.ndarray  # (n)
    mass_damping: np.ndarray  # (n)
    mass_force: np.ndarray  # (n)
    a: np.ndarray  # (e)
    b: np.ndarray  # (e)
    contact: np.ndarray  # (e)
    cam_driven: np.ndarray  # (e)
    kind: np.ndarray  # (e) number of the elastic law
    coefficient: np.ndarray  # (e)
    exponent: np.ndarray  # (e)
    dissipation: np.ndarray  # (e)
    table: np.ndarray  # (e, q, 2)
    damping: np.ndarray  # (e)
    preload: np.ndarray  # (e)
    gap: np.ndarray  # (e)
    may_pull: bool  # whether a compressed contact's damper may exceed its spring
    memory: np.ndarray  # (e) index of the element's memory, -1 if it has none
    leak: np.ndarray  # (e)
    travel: np.ndarray  # (e)
    slip: np.ndarray  # (e)
    forced: np.ndarray  # (q) masses on which the forces given over the cam angle act


def _elastic_arrays(train: Train) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Kind (e), coefficient (e), exponent (e), dissipation (e) and table (e, q, 2) of the elastic laws."""
    laws, e = train.laws, len(train.a)
    if laws is not None:
        return laws.kind, laws.coefficient, laws.own_number, laws.dissipation, laws.table
    return np.zeros(e, dtype=int), train.stiffness, np.ones(e), np.zeros(e), np.zeros((e, 1, 2))


def _memory_arrays(train: Train) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Index of the memory or -1, leak, travel and slip of every element, (e) each."""
    memory = np.full(len(train.a), -1)
    memory[list(train.memory)] = np.arange(len(train.memory))
    zero = np.zeros(len(train.a))
    if train.laws is None:
        return memory, zero, zero, zero
    return memory, train.laws.leak, train.laws.travel, train.laws.slip


@compiled
def _elastic(kind, coefficient, exponent, table, preload, d):
    """Elastic force [N] of a law without memory at compression d [m]."""
    if kind == LINEAR:
        return preload + coefficient * d
    if kind == HERTZ or kind == HUNT_CROSSLEY:
        pressed = d + (preload / coefficient) ** (1.0 / exponent)
        return coefficient * pressed**exponent if pressed > 0.0 else 0.0
    if kind == TABLE:
        row = 0
        while row < len(table) - 2 and d > table[row + 1, 0]:
            row += 1
        share = (d - table[row, 0]) / (table[row + 1, 0] - table[row, 0])
        return table[row, 1] + share * (table[row + 1, 1] - table[row, 1])
    if kind == PROGRESSIVE:
        return preload + _work(table, d) - _work(table, 0.0)
    return np.nan  # for a law that is not implemented here


@compiled
def _work(table, d):
    """Integral from the first row of a stiffness `table` (q, 2) to d; the stiffness is constant outside the rows."""
    if d <= table[0, 0]:
        return table[0, 1] * (d - table[0, 0])
    total = 0.0
    for i in range(len(table) - 1):
        width = table[i + 1, 0] - table[i, 0]
        length = min(d, table[i + 1, 0]) - table[i, 0]
        slope = (table[i + 1, 1] - table[i, 1]) / width
        total += length * (table[i, 1] + 0.5 * slope * length)
        if d <= table[i + 1, 0]:
            return total
    return total + table[-1, 1] * (d - table[-1, 0])


@compiled
def _remembering(kind, coefficient, travel, slip, d, z):
    """Force [N] and updated memory [m] of oil or friction at compression d [m], with the memory z [m] before."""
    if kind == OIL:
        z = min(z, d)
        return coefficient * max(0.0, d - z - travel), z
    trial = coefficient * (d - z)
    if abs(trial) <= slip:
        return trial, z
    f = slip if trial > 0.0 else -slip
    return f, d - f / coefficient


@compiled
def _march(start, cam, h, arrays, states, force):
    """All steps of one revolution. Gill's q carries three times the round-off of each step's sum into the next.

    All stages are one loop over plain arrays: reading them from the record `arrays` at every element, or calling a
    function at every stage, counts references and takes ten times as long.
    """
    mass, mass_damping, mass_force, a, b, contact, cam_driven = arrays[:7]
    kind, coefficient, exponent, dissipation, table, damping, preload, gap, may_pull = arrays[7:16]
    memory, leak, travel, slip, forced = arrays[16:]
    rise, rate, push = cam
    n, last = len(mass), len(states) - 1
    y = start.copy()
    q, dy = np.zeros_like(y), np.empty_like(y)
    for stage in range(4 * last + 1):
        step, substage = divmod(stage, 4)
        at = 2 * step + STAGE[substage]
        for i in range(n):
            dy[i] = y[n + i]
            dy[n + i] = mass_force[i] - mass_damping[i] * y[n + i]
        for j in range(len(forced)):
            dy[n + forced[j]] += push[at, j]
        for e in range(len(a)):
            d, d_rate = -gap[e], 0.0
            if a[e] >= 0:
                d += y[a[e]]
                d_rate += y[n + a[e]]
            if b[e] >= 0:
                d -= y[b[e]]
                d_rate -= y[n + b[e]]
            if cam_driven[e]:
                d += rise[at]
                d_rate += rate[at]
            if kind[e] == LINEAR:
                elastic = preload[e] + coefficient[e] * d
            elif memory[e] < 0:
                elastic = _elastic(kind[e], coefficient[e], exponent[e], table[e], preload[e], d)
            else:
                i = 2 * n + memory[e]
                elastic, z = _remembering(kind[e], coefficient[e], travel[e], slip[e], d, y[i])
                dy[i] = elastic / leak[e] if kind[e] == OIL else 0.0
                if substage == 0 and z != y[i]:
                    y[i], q[i] = z, 0.0
            f = elastic + (damping[e] + dissipation[e] * elastic) * d_rate
            if contact[e] and (elastic <= 0.0 or (f < 0.0 and not may_pull)):
                f = 0.0
            if substage == 0:
                force[step, e] = f
            if a[e] >= 0:
                dy[n + a[e]] -= f
            if b[e] >= 0:
                dy[n + b[e]] += f
        if substage == 0:
            states[step] = y
        if stage == 4 * last:
            break
        for i in range(len(y)):
            k = h * (dy[i] / mass[i - n] if n <= i < 2 * n else dy[i])
            moved = y[i] + WEIGHT[substage] * (k - CARRIED[substage] * q[i])
            q[i] += 3.0 * (moved - y[i]) - RENEWED[substage] * k
            y[i] = moved
