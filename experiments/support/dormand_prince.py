"""A general solver for comparison: a compiled adaptive Dormand-Prince 5(4).

It integrates the non-smooth equations with a compiled right-hand side. No event is located; the step control has to
handle the switchings.

J. R. Dormand, P. J. Prince, A family of embedded Runge-Kutta formulae, J. Comp. Appl. Math. 6 (1980); error norm, step
control and dense output after Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, sections II.4, II.6.
The tableau is that of SciPy's class `RK45`, whose own loop runs in Python.
"""

import numpy as np
from scipy.integrate import RK45

from camopt.cam.lift import Lift
from camopt.programs import compiled
from camopt.scene.train import Train

A = np.vstack([np.pad(RK45.A, ((0, 0), (0, 1))), RK45.B])
C = np.append(RK45.C, 1.0)
ERROR = -RK45.E
DENSE = np.array([
    -12715105075 / 11282082432, 0, 87487479700 / 32700410799, -10690763975 / 1880347072,
    701980252875 / 199316789632, -1453857185 / 822651844, 69997945 / 29380423,
])  # fmt: skip
assert abs(DENSE.sum()) < 1e-12


def problem(train: Train, lift: Lift, cam_speed: float) -> tuple:
    """The arrays that the right-hand side reads: masses, ends, laws, and the cam with its speed [rad/s]."""
    masses = train.mass, train.mass_damping, train.mass_force
    ends = train.a, train.b, train.contact, train.cam_driven
    laws = train.stiffness, train.damping, train.preload, train.gap
    return masses, ends, laws, (lift.borders, lift.coefficients, cam_speed)


@compiled
def right_hand_side(t, y, dy, arrays):
    """Writes dy/dt to dy (2n) at the time t [s] after angle -pi. A contact has f = max(0, p + c d') if p > 0, else 0.

    `arrays` is what `problem` gives.
    """
    masses, ends, laws, cam = arrays
    mass, mass_damping, mass_force = masses
    a, b, contact, cam_driven = ends
    stiffness, damping, preload, gap = laws
    rise, rate = _lift(t, cam)
    n = len(mass)
    for i in range(n):
        dy[i] = y[n + i]
        dy[n + i] = mass_force[i] - mass_damping[i] * y[n + i]
    for e in range(len(a)):
        d, d_rate = -gap[e], 0.0
        if a[e] >= 0:
            d += y[a[e]]
            d_rate += y[n + a[e]]
        if b[e] >= 0:
            d -= y[b[e]]
            d_rate -= y[n + b[e]]
        if cam_driven[e]:
            d += rise
            d_rate += rate
        elastic = preload[e] + stiffness[e] * d
        f = elastic + damping[e] * d_rate
        if contact[e] and (elastic <= 0.0 or f < 0.0):
            continue
        if a[e] >= 0:
            dy[n + a[e]] -= f
        if b[e] >= 0:
            dy[n + b[e]] += f
    for i in range(n):
        dy[n + i] /= mass[i]


@compiled
def _lift(t, cam):
    borders, pieces, cam_speed = cam
    theta = (t * cam_speed) % (2.0 * np.pi) - np.pi
    piece = min(max(np.searchsorted(borders, theta, side="right") - 1, 0), len(pieces) - 1)
    row, s = pieces[piece], theta - borders[piece]
    value, slope = 0.0, 0.0
    for k in range(len(row) - 1, -1, -1):
        slope = slope * s + value
        value = value * s + row[k]
    return value, slope * cam_speed


@compiled
def dormand_prince(start, times, rtol, atol, arrays):
    """(states (len(times), 2n) at ascending times [s], number of steps tried), from `start` (2n) at times[0].

    `arrays` is what `problem` gives.
    """
    m, t, end = len(start), times[0], times[-1]
    y, new, k = start.copy(), np.empty(m), np.empty((7, m))
    out = np.empty((len(times), m))
    out[0] = start
    wanted, tried, h, before = 1, 0, 1e-7, 1e-4
    right_hand_side(t, y, k[0], arrays)
    while t < end:
        h = min(h, end - t)
        tried += 1
        for stage in range(1, 7):
            for i in range(m):
                total = 0.0
                for j in range(stage):
                    total += A[stage, j] * k[j, i]
                new[i] = y[i] + h * total
            right_hand_side(t + C[stage] * h, new, k[stage], arrays)
        square = 0.0
        for i in range(m):
            error = 0.0
            for j in range(7):
                error += ERROR[j] * k[j, i]
            square += (h * error / (atol + rtol * max(abs(y[i]), abs(new[i])))) ** 2
        norm = max(np.sqrt(square / m), 1e-10)
        factor = 0.9 * norm**-0.17 * before**0.04
        if norm > 1.0:
            h *= max(0.2, min(1.0, factor))
            continue
        after = end if end - t <= h else t + h
        while wanted < len(times) and times[wanted] <= after:
            _dense(y, new, k, h, (times[wanted] - t) / h, out[wanted])
            wanted += 1
        t, before = after, max(norm, 1e-4)
        y[:] = new
        k[0] = k[6]
        h *= max(0.2, min(10.0, factor))
    return out, tried


@compiled
def _dense(y, new, k, h, s, out):
    """State at the share s of a step."""
    for i in range(len(y)):
        bend = 0.0
        for j in range(7):
            bend += DENSE[j] * k[j, i]
        rise = new[i] - y[i]
        first = h * k[0, i] - rise
        second = rise - h * k[6, i] - first
        out[i] = y[i] + s * (rise + (1.0 - s) * (first + s * (second + (1.0 - s) * h * bend)))
