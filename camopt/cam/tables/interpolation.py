"""A lift table as polynomial pieces: quintic between every two samples, exactly zero on the base circle.

If the table gives velocity and acceleration beside the lift, as camopt's own do, each piece has these at both its ends.
Otherwise the pieces are a spline, four times continuously differentiable.
"""

import numpy as np
from scipy.interpolate import BPoly, BSpline, PPoly, make_interp_spline

from camopt.cam.polynomials import PiecewiseLevel, recentred
from camopt.scene import InputError
from camopt.scene.units import DEG, MM

TURN = 2 * np.pi
ZERO = 1e-12 * MM
"""Lift [m] up to which a sample counts as base circle."""
END_MM = 1e-3
"""Lift [mm] at the ends of a table of one event that counts as base circle, and largest step where a turn closes."""
ROUNDING = 1e-12
"""Error [rad] of the roots of a ramp by rounding alone."""
AT_REST = [(1, 0.0), (2, 0.0)]
DISAGREEMENT = 0.5
"""Largest step in lift between two rows that its velocities do not explain, over the squared step in angle times the
largest acceleration. That acceleration along the whole step gives 0.5, and 0.25 from the mean of both velocities."""


def spline_pieces(where: str, angle: np.ndarray, lift: np.ndarray) -> PPoly:
    """Pieces over one turn through the samples at ascending `angle` [rad] with `lift` [m].

    At the base circle the spline is clamped: velocity and acceleration vanish with the lift, and the base circle itself
    is exactly zero. A full turn without base circle is interpolated periodically. Raises InputError for a table that
    neither closes on itself nor begins and ends on the base circle.
    """
    missing = check_ends(where, angle / DEG, lift / MM, END_MM, END_MM)
    if missing == 0.0:
        angle, lift = angle[:-1], lift[:-1]
    elif missing > 1.5 * float(np.diff(angle).max()) / DEG:  # one event, the rest of the turn is base circle
        lift = np.concatenate([[0.0], lift[1:-1], [0.0]])
        angle, lift = np.append(angle, 0.5 * (angle[-1] + angle[0] + TURN)), np.append(lift, 0.0)
    angle, lift = _from_base_circle(angle, lift)
    if lift[0] != 0.0:
        spline = make_interp_spline(np.append(angle, angle[0] + TURN), np.append(lift, lift[0]), 5, bc_type="periodic")
        return _pieces_between(spline, angle[0], angle[0] + TURN)
    if np.count_nonzero(lift) < 6:
        raise InputError(
            f"{where}: fewer than six rows above the base circle: the steps are too coarse, give finer ones"
        )
    event = slice(0, np.flatnonzero(lift)[-1] + 2)
    angle, lift = angle[event], lift[event]
    spline = make_interp_spline(angle, lift, 5, bc_type=(AT_REST, AT_REST))
    pieces = _pieces_between(spline, angle[0], angle[-1])
    end = angle[0] + TURN
    if pieces.x[-1] >= end - 1e-12:  # the base circle is a single sample
        return pieces
    return PPoly(np.hstack([pieces.c, np.zeros((6, 1))]), np.append(pieces.x, end))


def check_ends(where: str, degrees: np.ndarray, lift_mm: np.ndarray, closing_mm: float, base_mm: float) -> float:
    """The part of a turn [deg] that the rows leave out, zero if they close it. Raises InputError if they close it with
    a step above `closing_mm`, and if they leave out more than 1.5 of their steps and begin or end above `base_mm`."""
    missing, (first, last) = 360.0 - (degrees[-1] - degrees[0]), lift_mm[[0, -1]]
    if missing <= 1e-7:
        if abs(last - first) > closing_mm:
            raise InputError(
                f"{where}: the lift is {first:g} mm at the first row and {last:g} mm one turn later: the two must be "
                f"equal"
            )
        return 0.0
    if missing > 1.5 * float(np.diff(degrees).max()) and max(abs(first), abs(last)) > base_mm:
        raise InputError(
            f"{where}: the table covers {360.0 - missing:g} cam degrees and must begin and end on the base circle, but "
            f"its ends are {first:g} and {last:g} mm: give one whole turn"
        )
    return missing


