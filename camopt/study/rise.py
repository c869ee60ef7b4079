"""Dwell-rise-dwell as a design: the motion of least acceleration, jerk or higher derivative between two dwells.

The unit problem has its program, its bound and its closed forms in `camopt.optimizer.program.dwell_rise`; here it has a
rise in millimetres over cam degrees and a table.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import PPoly

from camopt.optimizer.program.dwell_rise import LEAST_JERK, DwellRise, least_acceleration, least_peak
from camopt.scene.errors import InputError

ORDERS = {"acceleration": 2, "jerk": 3, "snap": 4, "crackle": 5}
"""Derivatives whose peak can be the least, with their orders."""
NAMES = {order: name for name, order in ORDERS.items()}
COLUMNS = ("lift_mm", "velocity_mm_per_deg", "acceleration_mm_per_deg2", "jerk_mm_per_deg3")
MOST_ROWS = 360_000


@dataclass(frozen=True)
class Rise:
    """A rise of `rise_mm` over `over_deg` cam degrees, at rest before and after, of least peak of derivative `order`.

    With a `jerk_max_mm_per_deg3` the derivative is the acceleration, and it is zero at both ends.
    """

    rise_mm: float
    over_deg: float
    order: int
    jerk_max_mm_per_deg3: float | None
    unit: DwellRise

    @property
    def peak(self) -> float:
        """The peak [mm/deg^order]."""
        return self.unit.peak * self.rise_mm / self.over_deg**self.order

    @property
    def bound(self) -> float:
        """What the peak of no such motion is below [mm/deg^order]."""
        return self.unit.bound * self.rise_mm / self.over_deg**self.order

    @cached_property
    def lift(self) -> PPoly:
        """The lift [mm] from 0 to `over_deg`."""
        values = self.unit.derivative * self.rise_mm / self.over_deg**self.order
        if self.jerk_max_mm_per_deg3 is None:
            return PPoly(values[None], np.linspace(0.0, self.over_deg, len(values) + 1)).antiderivative(self.order)
        edges = np.linspace(0.0, self.over_deg, len(values))
        return PPoly(np.stack([np.diff(values) / np.diff(edges), values[:-1]]), edges).antiderivative(self.order)

    def table(self, step_deg: float) -> dict[str, np.ndarray]:
        """Columns at every step [deg] and at the end: cam angle, lift, and its derivatives up to the limited one.

        Raises InputError for a step with too many rows.
        """
        if self.over_deg / step_deg > MOST_ROWS:
            raise InputError(f"--step-deg {step_deg:g}: a table has at most {MOST_ROWS} rows: take a larger step")
        angle = np.append(np.arange(0.0, self.over_deg * (1 - 1e-9), step_deg), self.over_deg)
        highest = self.order if self.jerk_max_mm_per_deg3 is None else self.order + 1
        columns = {name: self.lift(angle, k) for k, name in enumerate(COLUMNS[: highest + 1])}
        return {"cam_angle_deg": angle, **columns}

    def as_dict(self) -> dict:
        """What `rise --json` writes."""
        limits = {"rise_mm": self.rise_mm, "over_deg": self.over_deg, "jerk_max_mm_per_deg3": self.jerk_max_mm_per_deg3}
        limited = f"{NAMES[self.order]}_mm_per_deg{self.order}"
        return limits | {"least": NAMES[self.order], f"{limited}_peak": self.peak, f"{limited}_bound": self.bound}

    def __str__(self) -> str:
        name, unit = NAMES[self.order], f"mm/deg^{self.order}"
        jerk = self.jerk_max_mm_per_deg3
        under = "" if jerk is None else f", the jerk at most {jerk:g} mm/deg^3"
        return (
            f"A rise of {self.rise_mm:g} mm over {self.over_deg:g} deg between two dwells{under}:\n"
            f"  a motion has a peak {name} of        {self.peak:.6g} {unit}\n"
            f"  no motion has less (certified)     {self.bound:.6g} {unit}"
        )


def rise(rise_mm: float, over_deg: float, order: int = 3, jerk_max_mm_per_deg3: float | None = None) -> Rise:
    """The rise between two dwells whose derivative of `order` has the least peak, or the least acceleration under a
    jerk. Raises InputError where no motion keeps the jerk."""
    if jerk_max_mm_per_deg3 is None:
        return Rise(rise_mm, over_deg, order, None, least_peak(order))
    least = LEAST_JERK * rise_mm / over_deg**3
    if jerk_max_mm_per_deg3 <= least:
        raise InputError(
            f"--jerk-max-mm-per-deg3 {jerk_max_mm_per_deg3:g}: a rise of {rise_mm:g} mm over {over_deg:g} deg needs "
            f"more than {least:.6g}: allow more jerk or more degrees"
        )
    unit = least_acceleration(jerk_max_mm_per_deg3 * over_deg**3 / rise_mm)
    return Rise(rise_mm, over_deg, 2, jerk_max_mm_per_deg3, unit)
