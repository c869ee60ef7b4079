"""Stationary points and roots of a chain of cubics, in compiled code, which the tests' shape checks cannot wrap."""

import numpy as np

from camopt.programs import compiled

BISECTIONS = 52
"""Number of times that a step is halved to locate a root, which reaches the rounding of the angle."""


@compiled
def with_stationary_points(angle, y, step, c):
    """Ascending angles, and values, of the samples y (k) and all stationary points of the cubics c (4, k - 1)."""
    knot, value, count = np.empty(3 * len(y)), np.empty(3 * len(y)), 0
    for i in range(len(y)):
        knot[count], value[count] = angle[i], y[i]
        count += 1
        if i == len(step) or not c[2, i] * c[2, i] > 3.0 * c[1, i] * c[3, i]:
            continue
        root = np.sqrt(c[2, i] * c[2, i] - 3.0 * c[1, i] * c[3, i])
        q = -(c[2, i] + (root if c[2, i] >= 0.0 else -root))
        u1, u2 = q / (3.0 * c[3, i]), c[1, i] / q
        for u in (min(u1, u2), max(u1, u2)):
            if 0.0 < u < 1.0:
                knot[count] = angle[i] + u * step[i]
                value[count] = c[0, i] + u * (c[1, i] + u * (c[2, i] + u * c[3, i]))
                count += 1
    return knot[:count].copy(), value[:count].copy()


@compiled
def sign_changes(angle, step, c, knot, value):
    """Angles [rad] at which the sign of cubics c (4, k - 1) changes, and whether the value falls there.

    `knot` and `value` are those of `with_stationary_points`. A root is bracketed by BISECTIONS halvings.
    """
    at, falling, count, i = np.empty(len(knot)), np.empty(len(knot), np.bool_), 0, 0
    for k in range(len(knot) - 1):
        above = value[k] > 0.0
        if (value[k + 1] > 0.0) == above:
            continue
        middle = 0.5 * (knot[k] + knot[k + 1])
        while i < len(step) - 1 and angle[i + 1] <= middle:
            i += 1
        low = min(max((knot[k] - angle[i]) / step[i], 0.0), 1.0)
        high = min(max((knot[k + 1] - angle[i]) / step[i], 0.0), 1.0)
        for _ in range(BISECTIONS):
            u = 0.5 * (low + high)
            if (c[0, i] + u * (c[1, i] + u * (c[2, i] + u * c[3, i])) > 0.0) == above:
                low = u
            else:
                high = u
        at[count], falling[count] = angle[i] + high * step[i], above
        count += 1
    return at[:count].copy(), falling[:count].copy()
