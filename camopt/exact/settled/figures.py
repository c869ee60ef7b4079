"""All declared metrics of one revolution of a traced motion, in compiled code and without cotangents.

Excess lift is computed from cubics through the seat's distance and its slope at every step.
"""

import numpy as np

from camopt.exact.adjoint.closing import seat_distance
from camopt.exact.adjoint.metrics import METRICS, measure
from camopt.exact.kernel.advance import apply
from camopt.programs import inner, njit_no_refcount
from camopt.scene.units import MM

NAMES = (*METRICS, "excess_lift_mm")
"""Names of the metrics, in the order of the rows of `figures`."""
HALVINGS = 40
"""Number of bisections for the zero of the lift above the lash in a step."""


@inner
def figures(s, trace, turn, row):
    """Write the metrics (9) of revolution `turn` to row; the trace must extend to the next opening foot."""
    for metric in range(len(METRICS)):
        row[metric] = measure(metric, s, trace, None, turn)[0]
    row[len(METRICS)] = excess_lift(s, trace, turn)


@inner
def excess_lift(s, trace, turn):
    """Largest excess [mm] of the valve's distance from its seat over the lift above the lash in a revolution."""
    lash, steps, begin = 0.0, s.tables.steps.shape[1] - 1, s.tables.sizes.state
    for e in s.train.cam_side:
        lash += s.train.gap[e]
    best, distances, u = -np.inf, np.empty(2 * (steps + 1)), np.empty(s.tables.sizes.lift)
    for k in range(len(trace.length)):
        if abs(0.5 * (trace.angle[k] + trace.angle[k + 1]) - 2 * np.pi * turn) > np.pi:
            continue
        y = trace.y[k]
        apply(s.tables.distance[trace.slot[k]], y, len(y), 2 * (steps + 1), distances)
        for j in range(len(u)):
            u[j] = y[begin + j]
        whole = min(int(trace.length[k]), steps)
        spans = whole + 1 if trace.length[k] - whole > 0.0 else whole
        for i in range(spans):
            width = 1.0 if i < whole else trace.length[k] - whole
            if i < whole:
                f, m = distances[2 * i + 2], distances[2 * i + 3]
            else:
                f, m = seat_distance(s, trace.y[k + 1])
            cubic = distances[2 * i], distances[2 * i + 1] * width, f, m * width
            best = max(best, excess(cubic, lifted(u, float(i), width, lash), best))
    return best / MM


@njit_no_refcount
def lifted(u, tau, width, lash):
    """Cubic (value, slope, value, slope) of the lift above the lash at both ends of a part of a step."""
    v0, m0, v1, m1 = 0.0, 0.0, 0.0, 0.0
    for k in range(len(u) - 1, -1, -1):
        m0 = m0 * tau + v0
        v0 = v0 * tau + u[k]
        m1 = m1 * (tau + width) + v1
        v1 = v1 * (tau + width) + u[k]
    return v0 - lash, m0 * width, v1 - lash, m1 * width


@njit_no_refcount
def excess(distance, lift, best):
    """Largest distance - max(0, lift) on [0, 1] of cubics (value, slope, value, slope), if it exceeds `best`."""
    apart = (distance[0] - lift[0], distance[1] - lift[1], distance[2] - lift[2], distance[3] - lift[3])
    if lift[0] > 0.0 and lift[2] > 0.0:
        return top(apart, 0.0, 1.0, best)
    if lift[0] <= 0.0 and lift[2] <= 0.0:
        return top(distance, 0.0, 1.0, best)
    low, high, above = 0.0, 1.0, lift[0] > 0.0
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if (value(lift, middle) > 0.0) == above:
            low = middle
        else:
            high = middle
    if above:
        return max(top(apart, 0.0, low, best), top(distance, low, 1.0, best))
    return max(top(distance, 0.0, low, best), top(apart, low, 1.0, best))


@njit_no_refcount
def value(cubic, t):
    """Value at t of a cubic on [0, 1]."""
    f0, m0, f1, m1 = cubic
    return f0 + t * (m0 + t * (3.0 * (f1 - f0) - 2.0 * m0 - m1 + t * (m0 + m1 - 2.0 * (f1 - f0))))


@njit_no_refcount
def top(cubic, low, high, best):
    """Largest value of a cubic in [low, high] if it may exceed `best`; otherwise some value not above `best`."""
    f0, m0, f1, m1 = cubic
    if max(max(f0, f1), max(f0 + max(m0, 0.0), f1 + max(-m1, 0.0))) <= best:
        return min(f0, f1)
    largest = max(value(cubic, low), value(cubic, high))
    b, c, d = m0, 3.0 * (f1 - f0) - 2.0 * m0 - m1, m0 + m1 - 2.0 * (f1 - f0)
    under = c * c - 3.0 * b * d
    if under > 0.0:
        q = -(c + np.sqrt(under)) if c >= 0.0 else -(c - np.sqrt(under))
        for root in (q / (3.0 * d) if d != 0.0 else -1.0, b / q if q != 0.0 else -1.0):
            if low < root < high:
                largest = max(largest, value(cubic, root))
    return largest
