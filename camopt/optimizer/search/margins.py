"""Feedback of the margins of the path program, by kind and speed, from the limit usage of the judged motion.

The program is based on tied contacts, which cannot open; in the judged motion they do open. Where the motion uses more
of a limit than `AIM`, the margin of that flank at that speed is raised, and where it uses less the margin is lowered.
The step is halved when its sign changes, as in Rprop (Riedmiller and Braun 1993).
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
"""Target of the limit usage in the feedback; the rest is a reserve for speeds between and beside the program's."""
FIRST_MARGINS_N = np.array([10.0, 0.0, 15.0])
"""Initial margins [N] on the opening flank, on the closing flank and at the seat. Contact on the opening flank reduces
the vibration on the closing flank. With that at the seat, a quarter of the limit on the bounce, no adjuster fills."""
FORCE_RESERVE = 1.25
"""Factor on the design's own least contact force in the initial margins, as a reserve for other speeds."""
ALIKE = 0.045
"""Relative difference up to which the feedback treats speeds alike."""
FIRST_STEP_N, LEAST_STEP_N, LARGEST_STEP_N = 6.0, 0.5, 20.0
"""First, smallest and largest step of a margin [N]."""
GROWTH = 1.5
"""Factor on a step if the motion still breaks a limit after the last step in the same direction."""
IDLE, IDLE_ROUNDS = 0.5 * AIM, range(4, 14)
"""Limit usage below which a motion is far from all limits, and numbers of such motions in a row after which the unit of
force doubles. The unit may be too small, since the load on the seat does not determine the inertia forces."""
LARGEST_N = 80.0
"""Largest tension [N] that a margin may permit; far from a limit, more would only change what is not limited."""
MOST_ERROR = 1.5
"""Largest relative deviation from AIM that enters a step."""
TRACED = 0.4
"""Usage of the limit on the jump above which the feedback determines on which flank the contacts separate."""
MOST_SHARE = 4.0
"""Limit usage at which larger values are cut off."""
JUMPS = ("jump_mm", "jump_deg", "contact_force_min_N")
SEATINGS = ("bounce_mm", "seating_velocity_m_per_s", "impact_velocity_m_per_s")


def first_margins(design: Design, speeds: int, unit: float) -> np.ndarray:
    """Initial margins (3, s) [N]: FIRST_MARGINS_N times the `unit` of force (`force_unit`), but on the flanks at least
    FORCE_RESERVE the least contact force of the design."""
    on_flanks = FORCE_RESERVE * (design.contact_force_min_N or 0.0)
    return np.tile(np.maximum(unit * FIRST_MARGINS_N, [on_flanks, on_flanks, 0.0])[:, None], speeds)


@dataclass
class Feedback:
    """The margins (3, s) [N] of a search on the opening flank, on the closing flank and at the seat, by speed, and
    their last steps, which are multiples of `unit` newtons."""

    margins: np.ndarray
    unit: float
    step: np.ndarray = field(init=False)
    sign: np.ndarray = field(init=False)
    idle: int = 0

    def __post_init__(self) -> None:
        self.step = np.full(self.margins.shape, FIRST_STEP_N)
        self.sign = np.zeros(self.margins.shape)

    def update(self, used: np.ndarray) -> bool:
        """Updates the margins from the limit usage `used` (3, s), and returns whether the unit has grown."""
        self.idle = self.idle + 1 if 0.0 < used.max() < IDLE else 0  # the usage is zero where nothing is limited
        grows = self.idle in IDLE_ROUNDS
        self.unit *= 2.0 if grows else 1.0
        error = np.clip((used - AIM) / AIM, -1.0, MOST_ERROR)
        sign = np.sign(error)
        reversed_sign, short = self.sign * sign < 0, (self.sign > 0) & (used > 1.0)
        factor = np.where(reversed_sign, 0.5, np.where(short, GROWTH, 1.0))
        self.step, self.sign = np.clip(self.step * factor, LEAST_STEP_N, LARGEST_STEP_N), sign
        self.margins = np.maximum(self.margins + self.unit * self.step * error, -self.unit * LARGEST_N)
        return grows

    def go_back(self, margins: np.ndarray) -> None:
        """Moves the margins half way back to those of a feasible cam, `margins` (3, s) [N], and halves the steps."""
        self.margins, self.step = 0.5 * (self.margins + margins), np.maximum(0.5 * self.step, LEAST_STEP_N)


def used_by_kind(train: Train, lift: Lift, judged: Judged, cam_speeds: np.ndarray) -> np.ndarray:
    """Limit usage (3, s) of the judged motions at these cam speeds [rad/s], on the opening flank, on the closing flank
    and at the seat.

    The factor for aperiodic motions is included, as in the usage of the cam. A seating metric beyond its limit counts
    on the closing flank too, from which the valve comes. The usage at a speed also counts at speeds that differ by less
    than `ALIKE`, since margins that differ strongly from one speed to the next suit no speed between them.
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
    """Largest separation [m] of the contacts between cam and valve on either flank, in one settled revolution."""
    motion = prepare(train, lift, cam_speed)(state)
    apart = train.touch_compression - train.compression(motion.x, motion.lift)
    apart, theta = apart[:, list(train.cam_side)].max(axis=1), motion.angle
    flanks = (theta >= -lift.half_duration) & (theta < 0.0), (theta >= 0.0) & (theta <= lift.half_duration)
    return np.array([max(0.0, float(apart[flank].max())) for flank in flanks])
