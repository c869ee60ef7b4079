"""Margins of the path program by kind and speed, fed back from how much of its limits the judged motion uses.

The program sees tied contacts, which cannot open; the judge sees how far they do. Where the motion uses more of a limit
than `AIM` the margin of that flank at that speed rises, where it uses less it falls, by a step that halves where its
sign changes (as the steps of Rprop: Riedmiller and Braun 1993).
"""

from dataclasses import dataclass, field

import numpy as np

from camopt.cam.lift import Lift
from camopt.exact.engine import prepare
from camopt.measure.limits import LEAST_LIMIT
from camopt.optimizer.program.force_rows import CLOSING, OPENING, SEAT
from camopt.optimizer.search.judge import Judged
from camopt.scene.design import Design
from camopt.scene.train import Train
from camopt.scene.units import MM

AIM = 0.8
"""Share of a limit that the feedback aims at: what is left is for the speeds between, and for those beside them."""
FIRST_MARGINS_N = np.array([10.0, 0.0, 15.0])
"""Margins at first, on the opening flank, the closing flank and at the seat: a flank that opens with contact excites
less vibration on the other one, and with a quarter of the limit on the bounce at the seat an adjuster does not fill."""
ASKED_TIMES = 1.25
"""Multiple of the design's own least force with which a search begins: it is to keep some of it for other speeds."""
ALIKE = 0.045
"""Relative distance within which speeds are alike."""
FIRST_STEP_N, LEAST_STEP_N, LARGEST_STEP_N = 6.0, 0.5, 20.0
GROWTH = 1.5
"""Growth of a step while the motion still breaks a limit after the last one."""
IDLE, IDLE_ROUNDS = 0.5 * AIM, range(4, 14)
"""Share of its limits below which a motion is far from all of them, and with which such motions in a row the unit
doubles: the load on the seat does not say how large the forces of inertia are."""
LARGEST_N = 80.0
"""Tension [N] that a margin may allow: where a limit is far, more of it would only change what is not limited."""
MOST_ERROR = 1.5
TRACED = 0.4
"""Share of the limit on the jump from which it is told on which flank the contacts part."""
MOST_SHARE = 4.0
JUMPS = ("jump_mm", "jump_deg", "contact_force_min_N")
SEATINGS = ("bounce_mm", "seating_velocity_m_per_s", "impact_velocity_m_per_s")


def first_margins(design: Design, speeds: int, unit: float) -> np.ndarray:
    """The margins (3, s) [N] to begin with: those times the `unit` of force (`force_unit`), or a little more than the
    least force that the design asks for."""
    asked = ASKED_TIMES * (design.contact_force_min_N or 0.0)
    return np.tile(np.maximum(unit * FIRST_MARGINS_N, [asked, asked, 0.0])[:, None], speeds)


@dataclass
class FedBack:
    """The margins (3, s) [N] of a search, opening flank, closing flank and seat by speed, with their last steps in
    `unit` newtons."""

    margins: np.ndarray
    unit: float
    step: np.ndarray = field(init=False)
    sign: np.ndarray = field(init=False)
    idle: int = 0

    def __post_init__(self) -> None:
        self.step = np.full(self.margins.shape, FIRST_STEP_N)
        self.sign = np.zeros(self.margins.shape)

    def follow(self, used: np.ndarray) -> bool:
        """Moves the margins by what the motion used (3, s) of its limits, and says whether the unit has grown."""
        self.idle = self.idle + 1 if 0.0 < used.max() < IDLE else 0  # zero where nothing is limited
        grows = self.idle in IDLE_ROUNDS
        self.unit *= 2.0 if grows else 1.0
        error = np.clip((used - AIM) / AIM, -1.0, MOST_ERROR)
        sign = np.sign(error)
        turned, short = self.sign * sign < 0, (self.sign > 0) & (used > 1.0)
        factor = np.where(turned, 0.5, np.where(short, GROWTH, 1.0))
        self.step, self.sign = np.clip(self.step * factor, LEAST_STEP_N, LARGEST_STEP_N), sign
        self.margins = np.maximum(self.margins + self.unit * self.step * error, -self.unit * LARGEST_N)
        return grows

    def go_back(self, held: np.ndarray) -> None:
        """Moves the margins half way back to those of a cam that holds (3, s) [N], and halves the steps."""
        self.margins, self.step = 0.5 * (self.margins + held), np.maximum(0.5 * self.step, LEAST_STEP_N)


def used_by_kind(train: Train, lift: Lift, judged: Judged, cam_speeds: np.ndarray) -> np.ndarray:
    """Shares (3, s) of the limits that the judged motions at these cam speeds [rad/s] use: on the opening flank, on the
    closing flank, at the seat.

    What a motion that wanders uses counts with room for what it has not met yet, as it does for the cam. A seating
    beyond its limit counts on the closing flank too, from which the valve comes. What is used at a speed counts at
    those `ALIKE` too: margins that differ from one speed to the next suit no speed between them.
    """
    used = np.zeros((3, len(cam_speeds)))
    for metric, share, limit in zip(judged.limited, judged.spread * judged.share, judged.limit, strict=True):
        share = np.minimum(share, MOST_SHARE)
        if metric in SEATINGS:
            used[SEAT] = np.maximum(used[SEAT], share)
            used[CLOSING] = np.maximum(used[CLOSING], np.where(share > 1.0, share, 0.0))
        elif metric in JUMPS:
            flanks = np.stack([share, share])
            for s in np.flatnonzero(share > TRACED) if metric == "jump_mm" else ():
                if np.all(np.isfinite(judged.states[s])):
                    apart = _openings(train, lift, cam_speeds[s], judged.states[s]) / (max(limit, LEAST_LIMIT) * MM)
                    flanks[:, s] = np.minimum(apart * share[s] / max(apart.max(), 1e-9), MOST_SHARE)
            used[[OPENING, CLOSING]] = np.maximum(used[[OPENING, CLOSING]], flanks)
    alike = np.abs(cam_speeds[:, None] / cam_speeds - 1.0) <= ALIKE
    return np.where(alike, used[:, None, :], 0.0).max(axis=2)


def _openings(train: Train, lift: Lift, cam_speed: float, state: np.ndarray) -> np.ndarray:
    """Largest separation [m] of the contacts between cam and valve on the opening and the closing flank, in the
    revolution from a settled state."""
    motion = prepare(train, lift, cam_speed)(state)
    apart = train.touch_compression - train.compression(motion.x, motion.lift)
    apart, theta = apart[:, list(train.cam_side)].max(axis=1), motion.angle
    flanks = (theta >= -lift.half_duration) & (theta < 0.0), (theta >= 0.0) & (theta <= lift.half_duration)
    return np.array([max(0.0, float(apart[flank].max())) for flank in flanks])
