"""The table of cam families in README.md: continuity of every junction, bounce with its range, rows of Markdown."""

import numpy as np

from camopt.cam.lift import Lift
from camopt.scene.units import DEG
from camopt.verifier.verdict import Verdict

CONTINUOUS = 1e-6
"""Largest step at a junction, relative to the derivative's largest value in the event, that counts as round-off."""
HIGHEST = 4
"""Highest derivative that is looked at."""
SAME_MM = 0.005
"""Ranges of bounce that are wider are printed."""
HEADS = (
    "cam", "area ratio", "acceleration [mm/deg²]", "jerk [mm/deg³]", "continuity: ramp; sections; nose",
)  # fmt: skip


def orders_of_continuity(lift: Lift) -> dict[str, list[int]]:
    """Order of the highest continuous derivative where the opening ramp ends, where sections meet, and at the nose.

    A derivative counts as continuous where all lower ones are and its step is at most CONTINUOUS of its largest value
    in the event; none above HIGHEST is looked at. Cams without sections have no junction but ramp and nose.
    """
    half = lift.half_duration
    first, last = np.searchsorted(lift.borders, [-half - 1e-9, half - 1e-9])
    widths = np.diff(lift.borders)
    ends = []  # per derivative: values at the start and the end of every piece
    for k in range(HIGHEST + 1):
        pieces = [np.polynomial.Polynomial(c).deriv(k) for c in lift.coefficients]
        ends.append(np.array([[p(0.0), p(w)] for p, w in zip(pieces, widths, strict=True)]))
    scale = [np.abs(values[first:last]).max() for values in ends]

    def order(angle: float) -> int:
        i = int(np.argmin(np.abs(lift.borders - angle)))
        for k, (values, largest) in enumerate(zip(ends, scale, strict=True)):
            if abs(values[i, 0] - values[i - 1, 1]) > CONTINUOUS * largest:
                return k - 1
        return HIGHEST

    inside = -half + np.cumsum(lift.parameters.get("sections_deg", ())[:-1]) * DEG
    return {"ramp": [order(-half)], "sections": [order(a) for a in inside], "nose": [order(0.0)]}


def bounces(verdict: Verdict) -> list[dict]:
    """Bounce per speed: the first method's with its error, its range over neighbouring motions, agreement."""
    keys = ("speed_rpm", "bounce_mm", "bounce_error_mm", "bounce_range_mm")
    found = [speed.as_dict() for speed in verdict.speeds]
    return [{**{k: s[k] for k in keys}, "methods_agree": s["verdict"] != "not converged"} for s in found]


def markdown(cams: list[dict]) -> list[str]:
    """Lines of the table: one row per cam under the conditions of Table 4."""
    rows = [cam for cam in cams if cam["limits"] == "Table 4"]
    speeds = [f"bounce {b['speed_rpm']:g}" for b in rows[0]["bounce"]]
    lines = ["| " + " | ".join([*HEADS, *speeds]) + " |", "|---" * (len(HEADS) + len(speeds)) + "|"]
    for cam in rows:
        low, high = cam["acceleration_min_mm_per_deg2"], cam["acceleration_max_mm_per_deg2"]
        orders = "; ".join(" ".join(map(str, found)) or "–" for found in cam["continuity"].values())
        shape = [f"{cam['area_ratio']:.4f}", f"{high:.4f} / −{-low:.4f}", f"{cam['jerk_max_mm_per_deg3']:.4f}", orders]
        lines.append("| " + " | ".join([f"`{cam['cam']}`", *shape, *(_bounce(b) for b in cam["bounce"])]) + " |")
    return lines


def _bounce(found: dict) -> str:
    """A bounce [mm] with the range of neighbouring motions where it is wide, marked where the methods disagree."""
    if found["bounce_mm"] is None:
        return "never seats"
    mark = "" if found["methods_agree"] else "*"
    low, high = found["bounce_range_mm"]
    if high - low > SAME_MM:
        return f"{low:.2f} to {high:.2f}{mark}"
    return f"{found['bounce_mm']:.3f}{mark}"
