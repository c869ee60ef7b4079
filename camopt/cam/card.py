"""The cam card: when a valve opens and closes at stated lifts, for how long, about which centre, and with what overlap.

Events are the exact crossings of the lift, from the roots of its pieces. On an asymmetric cam neither of them is half a
duration from the centre. Crank angles count from the top dead centre of gas exchange, where intake and exhaust overlap.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from camopt.cam.geometry import DURATION_LIFTS_MM, crossing
from camopt.cam.lift import Lift
from camopt.scene import InputError
from camopt.scene.units import DEG, MM

LIFTS_MM = tuple(DURATION_LIFTS_MM.values())
MOST_LIFTS = 1000
DECIMALS = 4
"""Decimals of an angle [deg] in a file: a third of a second of arc, far below the tolerance of a ground shaft."""
SAME_TOP = 1e-12
"""Difference from the largest lift, relative to it, that counts as rounding."""
COLUMNS = (
    "cam", "lift_mm", "opening_deg", "closing_deg", "duration_deg", "centre_deg",
    "opening_crank_deg", "closing_crank_deg", "duration_crank_deg", "overlap_crank_deg",
)  # fmt: skip
"""Columns of a card as a table; those of crank angles are None if the card has no timing."""


@dataclass(frozen=True)
class ValveEvent:
    """The event above the lift `lift_mm`: cam angles of opening and closing, from the middle of the cam's duration."""

    lift_mm: float
    opening_deg: float
    closing_deg: float

    @property
    def duration_deg(self) -> float:
        return self.closing_deg - self.opening_deg

    @property
    def centre_deg(self) -> float:
        """The middle between opening and closing."""
        return (self.closing_deg + self.opening_deg) / 2


@dataclass(frozen=True)
class CrankTiming:
    """Phase of a cam relative to the crank: `centre_deg` is the crank angle after top dead centre at which the cam
    angle is zero. The cam turns at `cam_per_crank` times the speed of the crank."""

    centre_deg: float
    cam_per_crank: float = 0.5

    @classmethod
    def of(cls, lift: Lift, by: str, value: float, *, at_mm: float, closing: bool = False, cam_per_crank=0.5):
        """The timing by one `value`: the "centre" [crank deg], the crank angle of "opening" or "closing", where the
        lift passes `at_mm`, or the lift at top dead centre "tdc-lift" [mm], on the opening or the `closing` flank.

        Raises InputError if the cam never has that lift.
        """
        if by == "centre":
            return cls(value, cam_per_crank)
        opens, closes = crossing(lift, (value if by == "tdc-lift" else at_mm) * MM)
        flank = closes if closing or by == "closing" else opens
        return cls((0.0 if by == "tdc-lift" else value) - flank / DEG / cam_per_crank, cam_per_crank)

    def crank_deg(self, cam_deg: float) -> float:
        """Crank angle after top dead centre at a cam angle."""
        return self.centre_deg + cam_deg / self.cam_per_crank


