"""A measured lift table made into a law: outliers rejected, smoothed within its own noise, or refused."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PPoly

from camopt.cam.tables.event import BASE_MM, TURN, Event, find_event
from camopt.cam.tables.smoothing_spline import Fit, fitted, fitted_non_negative
from camopt.scene import InputError

OUTLIER = 5.0
"""Studentised residual of an outlier: by chance one row in 1.7 million."""
OUTLIER_SHARE = 2.5e-4
"""Least distance of an outlier from what the others say, over the maximum lift. A corner of the jerk, which the spline
rounds, stays below it: 7e-5 for an exact polydyne in steps of 2 deg, 1.1e-4 where ramp and flank of a motorbike's
exhaust cam meet."""
NEIGHBOURS = 3
"""Rows on either side of an outlier that are judged anew without it: it has pulled the spline towards itself."""
MOST_OUTLIERS = 0.05
NOISE_FREE_MM = 1e-6
"""Noise below which a table is taken as computed, not measured: interpolating it moves the acceleration less than
smoothing does. Tables of an exact polydyne stay below it at 0.5 deg and finer."""
ERROR_SHARE = 0.1
"""Largest standard error of the acceleration (root mean square over the event) over its peak: beyond it, dynamics
from the table would be dynamics of its noise."""
KNOTS_DEG = (0.5, 1.0)
"""Finest and coarsest knots; between them, half a row step."""


@dataclass(frozen=True)
class Smoothed:
    """What became of a table: `pieces` [deg, mm] over one turn, None where it has no noise; `outliers` (rows)."""

    pieces: PPoly | None
    outliers: list[int]
    report: dict


def smoothed(where: str, degrees: np.ndarray, lift: np.ndarray, lines: list[int]) -> Smoothed:
    """The smooth law of a table: ascending cam `degrees` (at most one turn) and `lift` [mm], both (r).

    Raises InputError for too many outliers, negative lift, or rows that fix no usable acceleration.
    """
    event = find_event(where, degrees, lift)
    kept, outliers = _without_outliers(where, event, lift)
    count, free = _knots(kept)
    if kept.start is None:
        fit = fitted(kept.degrees, lift[kept.rows], count, free)
    else:
        fit = fitted_non_negative(kept.degrees, lift[kept.rows], count, free)
    outliers = sorted(outliers + _off_base_circle(where, event, lift, fit.noise, lines))
    report = {"noise_um": round(1e3 * fit.noise, 4), "outliers": len(outliers)}
    if outliers:
        report["outlier_lines"] = [lines[row] for row in outliers]
    if fit.noise < NOISE_FREE_MM and not outliers and not event.cut:
        return Smoothed(None, outliers, report | {"largest_shift_um": 0.0})
    error, peak = fit.acceleration_error()
    if error > ERROR_SHARE * peak:
        raise InputError(
            f"{where}: no usable acceleration: with {len(kept.rows)} rows in the event and a noise of "
            f"{1e3 * fit.noise:.3g} um its standard error is {100 * error / peak:.0f} % of the peak, over "
            f"{100 * ERROR_SHARE:g} %: measure in finer steps or with less noise"
        )
    pieces = fit.pieces()
    used = np.setdiff1d(np.arange(len(lift)), outliers)
    if event.cut:  # the base circle that a cut ramp replaces was not measured
        outside = np.mod(degrees[used] - (kept.start or 0.0), TURN) >= (kept.end or 0.0) - (kept.start or 0.0)
        used = used[outside | np.isin(used, kept.rows)]
    shifts = pieces(np.mod(degrees[used], TURN)) - lift[used]
    most = int(np.argmax(np.abs(shifts)))
    report |= {
        "largest_shift_um": round(1e3 * abs(float(shifts[most])), 4),
        "largest_shift_line": lines[used[most]],
        "acceleration_error_percent": round(100 * error / peak, 2),
    }
    return Smoothed(pieces, outliers, report | ({"cut_ramps": event.cut} if event.cut else {}))


def _off_base_circle(where: str, event: Event, lift: np.ndarray, noise: float, lines: list[int]) -> list[int]:
    """Rows outside the event that are not on the base circle; for a turn without one, no row may be below zero."""
    limit = max(BASE_MM, OUTLIER * noise)
    if event.start is None:
        off, most = np.flatnonzero(lift < -limit), 0.0
    else:
        outside = np.setdiff1d(np.arange(len(lift)), event.rows)
        off, most = outside[np.abs(lift[outside]) > limit], MOST_OUTLIERS * len(outside)
    if len(off) > most:
        raise InputError(
            f"{where}: line {lines[off[0]]}: a lift of {lift[off[0]]:g} mm on the base circle ({len(off)} such rows): "
            f"lift is counted from the base circle, positive up"
        )
    return [int(row) for row in off]


def _knots(event: Event) -> tuple[int, np.ndarray]:
    """Number of knots of a turn, and the coefficients whose functions stand inside the event, a knot more each side."""
    step = float(np.median(np.diff(event.degrees)))
    count = round(TURN / float(np.clip(step / 2, *KNOTS_DEG)))
    if event.start is None or event.end is None:
        return count, np.arange(count)
    h = TURN / count
    free = np.arange(int(np.ceil(event.start / h)) + 4, int(np.floor(event.end / h)) + 1)
    return count, np.mod(free[: count - 6], count)


def _without_outliers(where: str, event: Event, lift: np.ndarray) -> tuple[Event, list[int]]:
    """The event's rows that a spline through the others explains, and the rows rejected.

    The worst row of each neighbourhood is set aside and the noise estimated anew, until no row stands out.
    """
    count, free = _knots(event)
    rows, angles = event.rows, event.degrees
    outliers: list[int] = []
    while True:
        fit: Fit = fitted(angles, lift[rows], count, free)
        size = np.abs(fit.studentised())
        deleted = np.abs(fit.residuals) / np.maximum(1 - fit.leverage, 1e-12)
        near = np.max([np.roll(size, k) for k in range(-NEIGHBOURS, NEIGHBOURS + 1)], axis=0)
        worst = (size > OUTLIER) & (size == near) & (deleted > OUTLIER_SHARE * lift[event.rows].max())
        if not worst.any():
            return Event(rows, angles, event.start, event.end, event.cut), sorted(outliers)
        outliers += [int(row) for row in rows[worst]]
        if len(outliers) > MOST_OUTLIERS * len(event.rows):
            raise InputError(
                f"{where}: more than {100 * MOST_OUTLIERS:g} % of its {len(event.rows)} rows in the event stand out "
                f"from their neighbours by {OUTLIER:g} standard deviations: check the columns and the measurement"
            )
        rows, angles = rows[~worst], angles[~worst]
