"""Where a measured table's event lies: its rows between the feet, the base circle beside them, ramps that were cut."""

from dataclasses import dataclass, field

import numpy as np

from camopt.scene import InputError

TURN = 360.0
BASE_MM = 0.03
"""Lift below which a row may belong to the base circle: three times the largest noise expected, 10 um."""
CLOSING_SHARE = 0.01
"""Largest step, over the maximum lift, between the first row and the one a turn later: more is no reading error."""
FOOT_REACH_DEG = 15.0
"""How far outside the last row above BASE_MM the foot is looked for: a ramp's foot of 10 deg is within the noise."""
SHORTEST_BASE_DEG = 10.0
CUT = 15.0
"""A flank whose last step, down to the base circle, is this many times the noise more than twice the one before has no
ramp: where a ramp meets the base circle its steps shrink or stay. Four standard deviations of that difference."""
LEAST_CUT_MM = 2e-3
"""The same where there is no noise: two units of a table with three decimals."""
MEDIAN_TO_DEVIATION = 1.4826


@dataclass(frozen=True)
class Event:
    """Rows (indices into the table, angles ascending) that make the law, and the angles it may stand between [deg].

    `start` and `end` are None for a turn without base circle. `cut` says which flank, opening and closing, ends without
    a ramp; `camopt.cam.tables.completion` adds the rows that continue it. `noise` [mm] is a first estimate.
    """

    rows: np.ndarray = field(repr=False)
    degrees: np.ndarray = field(repr=False)
    start: float | None
    end: float | None
    cut: tuple[bool, bool] = (False, False)
    noise: float = 0.0
    added_degrees: np.ndarray = field(default_factory=lambda: np.zeros(0), repr=False)
    added_lift: np.ndarray = field(default_factory=lambda: np.zeros(0), repr=False)


def find_event(where: str, degrees: np.ndarray, lift: np.ndarray) -> Event:
    """The event of a table of ascending cam `degrees` and `lift` [mm], both (r), at most one turn.

    Raises InputError where the table neither closes on itself nor begins and ends on the base circle.
    """
    _check_ends(where, degrees, lift)
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
        return Event(order, angle, None, None)
    # unrolled to three turns, the event is one ascending stretch of rows between two stretches of base circle
    after = above[(widest + 1) % len(above)]
    n = len(order)
    index = np.arange(after - n, after + 2 * n)
    wide, height = angle[np.mod(index, n)] + TURN * np.floor_divide(index, n), turned[np.mod(index, n)]
    opening = n
    closing = opening + int(np.mod(above[widest] - after, n))
    noise = _noise(angle, turned, high)
    largest_drop = max(CUT * noise, LEAST_CUT_MM)
    start, cut_before = _foot(wide, height, opening, -1, largest_drop)
    end, cut_after = _foot(wide, height, closing, 1, largest_drop)
    kept = np.arange(len(index))
    kept = kept[
        ((kept >= opening) if cut_before else (wide > start)) & ((kept <= closing) if cut_after else (wide < end))
    ]
    return Event(order[np.mod(index[kept], n)], wide[kept], start, end, (cut_before, cut_after), noise)


def _noise(angle: np.ndarray, lift: np.ndarray, high: np.ndarray) -> float:
    """Noise [mm] of the rows above the base circle, by what a cubic through the four around each says of it."""
    once = np.append(True, np.diff(angle) > 0)  # a turn's first and last row are one
    angle, lift, high = angle[once], lift[once], high[once]
    near = np.array([-2, -1, 1, 2])
    at = np.flatnonzero(high[:-4] & high[1:-3] & high[2:-2] & high[3:-1] & high[4:]) + 2
    if len(at) == 0:
        return 0.0
    x = angle[at[:, None] + near] - angle[at][:, None]
    shares = np.stack([np.prod([x[:, j] / (x[:, j] - x[:, i]) for j in range(4) if j != i], axis=0) for i in range(4)])
    off = lift[at] - np.sum(shares.T * lift[at[:, None] + near], axis=1)
    return MEDIAN_TO_DEVIATION * float(np.median(np.abs(off) / np.sqrt(1 + np.sum(shares**2, axis=0))))


def _check_ends(where: str, degrees: np.ndarray, lift: np.ndarray) -> None:
    span, largest_step = degrees[-1] - degrees[0], float(np.diff(degrees).max())
    if span >= TURN - 1e-9:
        if abs(lift[-1] - lift[0]) > CLOSING_SHARE * lift.max():
            raise InputError(
                f"{where}: the lift is {lift[0]:g} mm at the first row and {lift[-1]:g} mm one turn later: "
                f"the two must be equal"
            )
    elif span < TURN - 1.5 * largest_step and max(abs(lift[0]), abs(lift[-1])) > BASE_MM:
        raise InputError(
            f"{where}: the table covers {span:g} cam degrees and must begin and end on the base "
            f"circle, but its ends are {lift[0]:g} and {lift[-1]:g} mm: give one whole turn"
        )


def _foot(angle: np.ndarray, lift: np.ndarray, last: int, outward: int, largest_drop: float) -> tuple[float, bool]:
    """Outermost angle of the foot beside the row `last` of a flank, and whether its ramp was cut: then that row's."""
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
