"""A measured lift table made into a lift law: outliers are rejected, the rest is smoothed or refused."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.interpolate import PPoly

from camopt.cam.ramps import Ramp
from camopt.cam.tables.event import BASE_MM, TURN, Event, completed, find_event
from camopt.cam.tables.smoothing_spline import Fit, fitted, fitted_non_negative
from camopt.scene import InputError

OUTLIER = 5.0
"""Studentised residual from which a row is an outlier; by chance one row in 1.7 million reaches it."""
OUTLIER_SHARE = 2.5e-4
"""Least distance of an outlier from the spline through the other rows, over the maximum lift. Corners of the jerk,
which the spline rounds, stay below: 7e-5 of an exact polydyne in steps of 2 deg, 1.1e-4 of a motorbike's exhaust cam.
"""
NEIGHBOURS = 3
"""Number of rows on either side of an outlier that are judged again without it, as it has attracted the spline."""
MOST_OUTLIERS = 0.05
NOISE_FREE_MM = 1e-6
"""Noise [mm] below which a table counts as computed: interpolation then changes the acceleration less than smoothing
does. Tables of an exact polydyne stay below it at 0.5 deg and finer."""
ERROR_SHARE = 0.1
"""Largest standard error of the acceleration (root mean square over the event) relative to its peak. With a larger one,
the dynamics of the table would be the dynamics of its noise."""
ERROR_FACTOR = 1.7
PEAK_FACTOR = 2.8
"""The error of the acceleration (root mean square over the event) and that of its largest and smallest value, over
their standard errors, that 95 % of the tables of experiments/measured_tables.py do not exceed in any family of cams,
with or without a jerk limit. More than one, as a cam is no random function: it has steps of jerk or acceleration."""
INVENTED_SHARE = 0.01
"""Largest distance of the law from a straight line between two rows, relative to the maximum lift; the table gives no
evidence for more. At a step of 4 deg a cam of 0.015 mm/deg^2 has a third of that."""
SHORTEST_DEG = 20.0
"""Shortest event [deg] of a valve. A spline needs at least five knots, 5 deg."""
KNOTS_DEG = (0.5, 1.0)
"""Finest and coarsest knot interval [deg]; in between it is half the step of the rows."""


def smoothed(
    where: str, degrees: np.ndarray, lift: np.ndarray, lines: list[int], ramps: tuple[Ramp, Ramp]
) -> tuple[PPoly | None, dict]:
    """The smooth law [deg, mm] over one turn of a table, or None if it has no noise, and a report on the table.

    Its cam `degrees` (r) ascend over at most one turn, beside its `lift` (r) [mm]; a flank that ends above the base
    circle is continued by the scene's ramp. Raises InputError for too many outliers, for negative lift, for rows that
    do not determine a usable acceleration, and for gaps in which the law would be invented.
    """
    event = completed(where, find_event(where, degrees, lift), lift, lines, ramps)
    if event.end - event.start < SHORTEST_DEG:
        raise InputError(
            f"{where}: line {lines[int(event.rows[0])]}: the lift leaves the base circle for "
            f"{event.end - event.start:.3g} cam degrees only: check --table-angle, and that all columns are read"
        )
    _off_base_circle(where, event, lift, event.noise, lines)  # before such rows disturb the fit
    accepted, outliers = _without_outliers(where, event, lift)
    fit = (fitted if np.isinf(accepted.start) else fitted_non_negative)(*_arguments(accepted, lift))
    if fit.coefficients.max() <= 0:
        raise InputError(f"{where}: no lift above the base circle is left: count lift from there, positive up")
    outliers = sorted(outliers + _off_base_circle(where, event, lift, fit.noise, lines))
    report = {"noise_um": round(1e3 * fit.noise, 4), "outliers": len(outliers)}
    if outliers:
        report["outlier_lines"] = [lines[row] for row in outliers]
    if len(event.added_lift):
        report |= _added(event, lift)
    elif fit.noise < NOISE_FREE_MM and not outliers:
        return None, report | {"largest_shift_um": 0.0}
    likeliest, rms, at_peak = fit.acceleration_error()
    if likeliest > ERROR_SHARE:
        raise InputError(
            f"{where}: no usable acceleration: with {len(accepted.rows)} rows in the event and a noise of "
            f"{1e3 * fit.noise:.3g} um its standard error is {100 * likeliest:.0f} % of the "
            f"peak, over {100 * ERROR_SHARE:g} %: measure in finer steps or with less noise"
        )
    pieces = fit.pieces()
    used = _used(degrees, event, outliers)
    points = np.append(degrees[used], event.added_degrees), np.append(lift[used], event.added_lift)
    check_between_rows(where, pieces, *points, [*(lines[i] for i in used), *[0] * len(event.added_lift)])
    shifts = pieces(np.mod(degrees[used], TURN)) - lift[used]
    most = int(np.argmax(np.abs(shifts)))
    report |= {
        "largest_shift_um": round(1e3 * abs(float(shifts[most])), 4),
        "largest_shift_line": lines[used[most]],
        "acceleration_error_percent": round(100 * ERROR_FACTOR * rms, 2),
        "peak_error_percent": round(100 * PEAK_FACTOR * at_peak, 2),
    }
    return pieces, report


def check_between_rows(where: str, law: Callable, degrees: np.ndarray, lift: np.ndarray, lines: list[int]) -> None:
    """Raises InputError if `law` (angle [deg] to lift [mm]) is too far from the straight line between two rows."""
    order = np.argsort(np.mod(degrees, TURN), kind="stable")
    angle, height = np.mod(degrees, TURN)[order], lift[order]
    angle, height = np.append(angle, angle[0] + TURN), np.append(height, height[0])
    invented = np.abs(law(np.mod(0.5 * (angle[1:] + angle[:-1]), TURN)) - 0.5 * (height[1:] + height[:-1]))
    worst = int(np.argmax(invented))
    if invented[worst] > INVENTED_SHARE * lift.max():
        rows = sorted(lines[int(i)] for i in (order[worst], order[(worst + 1) % len(order)]))
        raise InputError(
            f"{where}: lines {rows[0]} and {rows[1]}: between them lie {angle[worst + 1] - angle[worst]:g} cam degrees "
            f"without a row, in which the lift would have to be invented ({invented[worst]:.3g} mm): give finer rows"
        )


def _added(event: Event, lift: np.ndarray) -> dict:
    """What was added to a cut table: number of flanks, lift from which they were completed, and angle added."""
    beyond = event.end - event.start - (event.degrees[-1] - event.degrees[0])
    return {
        "cut_ramps": sum(event.cut),
        "added_lift_mm": round(float(max(lift[event.rows[-side]] for side in (0, 1) if event.cut[side])), 4),
        "added_deg": round(float(beyond), 3),
    }


def _used(degrees: np.ndarray, event: Event, outliers: list[int]) -> np.ndarray:
    """Rows that the law must meet: neither outliers nor rows of the base circle that a completed ramp replaces."""
    used = np.setdiff1d(np.arange(len(degrees)), outliers)
    if not len(event.added_lift):
        return used
    outside = np.mod(degrees[used] - event.start, TURN) >= event.end - event.start
    return used[outside | np.isin(used, event.rows)]


def _off_base_circle(where: str, event: Event, lift: np.ndarray, noise: float, lines: list[int]) -> list[int]:
    """Rows outside the event that are not on the base circle; in a turn without one, rows below zero."""
    limit = max(BASE_MM, OUTLIER * noise)
    if np.isinf(event.start):
        off, most = np.flatnonzero(lift < -limit), 0.0
    else:
        outside = np.setdiff1d(np.arange(len(lift)), event.rows)
        off, most = outside[np.abs(lift[outside]) > limit], MOST_OUTLIERS * len(outside)
    if len(off) > most:
        raise InputError(
            f"{where}: line {lines[off[0]]}: a lift of {lift[off[0]]:g} mm on the base circle ({len(off)} such rows): "
            f"count lift from the base circle, positive up"
        )
    return [int(row) for row in off]


def _arguments(event: Event, lift: np.ndarray) -> tuple[np.ndarray, np.ndarray, int, np.ndarray, int]:
    """Arguments of `fitted`: angles and lifts (added ones last), knots per turn, free coefficients, number added."""
    angles = np.append(event.degrees, event.added_degrees)
    return angles, np.append(lift[event.rows], event.added_lift), *_knots(event), len(event.added_lift)


def _knots(event: Event) -> tuple[int, np.ndarray]:
    """Number of knots of a turn, and the coefficients whose functions exceed the event by at most a knot per side."""
    step = float(np.median(np.diff(event.degrees)))
    count = round(TURN / float(np.clip(step / 2, *KNOTS_DEG)))
    if np.isinf(event.start):
        return count, np.arange(count)
    h = TURN / count
    free = np.arange(int(np.ceil(event.start / h)) + 4, int(np.floor(event.end / h)) + 1)
    return count, np.mod(free[: count - 6], count)


def _without_outliers(where: str, event: Event, lift: np.ndarray) -> tuple[Event, list[int]]:
    """The event with the rows that a spline through the others explains, and the rejected rows. The worst row of each
    place is removed and the noise estimated again, until no outlier is left."""
    count, free = _knots(event)
    accepted = event
    outliers: list[int] = []
    while True:
        angles, height, _, _, added = _arguments(accepted, lift)
        fit: Fit = fitted(angles, height, count, free, added)
        size = np.abs(fit.studentised())
        deleted = np.abs(fit.residuals) / np.maximum(1 - fit.leverage, 1e-12)
        near = np.max([np.roll(size, k) for k in range(-NEIGHBOURS, NEIGHBOURS + 1)], axis=0)
        worst = (size > OUTLIER) & (size == near) & (deleted > OUTLIER_SHARE * lift[event.rows].max())
        if not worst.any():
            return accepted, sorted(outliers)
        outliers += [int(row) for row in accepted.rows[worst]]
        if len(outliers) > MOST_OUTLIERS * len(event.rows):
            raise InputError(
                f"{where}: more than {100 * MOST_OUTLIERS:g} % of its {len(event.rows)} rows in the event stand out "
                f"from their neighbours by {OUTLIER:g} standard deviations: check the columns and the measurement"
            )
        accepted = replace(accepted, rows=accepted.rows[~worst], degrees=accepted.degrees[~worst])