def own_pieces(
    where: str, angle: np.ndarray, lift: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray, lines: list[int]
) -> PPoly:
    """Pieces over one turn from camopt's own columns: angle [rad], lift [m], its derivatives [m/rad, m/rad^2], all (r).
    Raises InputError for a turn that does not close, and for columns that contradict each other."""
    check_ends(where, angle / DEG, lift / MM, END_MM, END_MM)
    step = np.diff(angle)
    unexplained = np.abs(np.diff(lift) - 0.5 * step * (velocity[1:] + velocity[:-1]))
    wrong = np.flatnonzero(unexplained > DISAGREEMENT * step**2 * np.abs(acceleration).max() + END_MM * MM * 1e-3)
    if len(wrong):
        raise InputError(
            f"{where}: line {lines[int(wrong[0]) + 1]}: lift_mm does not follow from velocity_mm_per_deg: where the "
            f"lift was changed, take away the columns of its derivatives"
        )
    bernstein = BPoly.from_derivatives(angle, np.column_stack([lift, velocity, acceleration]))
    return with_one_base_circle(PPoly.from_bernstein_basis(bernstein))


def with_one_base_circle(pieces: PPoly) -> PPoly:
    """The pieces with successive ones that are zero joined to a single one."""
    zero = ~np.any(pieces.c, axis=0)
    first = ~(zero & np.append(False, zero[:-1]))
    return PPoly(pieces.c[:, first], np.append(pieces.x[:-1][first], pieces.x[-1]))


def _from_base_circle(angle: np.ndarray, lift: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The samples of a turn, begun at the last sample of the longest run on the base circle, and closed there."""
    lift = np.where(np.abs(lift) <= ZERO, 0.0, lift)
    above = np.flatnonzero(lift)
    if len(above) == len(lift) or len(above) == 0:
        return angle, lift
    following = np.append(above[1:], above[0] + len(lift))
    longest = np.argmax(following - above)  # samples on the base circle between `above` and `following`
    start = (following[longest] - 1) % len(lift)
    turned = np.concatenate([angle[start:], angle[:start] + TURN, [angle[start] + TURN]])
    return turned, np.concatenate([lift[start:], lift[:start], [lift[start]]])


def _pieces_between(spline: BSpline, start: float, end: float) -> PPoly:
    """The pieces of a spline from `start` to `end`, without those at its end knots that are empty or lie outside."""
    pieces = PPoly.from_spline(spline)
    middles = 0.5 * (pieces.x[1:] + pieces.x[:-1])
    inside = (np.diff(pieces.x) > 0) & (middles > start) & (middles < end)
    return PPoly(pieces.c[:, inside], np.append(pieces.x[:-1][inside], end))


def event_borders(where: str, pieces: PPoly, opening: float, closing: float) -> tuple[float, float]:
    """Angles [rad] at which the lift, from its lowest place on, first rises through `opening` [m] and last falls
    through `closing` [m]; a crossing within rounding of a row is moved to that row."""
    low = pieces.x[np.argmin(pieces(pieces.x[:-1]))]
    crossings = []
    for height in (opening, closing):
        roots = pieces.solve(height, discontinuity=False, extrapolate=False)
        roots = roots[np.isfinite(roots)]
        if len(roots) == 0:
            raise InputError(
                f"{where}: the lift never passes the scene's ramp height of {height / MM:g} mm: lower "
                f"ramp_height_mm, or check the unit of the lift"
            )
        crossings.append(np.mod(roots - low, TURN) + low)
    angles = np.array([np.min(crossings[0]), np.max(crossings[1])])
    nearest = pieces.x[np.argmin(np.abs(pieces.x[:, None] - angles), axis=0)]
    start, end = np.where(np.abs(nearest - angles) < ROUNDING, nearest, angles)
    return float(start), float(end)


def centred(pieces: PPoly, middle: float) -> tuple[np.ndarray, np.ndarray]:
    """Borders (p + 1) from -pi to pi and coefficients (p, 6) of the periodic pieces, shifted by `middle` [rad]."""
    first_start = pieces.x[0] - middle
    turn = np.floor((-np.pi - first_start) / TURN) * TURN  # from here two turns cover -pi to pi
    starts = np.concatenate([pieces.x[:-1], pieces.x[:-1] + TURN]) - middle + turn
    rows = np.tile(pieces.c[::-1].T, (2, 1))
    inside = (starts > -np.pi + 1e-12) & (starts < np.pi - 1e-12)
    first = np.flatnonzero(starts <= -np.pi + 1e-12)[-1:]
    moved = recentred(PiecewiseLevel(starts, rows), first, np.array([-np.pi]))
    borders = np.concatenate([[-np.pi], starts[inside], [np.pi]])
    return borders, np.vstack([moved, rows[inside]])
