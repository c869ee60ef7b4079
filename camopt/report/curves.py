"""What the page's charts draw: the cams' laws, their bounce, jump and forces over the band, and the search."""

from typing import Any

import numpy as np

from camopt.cam.lift import Lift
from camopt.plots.style import DESIGN, page_line
from camopt.report.folder import RunFolder
from camopt.report.motion import RunCams
from camopt.scene.design import Design
from camopt.scene.quantities import QUANTITIES, is_number
from camopt.scene.units import DEG, MM, MM_PER_DEG, MM_PER_DEG2, MM_PER_DEG3

STEP_DEG = 0.5
DIGITS = 5
LAWS = (
    ("lift_mm", "Cam lift", "mm", MM, ("max_lift_mm",)),
    ("velocity_mm_per_deg", "Velocity", "mm/deg", MM_PER_DEG, ()),
    ("acceleration_mm_per_deg2", "Acceleration", "mm/deg²", MM_PER_DEG2,
     ("acceleration_max_mm_per_deg2", "acceleration_min_mm_per_deg2")),
    ("jerk_mm_per_deg3", "Jerk", "mm/deg³", MM_PER_DEG3, ("jerk_max_mm_per_deg3",)),
)  # fmt: skip
"""The lift and its derivatives: key, title, unit, SI unit, and the limits that are drawn with them."""
OVER_BAND = ("bounce_mm", "jump_mm", "contact_force_max_N", "contact_force_min_N", "seating_velocity_m_per_s")
SEARCHED = ("area_ratio", "worst_bounce_mm", "best_area_ratio")


def curves(run: RunFolder, cams: RunCams) -> dict[str, Any] | None:
    """Plain numbers for `curves.js`; None without a cam. A cam's `place` is "design", "within" or "beyond" the limits
    on the shape; the axes are made for the design and for the cams that are confirmed."""
    scene = cams.scene
    if scene is None or scene.design is None or not cams.lifts:
        return None
    end = min(180.0, np.ceil(max(_end_deg(lift) for lift in cams.lifts.values()) + 5))
    theta = np.arange(-end, end + STEP_DEG / 2, STEP_DEG) * DEG
    entries = [_cam(name, lift, theta, cams.verdicts.get(name, {})) for name, lift in cams.lifts.items()]
    return {
        "from_deg": -float(end),
        "step_deg": STEP_DEG,
        "duration_deg": scene.design.duration_deg,
        "laws": [
            {"key": key, "title": title, "unit": unit, "limits": _limits(scene.design, limits)}
            for key, title, unit, _, limits in LAWS
        ],
        "quantities": [
            {"key": q.name, "title": q.label.capitalize(), "unit": q.unit, "least": q.less_is_worse,
             "limits": _limits(scene.design, (q.limit or "",))}
            for q in map(QUANTITIES.__getitem__, OVER_BAND)
        ],
        "cams": entries,
        "search": {
            **{key: [_number(step.get(key)) for step in run.history] for key in SEARCHED},
            "stage": [str(step.get("stage", "")) for step in run.history],
            "confirmed": [step.get("confirmed") is True for step in run.history],
            "bound": _number(run.design.get("area_ratio_bound")),
            "delivered": _number(run.design.get("area_ratio")),
        },
    }  # fmt: skip


def _end_deg(lift: Lift) -> float:
    """Angle of the outermost piece that lifts."""
    flat = np.all(lift.coefficients == 0, axis=1)
    edges = np.concatenate([lift.borders[:-1][~flat], lift.borders[1:][~flat]])
    return float(np.abs(edges).max(initial=lift.half_duration)) / DEG


def _cam(name: str, lift: Lift, theta: np.ndarray, verdict: dict) -> dict[str, Any]:
    broken = [str(word) for word in verdict.get("broken") or []]
    lawful = all(" at " in word for word in broken)
    return {
        "name": name,
        **page_line(name),
        "place": DESIGN if name == DESIGN else "within" if lawful else "beyond",
        "verdict": str(verdict.get("verdict", "not verified")),
        **{
            key: [*map(_short, (lift(theta, order) / unit).tolist())] for order, (key, _, _, unit, _) in enumerate(LAWS)
        },
        "band": _band(verdict.get("band")),
    }


def _band(band: Any) -> dict[str, list] | None:
    """The curves over the band that a verdict states; the file is untrusted."""
    curves = band.get("curves") if isinstance(band, dict) else None
    speeds = curves.get("speed_rpm") if isinstance(curves, dict) else None
    if not isinstance(curves, dict) or not isinstance(speeds, list) or not speeds or not all(map(is_number, speeds)):
        return None
    values = {key: curves.get(key) for key in OVER_BAND}
    stated = {key: v for key, v in values.items() if isinstance(v, list) and len(v) == len(speeds)}
    return {"speed_rpm": speeds} | {key: [*map(_short, row)] for key, row in stated.items()}


def _limits(design: Design, keys: tuple[str, ...]) -> list[float]:
    """The limits that a design sets, both signs of that on the jerk."""
    values = [value for key in keys if (value := getattr(design, key, None)) is not None]
    return values + [-value for value in values if keys == ("jerk_max_mm_per_deg3",)]


def _number(value) -> float | None:
    return value if is_number(value) else None


def _short(value) -> float | None:
    """A number to DIGITS significant digits, None for what is none."""
    return float(f"{value:.{DIGITS}g}") if is_number(value) else None
