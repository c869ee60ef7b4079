"""Bounce, jump, seating velocity and contact forces of recorded revolutions, as defined in docs/model.md.

The evaluation is independent of camopt's: between two steps of the solver the motion is the cubic Hermite interpolant
of positions and velocities, which is evaluated at a few additional points.
"""

import numpy as np

from camopt.verifier.outside.engine import FiledMotion
from camopt.verifier.outside.filed import GROUND, MM, FiledCam, FiledElement, FiledTrain
from camopt.verifier.outside.forces import NEVER_PULLS, compression, force, lift, touch

BETWEEN = 4
"""Evaluation points per step of the solver."""
TURN = 2 * np.pi


def hermite(angle: np.ndarray, y: np.ndarray, slope: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values and slopes (m, n) at angles `at` (m) of the cubic interpolant of `y` and `slope` (k, n) at angles (k)."""
    i = np.clip(np.searchsorted(angle, at, "right") - 1, 0, len(angle) - 2)
    h = (angle[i + 1] - angle[i])[:, None]
    u = (at - angle[i])[:, None] / h
    begin, end, by_begin, by_end = y[i], y[i + 1], h * slope[i], h * slope[i + 1]
    rise = end - begin
    b, c = 3 * rise - 2 * by_begin - by_end, by_begin + by_end - 2 * rise
    return begin + u * (by_begin + u * (b + u * c)), (by_begin + u * (2 * b + 3 * u * c)) / h


def path_from_cam(train: FiledTrain) -> list[FiledElement]:
    """The elements on the shortest path from the cam-driven one to the valve; the path does not pass through ground."""
    ways = [(e.b, [e]) for e in train.elements if e.driven and e.b != GROUND]
    while ways:
        mass, path = ways.pop(0)
        if mass == train.valve:
            return path
        for e in (e for e in train.elements if e not in path):
            ends = [(e.a, e.b)] if e.contact else [(e.a, e.b), (e.b, e.a)]
            ways += [(to, [*path, e]) for at, to in ends if at == mass and to != GROUND]
    return []


def figures(
    train: FiledTrain, cam: FiledCam, speed: float, motions: list[FiledMotion], law: str = NEVER_PULLS
) -> list[dict[str, float | None]]:
    """Metrics of every recorded revolution except the last, into which the window of bounce extends. They have no
    bounce and no seating velocity if the valve does not touch its seat."""
    if len(motions) < 2:
        raise ValueError("figures need two revolutions or more: the window of bounce runs into the next one")
    angle, x, v, z = _joined(motions, speed)
    height, slope = lift(cam, (angle + np.pi) % TURN - np.pi, np.where)
    way = path_from_cam(train)
    between = [e for e in way if e.contact and e.law != "plunger"]
    d = [compression(e, x, height) for e in between]
    rate = [compression(e, v, slope * speed) + e.gap for e in between]
    forces = [force(e, d_e, rate_e, np.where, law) for e, d_e, rate_e in zip(between, d, rate, strict=True)]
    gaps = [touch(e) - d_e for e, d_e in zip(between, d, strict=True)]
    memory = [e for e in train.elements if e.has_memory]
    adjusters = [f"{e.name}-oil" for e in way if e.law == "plunger"]  # oil columns are parallel to their plungers
    oils = [i for i, e in enumerate(memory) if e.law == "oil" and e.name in adjusters]
    seat = touch(train.seat) - compression(train.seat, x, height)
    record = np.stack([angle, seat, height - sum(e.gap for e in between), z[:, oils].sum(axis=1)])
    metrics = []
    for nose in TURN * np.arange(len(motions) - 1):
        event = np.abs(angle - nose) <= cam.duration / 2
        bounce, seating = _closing(cam, nose, record, speed)
        metrics.append(
            {
                "bounce_mm": bounce,
                "seating_velocity_m_per_s": seating,
                "jump_mm": max(0.0, *(float(gap[event].max()) for gap in gaps)) / MM,
                "contact_force_min_N": min(float(f[event].min()) for f in forces),
                "contact_force_max_N": max(float(f[event].max()) for f in forces),
            }
        )
    return metrics


def _joined(motions: list[FiledMotion], speed: float) -> tuple[np.ndarray, ...]:
    """Angle (k) [rad], increasing over all revolutions, with positions, velocities and memories at it."""
    columns = []
    for r, m in enumerate(motions):
        share = np.arange(BETWEEN) / BETWEEN
        at = (m.angle[:-1, None] + np.diff(m.angle)[:, None] * share).ravel()
        x, slope = hermite(m.angle, m.x, m.v / speed, at)
        z = np.array([np.interp(at, m.angle, column) for column in m.z.T]).reshape(-1, len(at)).T
        columns.append((at + TURN * r, x, slope * speed, z))
    angle, x, v, z = (np.concatenate(arrays) for arrays in zip(*columns, strict=True))
    return angle, x, v, z


def _closing(cam: FiledCam, nose: float, record: np.ndarray, speed: float) -> tuple[float | None, float | None]:
    """Bounce [mm] and seating velocity [m/s] of the revolution whose nose is at the angle `nose`, None if the valve
    never seats. `record` (4, k) holds angle, distance from the seat, lift above the lash and leakage of adjusters."""
    angle, s, above_lash, leaked = record
    foot = float(cam.start[np.flatnonzero(np.any(cam.coefficients != 0.0, axis=1))[0]])
    inside = np.flatnonzero((angle >= nose - np.pi) & (angle < nose + np.pi))
    peak = inside[np.argmax(s[inside])]
    if s[peak] <= 0.0:
        return 0.0, 0.0
    window = np.arange(peak, np.searchsorted(angle, nose + TURN + foot))
    falls = window[:-1][(s[window[:-1]] > 0.0) & (s[window[1:]] <= 0.0)]
    if not len(falls):
        return None, None
    i = falls[0]
    shorter = max(0.0, float(leaked[i] - np.interp(nose + foot, angle, leaked)))
    last = inside[above_lash[inside] > shorter].max()
    begin = min(_zero(angle, s, i), _zero(angle, above_lash - shorter, last))  # touch, nominal closing
    after = window[angle[window] >= begin]
    seating = (s[i] - s[i + 1]) / (angle[i + 1] - angle[i]) * speed
    return max(0.0, float(np.interp(begin, angle, s)), float(s[after].max())) / MM, float(seating)


def _zero(angle: np.ndarray, y: np.ndarray, i: int) -> float:
    """The angle between samples i and i + 1 at which y (k) falls through zero, by linear interpolation."""
    return float(angle[i] + y[i] / (y[i] - y[i + 1]) * (angle[i + 1] - angle[i]))
