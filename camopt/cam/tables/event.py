"""The event of a measured table: its rows between the feet of the flanks, and the scene's ramp where one is missing."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.interpolate import PPoly

from camopt.cam.ramps import Ramp
from camopt.cam.tables.interpolation import check_ends
from camopt.scene import InputError
from camopt.scene.units import DEG, MM, MM_PER_DEG

TURN = 360.0
BASE_MM = 0.03
"""Lift [mm] below which a row may belong to the base circle: three times the largest noise expected, 10 um."""
CLOSING_SHARE = 0.01
"""Largest step between the first row and the one a turn later, over the maximum lift; more is no reading error."""
FOOT_REACH_DEG = 15.0
"""Distance [deg] beyond the last row above BASE_MM within which the foot is sought; noise hides a foot of 10 deg."""
SHORTEST_BASE_DEG = 10.0
"""Shortest base circle [deg]; with a shorter one the table counts as a turn without base circle."""
CUT = 15.0
"""A flank was cut, and has no ramp, if its last step, to the base circle, exceeds twice the step before by this many
times the noise, four standard deviations of that difference. The steps of a ramp shrink there or stay equal."""
LEAST_CUT_MM = 2e-3
"""The same limit [mm] for a table without noise: two units of a table with three decimals."""
MEDIAN_TO_DEVIATION = 1.4826
"""Standard deviation of normal noise over the median of its magnitude."""
COMPLETED_SHARE = 0.05
"""Largest lift at which a table may end, relative to its maximum lift; above it, camopt would invent the flank."""
LONGEST_COMPLETION = 2.0
"""Largest length of a completion relative to the scene's ramp; rows with a gentler end do not reach the base circle."""
LOCAL_ROWS = 10
"""Number of rows at the end of a flank to which a cubic is fitted for the lift and slope there."""
GENTLER = 0.6
"""Slope of the last rows over the ramp's, below which (by two standard errors) the cut lies in the ramp's foot."""
WINDOW_DEG = 5.0
"""Distance [deg] between the lifts whose second difference is taken as an acceleration of the flank."""


@dataclass(frozen=True)
class Event:
    """The rows (indices into the table, angles ascending) of the law, and the angles [deg] between which it lies.

    `start` and `end` are infinite for a turn without base circle. `cut` states for the opening and the closing flank
    whether it ends without a ramp; `completed` adds rows that continue it. `noise` [mm] is a first estimate.
    """

    rows: np.ndarray = field(repr=False)
    degrees: np.ndarray = field(repr=False)
    start: float = -np.inf
    end: float = np.inf
    cut: tuple[bool, bool] = (False, False)
    noise: float = 0.0
    added_degrees: np.ndarray = field(default_factory=lambda: np.zeros(0), repr=False)
    added_lift: np.ndarray = field(default_factory=lambda: np.zeros(0), repr=False)


def find_event(where: str, degrees: np.ndarray, lift: np.ndarray) -> Event:
    """The event of a table of ascending cam `degrees` and `lift` [mm], both (r), over at most one turn. Raises
    InputError if the table neither closes on itself nor begins and ends on the base circle."""
    check_ends(where, degrees, lift, CLOSING_SHARE * lift.max(), BASE_MM)
    angle = np.mod(degrees - degrees[0], TURN)
    angle[np.abs(degrees - degrees[0] - TURN) < 1e-9] = 0.0
    order = np.argsort(angle, kind="stable")
    angle, turned = angle[order] + degrees[0], lift[order]
    high = turned >= BASE_MM
    above = np.flatnonzero(high & (np.roll(high, 1) | np.roll(high, -1)))  # a single high row may be an outlier
    if len(above) < 6:
        raise InputError(
            f"{where}: fewer than six rows above the base circle: the steps are too coarse, give finer ones"
        )
    gaps = np.diff(angle[above], append=angle[above[0]] + TURN)
    widest = int(np.argmax(gaps))
    if gaps[widest] < SHORTEST_BASE_DEG or np.count_nonzero(~high) == 0:
        return Event(order, angle)
    # in three successive turns the event is one range of ascending rows between two ranges of base circle
    after = above[(widest + 1) % len(above)]
    n = len(order)
    index = np.arange(after - n, after + 2 * n)
    angles, lifts = angle[np.mod(index, n)] + TURN * np.floor_divide(index, n), turned[np.mod(index, n)]
    opening = n
    closing = opening + int(np.mod(above[widest] - after, n))
    noise = _noise(angle, turned, high)
    largest_drop = max(CUT * noise, LEAST_CUT_MM)
    start, cut_before = _foot(angles, lifts, opening, -1, largest_drop)
    end, cut_after = _foot(angles, lifts, closing, 1, largest_drop)
    row = np.arange(len(index))
    after_start = row >= opening if cut_before else angles > start
    before_end = row <= closing if cut_after else angles < end
    event_rows = np.flatnonzero(after_start & before_end)
    return Event(order[np.mod(index[event_rows], n)], angles[event_rows], start, end, (cut_before, cut_after), noise)


def _noise(angle: np.ndarray, lift: np.ndarray, high: np.ndarray) -> float:
    """Noise [mm] of the rows above the base circle, from their distances to cubics through their four neighbours."""
    once = np.append(True, np.diff(angle) > 0)  # the first and the last row of a turn coincide
    angle, lift, high = angle[once], lift[once], high[once]
    near = np.array([-2, -1, 1, 2])
    at = np.flatnonzero(high[:-4] & high[1:-3] & high[2:-2] & high[3:-1] & high[4:]) + 2
    if len(at) == 0:
        return 0.0
    x = angle[at[:, None] + near] - angle[at][:, None]
    shares = np.stack([np.prod([x[:, j] / (x[:, j] - x[:, i]) for j in range(4) if j != i], axis=0) for i in range(4)])
    off = lift[at] - np.sum(shares.T * lift[at[:, None] + near], axis=1)
    return MEDIAN_TO_DEVIATION * float(np.median(np.abs(off) / np.sqrt(1 + np.sum(shares**2, axis=0))))


