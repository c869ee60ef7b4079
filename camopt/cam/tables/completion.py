"""The flank of a measured table that ends above the base circle, completed by the scene's own ramp."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.interpolate import PPoly

from camopt.cam.ramps import Ramp
from camopt.cam.tables.event import TURN, Event
from camopt.scene import InputError
from camopt.scene.units import DEG, MM, MM_PER_DEG

COMPLETED_SHARE = 0.05
"""Largest lift at which a table may end, over its maximum lift: above it, the flank would be camopt's invention."""
LONGEST = 2.0
"""Longest completion, over the scene's own ramp: a gentler slope at the end of the rows leads nowhere."""
LOCAL_ROWS = 10
"""Rows at the end of a flank through which a cubic gives lift and slope there."""
GENTLER = 0.6
"""Slope of the last rows over the ramp's, below which (by two standard errors) the cut lies in the ramp's foot."""
WINDOW_DEG = 5.0
"""Distance of the lifts whose second difference counts as an acceleration of the flank."""


def completed(where: str, event: Event, lift: np.ndarray, lines: list[int], ramps: tuple[Ramp, Ramp]) -> Event:
    """The event with rows of the scene's opening and closing ramp added where its flanks were cut, and its feet.

    From the lift and slope at the last row, the velocity falls to the ramp's as (1 - u)^2, down to the ramp's height
    or as the flank's largest acceleration has it; from there on it is the ramp. A slope well below the ramp's is kept.
    Raises InputError where the table ends too high or with a slope that no such ramp continues.
    """
    height = lift[event.rows]
    if event.start is None or event.end is None:
        return event
    ends = [event.start, event.end]
    acceleration = _flank_acceleration(event.degrees, height)
    step = min(1.0, float(np.median(np.diff(event.degrees))))
    for side, outward in enumerate((-1, 1)):
        if not event.cut[side]:
            continue
        order = slice(None) if outward < 0 else slice(None, None, -1)
        angle, flank = event.degrees[order], height[order]
        what = f"{where}: line {lines[int(event.rows[order][0])]}: the table ends at {flank[0]:g} mm"
        if flank[0] > COMPLETED_SHARE * height.max():
            raise InputError(
                f"{what}, over {100 * COMPLETED_SHARE:g} % of its largest lift, with no row between there and the base "
                f"circle: give the rows of the flank and its ramp"
            )
        (end, slope, bend), error = _end_of_flank(outward * (angle - angle[0])[:LOCAL_ROWS], flank[:LOCAL_ROWS])
        gentler = slope + 2 * error * event.noise < GENTLER * ramps[side].velocity / MM_PER_DEG
        found = _profile(end, slope, ramps[side], max(bend, acceleration), gentler)
        if found is None:
            raise InputError(
                f"{what} with a slope of {slope:.3g} mm/deg, which the scene's ramp does not continue down to the base "
                f"circle: give the rows of its ramp"
            )
        length, curve = found
        away = np.arange(step, length, step)
        event = replace(
            event,
            added_degrees=np.append(event.added_degrees, angle[0] + outward * away),
            added_lift=np.append(event.added_lift, curve(away)),
        )
        ends[side] = float(angle[0] + outward * length)
    if ends[1] - ends[0] >= TURN:
        raise InputError(f"{where}: with the scene's ramps added, the event is longer than a turn: give its own ramps")
    return replace(event, start=ends[0], end=ends[1])


def _end_of_flank(beyond: np.ndarray, flank: np.ndarray) -> tuple[tuple[float, float, float], float]:
    """Lift, slope (falling) and second derivative at the last row by a cubic, `beyond` [deg] being 0 there, and the
    slope's standard error over the noise [1/deg]."""
    powers = np.vander(beyond, 4, increasing=True)
    fit = np.linalg.pinv(powers)
    c = fit @ flank
    return (float(c[0]), -float(c[1]), 2 * float(c[2])), float(np.linalg.norm(fit[1]))


def _flank_acceleration(degrees: np.ndarray, height: np.ndarray) -> float:
    """Largest acceleration [mm/deg^2] of the rows over twice `WINDOW_DEG`: noise of 10 um is worth 0.001."""
    at = degrees[(degrees - degrees[0] >= WINDOW_DEG) & (degrees[-1] - degrees >= WINDOW_DEG)]
    before, now, after = (np.interp(at + away, degrees, height) for away in (-WINDOW_DEG, 0.0, WINDOW_DEG))
    return float(np.max(after - 2 * now + before, initial=0.0)) / WINDOW_DEG**2


def _profile(
    height: float, slope: float, ramp: Ramp, acceleration: float, gentler: bool
) -> tuple[float, Callable[[np.ndarray], np.ndarray]] | None:
    """Length [deg] and lift [mm] by the angle beyond the last row, from its lift and slope; None where none fits.

    A `gentler` slope than the ramp's goes on as it is.
    """
    scene_height, scene_slope = ramp.height / MM, ramp.velocity / MM_PER_DEG
    low = slope if gentler else scene_slope
    if not (height > 0 and low > 0 and acceleration > 0):
        return None
    excess = max(slope - low, 0.0)
    blend = max(3 * (height - scene_height) / (slope + 2 * low), 2 * excess / acceleration) if excess > 0 else 0.0
    left = height - blend * (low + excess / 3)
    if left <= 0:
        return None
    own = Ramp(left * MM, low * MM_PER_DEG, min(ramp.foot, 2 * left / low * DEG))
    length = blend + own.length / DEG
    if length > LONGEST * ramp.length / DEG:
        return None
    borders, pieces = own.opening_pieces(0.0)
    kept = np.diff(borders) > 0  # a ramp that is no higher than its foot rises has no straight piece
    law = PPoly(pieces[kept, ::-1].T, np.append(borders[:-1][kept], borders[-1]))

    def curve(away: np.ndarray) -> np.ndarray:
        share = np.clip(away / blend, 0.0, 1.0) if blend > 0 else np.ones_like(away)
        above = left + (blend - np.minimum(away, blend)) * low + excess * blend / 3 * (1 - share) ** 3
        return np.where(away < blend, above, law(-np.maximum(away - blend, 0.0) * DEG) / MM)

    return length, curve
