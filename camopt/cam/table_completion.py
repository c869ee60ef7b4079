"""The flank of a measured table that ends above the base circle, completed by the scene's own ramp."""

from dataclasses import replace

import numpy as np
from scipy.interpolate import PPoly

from camopt.cam.ramps import Ramp
from camopt.cam.table_event import TURN, Event
from camopt.scene import InputError
from camopt.scene.units import DEG, MM, MM_PER_DEG

COMPLETED_SHARE = 0.05
"""Largest lift at which a table may end, over its maximum lift: above it, the flank would be camopt's invention."""
LONGEST = 2.0
"""Longest completion, over the scene's own ramp: a gentler slope at the end of the rows leads nowhere."""
LOCAL_ROWS = 10
"""Rows at the end of a flank through which a cubic gives lift and slope there."""
WINDOW_DEG = 5.0
"""Least distance of the rows whose difference counts as a velocity of the flank."""


def completed(where: str, event: Event, lift: np.ndarray, lines: list[int], ramps: tuple[Ramp, Ramp]) -> Event:
    """The event with rows of the scene's opening and closing ramp added where its flanks were cut, and its feet.

    From the lift and slope at the last row, the velocity falls to the ramp's as (1 - u)^2, down to the ramp's height
    or as gently as the flanks are; from there on it is the ramp. A slope that is less than the ramp's is kept.
    Raises InputError where the table ends too high or with a slope that no such ramp continues.
    """
    height = lift[event.rows]
    ends = [event.start, event.end]
    for side, outward in enumerate((-1, 1)):
        if not event.cut[side]:
            continue
        order = slice(None) if outward < 0 else slice(None, None, -1)
        angle, flank = event.degrees[order], height[order]
        line = lines[int(event.rows[order][0])]
        if flank[0] > COMPLETED_SHARE * height.max():
            raise InputError(
                f"{where}: line {line}: the table ends at {flank[0]:g} mm, over {100 * COMPLETED_SHARE:g} % of its "
                f"largest lift, with no row between there and the base circle: give the rows of the flank and its ramp"
            )
        local = np.polynomial.Polynomial.fit(outward * (angle - angle[0])[:LOCAL_ROWS], flank[:LOCAL_ROWS], 3)
        found = _profile(float(local(0.0)), -float(local.deriv()(0.0)), ramps[side], _gentleness(event.degrees, height))
        if found is None:
            raise InputError(
                f"{where}: line {line}: the table ends at {flank[0]:g} mm with a slope of "
                f"{-float(local.deriv()(0.0)):.3g} mm/deg, which the scene's ramp does not continue down to the base "
                f"circle: give the rows of its ramp"
            )
        length, curve = found
        step = min(1.0, float(np.median(np.diff(event.degrees))))
        away = np.arange(step, length, step)
        event = replace(
            event,
            added_degrees=np.append(event.added_degrees, angle[0] + outward * away),
            added_lift=np.append(event.added_lift, curve(away)),
        )
        ends[side] = float(angle[0] + outward * length)
    if None not in ends and ends[1] - ends[0] >= TURN:
        raise InputError(f"{where}: with the scene's ramps added, the event is longer than a turn: give its own ramps")
    return replace(event, start=ends[0], end=ends[1])


def _gentleness(degrees: np.ndarray, height: np.ndarray) -> float:
    """Acceleration [mm/deg^2] that the flanks have by their largest velocity: 2 v^2 / lift, twice a parabola's half."""
    at = np.searchsorted(degrees, degrees + WINDOW_DEG)
    at, before = at[at < len(degrees)], np.flatnonzero(at < len(degrees))
    velocity = np.abs((height[at] - height[before]) / (degrees[at] - degrees[before])).max(initial=0.0)
    return float(2 * velocity**2 / height.max())


def _profile(height: float, slope: float, ramp: Ramp, acceleration: float):
    """Length [deg] and lift [mm] by the angle beyond the last row, from its lift and slope; None where none fits."""
    scene_height, scene_slope = ramp.height / MM, ramp.velocity / MM_PER_DEG
    low = min(slope, scene_slope)
    if not (height > 0 and low > 0 and acceleration > 0):
        return None
    excess = slope - low
    blend = max(3 * (height - scene_height) / (slope + 2 * low), 2 * excess / acceleration) if excess > 0 else 0.0
    left = height - blend * (low + excess / 3)
    if left <= 0:
        return None
    own = Ramp(left * MM, low * MM_PER_DEG, min(ramp.foot, 2 * left / low * DEG))
    length = blend + own.length / DEG
    if length > LONGEST * ramp.length / DEG:
        return None
    borders, pieces = own.opening_pieces(0.0)
    law = PPoly(pieces[:, ::-1].T, borders)

    def curve(away: np.ndarray) -> np.ndarray:
        share = np.clip(away / blend, 0.0, 1.0) if blend > 0 else np.ones_like(away)
        above = left + (blend - np.minimum(away, blend)) * low + excess * blend / 3 * (1 - share) ** 3
        return np.where(away < blend, above, law(-np.maximum(away - blend, 0.0) * DEG) / MM)

    return length, curve