def _foot(angle: np.ndarray, lift: np.ndarray, last: int, outward: int, largest_drop: float) -> tuple[float, bool]:
    """Outermost angle of the foot beyond the row `last` of a flank, and whether its ramp was cut at that row."""
    step = abs(angle[last] - angle[last - outward])
    rise, drop = lift[last - outward] - lift[last], lift[last] - lift[last + outward]
    on_base_circle = abs(lift[last + outward]) < BASE_MM
    if rise > 0 and drop > 2 * rise + largest_drop and on_base_circle:
        return float(angle[last]), True
    at = last
    while True:
        following = at + outward
        beyond = abs(angle[following] - angle[last]) > FOOT_REACH_DEG
        gap = abs(angle[following] - angle[at]) > max(5 * step, 5.0)
        if at != last and (beyond or gap or (lift[at] == 0.0 and lift[following] == 0.0)):
            return float(angle[at]), False
        at = following


def completed(where: str, event: Event, lift: np.ndarray, lines: list[int], ramps: tuple[Ramp, Ramp]) -> Event:
    """The event with rows of the scene's opening and closing ramp added where its flanks were cut, and with its feet.

    From the lift and slope at the last row, the velocity falls to that of the ramp as (1 - u)^2, over the angle in
    which the lift reaches the ramp's height, or over a longer one if the flank's largest acceleration requires it. From
    there on the lift follows the ramp. A slope well below the ramp's is kept. Raises InputError if the table ends too
    high or with a slope that no such ramp continues.
    """
    height, ends = lift[event.rows], [event.start, event.end]
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
        profile = _profile(end, slope, ramps[side], max(bend, acceleration), gentler)
        if profile is None:
            raise InputError(
                f"{what} with a slope of {slope:.3g} mm/deg, which the scene's ramp does not continue down to the base "
                f"circle: give the rows of its ramp"
            )
        length, curve = profile
        away = np.arange(step, length, step)
        event = replace(
            event,
            added_degrees=np.append(event.added_degrees, angle[0] + outward * away),
            added_lift=np.append(event.added_lift, curve(away)),
        )
        ends[side] = float(angle[0] + outward * length)
    if TURN <= ends[1] - ends[0] < np.inf:
        raise InputError(f"{where}: with the scene's ramps added, the event is longer than a turn: give its own ramps")
    return replace(event, start=ends[0], end=ends[1])


def _end_of_flank(beyond: np.ndarray, flank: np.ndarray) -> tuple[tuple[float, float, float], float]:
    """Lift, slope (falling) and second derivative at the last row, where `beyond` [deg] is 0, from a cubic, and the
    standard error of the slope over the noise [1/deg]."""
    powers = np.vander(beyond, 4, increasing=True)
    fit = np.linalg.pinv(powers)
    c = fit @ flank
    return (float(c[0]), -float(c[1]), 2 * float(c[2])), float(np.linalg.norm(fit[1]))


def _flank_acceleration(degrees: np.ndarray, height: np.ndarray) -> float:
    """Largest acceleration [mm/deg^2] of the rows over twice `WINDOW_DEG`; noise of 10 um contributes 0.001."""
    at = degrees[(degrees - degrees[0] >= WINDOW_DEG) & (degrees[-1] - degrees >= WINDOW_DEG)]
    before, now, after = (np.interp(at + away, degrees, height) for away in (-WINDOW_DEG, 0.0, WINDOW_DEG))
    return float(np.max(after - 2 * now + before, initial=0.0)) / WINDOW_DEG**2


def _profile(
    height: float, slope: float, ramp: Ramp, acceleration: float, gentler: bool
) -> tuple[float, Callable[[np.ndarray], np.ndarray]] | None:
    """Length [deg] and lift [mm] against the angle beyond the last row, from its lift and slope; None if no profile
    fits. A slope that is `gentler` than the ramp's is kept."""
    scene_height, scene_slope = ramp.height / MM, ramp.velocity / MM_PER_DEG
    ramp_slope = slope if gentler else scene_slope
    if not (height > 0 and ramp_slope > 0 and acceleration > 0):
        return None
    excess = max(slope - ramp_slope, 0.0)
    blend = 0.0
    if excess > 0:
        blend = max(3 * (height - scene_height) / (slope + 2 * ramp_slope), 2 * excess / acceleration)
    ramp_height = height - blend * (ramp_slope + excess / 3)
    if ramp_height <= 0:
        return None
    completion = Ramp(ramp_height * MM, ramp_slope * MM_PER_DEG, min(ramp.foot, 2 * ramp_height / ramp_slope * DEG))
    length = blend + completion.length / DEG
    if length > LONGEST_COMPLETION * ramp.length / DEG:
        return None
    borders, pieces = completion.opening_pieces(0.0)
    nonempty = np.diff(borders) > 0  # a ramp no higher than the rise of its foot has no straight piece
    law = PPoly(pieces[nonempty, ::-1].T, np.append(borders[:-1][nonempty], borders[-1]))

    def curve(away: np.ndarray) -> np.ndarray:
        share = np.clip(away / blend, 0.0, 1.0) if blend > 0 else np.ones_like(away)
        above = ramp_height + (blend - np.minimum(away, blend)) * ramp_slope + excess * blend / 3 * (1 - share) ** 3
        return np.where(away < blend, above, law(-np.maximum(away - blend, 0.0) * DEG) / MM)

    return length, curve