@dataclass(frozen=True)
class CamCard:
    """A cam's events at stated lifts; `str(card)` is the card as text, `rows()` as a table.

    `timing` is None if the phase of the cam relative to the crank is not known. `max_lift_deg` is the cam angle of the
    largest lift (the middle of a dwell there), `tdc_lift_mm` is the lift at top dead centre, and `overlaps` are the
    overlaps with another cam in crank degrees, one for each event.
    """

    name: str
    max_lift_mm: float
    max_lift_deg: float
    events: tuple[ValveEvent, ...]
    timing: CrankTiming | None = None
    tdc_lift_mm: float | None = None
    overlaps: tuple[float, ...] = ()

    def rows(self) -> list[list]:
        """One row of `COLUMNS` for every event."""
        rows = []
        for e, overlap in zip(self.events, self.overlaps or [None] * len(self.events), strict=True):
            crank: list[float | None] = [None] * 3
            if self.timing is not None:
                opening, closing = (self.timing.crank_deg(a) for a in (e.opening_deg, e.closing_deg))
                crank = [opening, closing, closing - opening]
            cam = self.name, e.lift_mm, e.opening_deg, e.closing_deg, e.duration_deg, e.centre_deg
            rows.append([*cam, *crank, overlap])
        return rows

    def cells(self) -> list[list[str | None]]:
        """The rows as written to a file: angles with `DECIMALS` decimals, lifts as the user gave them."""
        return [
            [name, f"{lift:.10g}", *(None if angle is None else f"{angle:z.{DECIMALS}f}" for angle in angles)]
            for name, lift, *angles in self.rows()
        ]

    def __str__(self) -> str:
        lines = [
            f"cam card of {self.name}: cam degrees from the middle of the duration",
            f"  largest lift {self.max_lift_mm:.4f} mm at {self.max_lift_deg:z.4f}",
        ]
        for event in self.events:
            lines.append(
                f"  {event.lift_mm:9.4f} mm  {event.opening_deg:10.4f} to {event.closing_deg:9.4f}, "
                f"{event.duration_deg:.4f} long, centre {event.centre_deg:z.4f}"
            )
        if self.timing is None:
            return "\n".join(lines)
        centre = self.timing.centre_deg
        lines.append(
            f"  on the crank, the middle {abs(centre):g} deg {'before' if centre < 0 else 'after'} TDC, "
            f"where the lift is {self.tdc_lift_mm:z.4f} mm"
        )
        for _, lift, *_, opening, closing, duration, overlap in self.rows():
            shared = "" if overlap is None else f", overlap {max(overlap, 0.0):.2f} deg"
            lines.append(
                f"  {lift:9.4f} mm  opens {dead_centre_words(opening)}, closes {dead_centre_words(closing)}, "
                f"{duration:.2f} deg{shared}"
            )
        return "\n".join(lines)


def cam_card(
    cam: Lift,
    lifts_mm: Sequence[float] = LIFTS_MM,
    *,
    name: str = "",
    timing: CrankTiming | None = None,
    other: "CamCard | None" = None,
) -> CamCard:
    """The card of a cam at these lifts [mm], by default 1 mm and 0.050 in; with a `timing`, also in crank angles.

    The card of the `other` cam of the cylinder, with the same lifts and a timing, adds the overlap: the crank angle
    from the later opening to the earlier closing about top dead centre, negative if both valves are below the lift in
    between. Raises InputError for a lift that the cam does not pass, and for cards that do not match.
    """
    if not 0 < len(lifts_mm) <= MOST_LIFTS:
        raise InputError(f"cam card: {len(lifts_mm)} lifts: from 1 to {MOST_LIFTS} are needed")
    events = []
    for height in lifts_mm:
        opening, closing = crossing(cam, height * MM)
        events.append(ValveEvent(float(height), opening / DEG, closing / DEG))
    at_tdc = None if timing is None else float(cam(-timing.centre_deg * timing.cam_per_crank * DEG)) / MM
    card = CamCard(name or cam.family, cam.max_lift / MM, top_angle(cam) / DEG, tuple(events), timing, at_tdc)
    if other is None:
        return card
    if timing is None or other.timing is None:
        raise InputError("cam card: an overlap needs the crank angle of both cams' centres")
    if [e.lift_mm for e in other.events] != [e.lift_mm for e in events]:
        raise InputError("cam card: an overlap needs both cams' events at the same lifts")
    turn = 360 / timing.cam_per_crank
    nearest = turn * round((timing.centre_deg - other.timing.centre_deg) / turn)
    overlaps = []
    for row, other_row in zip(card.rows(), other.rows(), strict=True):
        (opening, closing), (other_opening, other_closing) = row[6:8], other_row[6:8]
        overlaps.append(min(closing, other_closing + nearest) - max(opening, other_opening + nearest))
    return replace(card, overlaps=tuple(overlaps))


def top_angle(cam: Lift) -> float:
    """Cam angle [rad] of the largest lift, or the middle of a dwell there."""
    angles = np.concatenate([cam.borders, cam.roots(1)])
    heights = cam(angles)
    top = angles[heights >= heights.max() * (1 - SAME_TOP)]
    return float(top.min() + top.max()) / 2


def dead_centre_words(crank_deg: float | None) -> str:
    """A crank angle after top dead centre relative to the nearer dead centre, such as `12.00 deg before TDC`."""
    assert crank_deg is not None, "a card with a timing"
    half_turns = round(crank_deg / 180)
    away = crank_deg - 180 * half_turns
    side = "before" if away < 0 else "after"
    return f"{abs(away):.2f} deg {side} {'BDC' if half_turns % 2 else 'TDC'}"
