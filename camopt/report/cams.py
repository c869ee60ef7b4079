"""Content of the report on its cams: the data of the charts (lift laws, bounce, jump and forces over the band, course
of the search), curvature and contact with the follower, the contour, the cam card, and the Hertz stress.
"""

from functools import lru_cache
from typing import Any

import numpy as np

from camopt.cam.card import LIFTS_MM, CamCard, cam_card
from camopt.cam.contact import Contact
from camopt.cam.geometry import contact
from camopt.cam.hertz import HertzStress
from camopt.cam.lift import Lift, angles_deg, lift_table
from camopt.plots.style import DESIGN, cam_line, page_line
from camopt.report.folder import RunFolder
from camopt.report.motion import RunCams
from camopt.report.wording import shown
from camopt.scene import InputError, MotionRefused, Scene
from camopt.scene.design import Design
from camopt.scene.quantities import QUANTITIES, is_number
from camopt.scene.units import DEG, MM
from camopt.study.cam_sheet import dynamic_stress, share_borne, static_stress

WIDTH = 320.0
"""Width of the drawing [px]."""


def geometry(cams: RunCams) -> dict | None:
    """Geometric values and faults of each cam and a drawing of the design's contour; None for a scene without
    [geometry].

    `none` has a sentence for each cam that the follower cannot run on. The tightest spot is where the contour's radius
    of curvature, convex or concave, is smallest in magnitude.
    """
    if cams.scene is None or cams.scene.geometry is None or not cams.lifts:
        return None
    contacts, none = {}, []
    for name, lift in cams.lifts.items():
        try:
            contacts[name] = contact(lift, cams.scene.geometry)
        except InputError as error:
            none.append(f"{name}: {error}")
    if not contacts:
        return {"none": none}
    keys = [key for key, value in next(iter(contacts.values())).figures().items() if value is not None]
    rows = [
        {"cam": name, "colour": cam_line(name)["color"], "cells": [c.figures()[k] for k in keys],
         "tightest": float(c.theta[tightest(c)] / DEG), "faults": "; ".join(c.faults()) or "none"}
        for name, c in contacts.items()
    ]  # fmt: skip
    chosen = DESIGN if DESIGN in contacts else next(iter(contacts))
    return {"columns": keys, "rows": rows, "drawing": _drawing(contacts[chosen], chosen), "none": none}


def tightest(c: Contact) -> int:
    """Index of the sample where the radius of curvature is smallest in magnitude; it is near zero at a cusp."""
    return int(np.argmin(np.abs(c.radius_of_curvature)))


def _drawing(c: Contact, name: str) -> dict:
    """Contour, base circle and tightest spot in pixels, with the nose up."""
    points = np.stack([c.contour[:, 1], -c.contour[:, 0]], axis=1) / MM
    low, high = points.min(axis=0), points.max(axis=0)
    scale = (WIDTH - 60) / float((high - low).max())
    origin = (30 - low[0] * scale, 30 - low[1] * scale)
    pixels = points * scale + origin
    i = tightest(c)
    thinned = pixels[:: max(1, len(pixels) // 1000)]
    radius = c.radius_of_curvature[i] / MM
    kind = "concave" if radius <= 0 else "convex"
    return {
        "width": round(float((high - low)[0] * scale) + 60, 1),
        "height": round(float((high - low)[1] * scale) + 60, 1),
        "contour": "M" + "L".join(f"{a:.1f} {b:.1f}" for a, b in thinned) + "Z",
        "colour": cam_line(name)["color"],
        "centre": (round(origin[0], 1), round(origin[1], 1)),
        "base": round(c.geometry.base_radius_mm * scale, 1),
        "spot": tuple(round(float(along), 1) for along in pixels[i]),
        "sentence": f"Tightest spot of {name}: {kind} radius {shown(abs(float(radius)))} mm at "
        f"{shown(float(c.theta[i] / DEG), 3)} deg.",
    }


def cards(cams: RunCams) -> list[tuple[str, CamCard]]:
    """Name and cam card of every cam, at those lifts of `LIFTS_MM` that are below its maximum lift."""
    passed = {name: [height for height in LIFTS_MM if height * MM < lift.max_lift] for name, lift in cams.lifts.items()}
    return [(name, cam_card(lift, passed[name])) for name, lift in cams.lifts.items() if passed[name]]


def stress(cams: RunCams) -> tuple[list[list[str]], str]:
    """Rows on the largest Hertz stress of the design at each listed speed and at standstill: stress [MPa], cam angle
    [deg], force [N], and the share of the permissible stress where the scene states one; and, where there are no rows,
    a sentence that gives the reason."""
    scene, lift = cams.scene, cams.lifts.get(DESIGN)
    if lift is None or scene is None:
        return [], "The design cannot be read, so there is no stress on it."
    if scene.geometry is None:
        return [], "The scene gives no [geometry], so the stress on the cam is not known."
    return _stress(scene, lift)  # pyright: ignore[reportArgumentType]  # both have a hash


@lru_cache(maxsize=4)  # a run writes its report twice: before the comparison and after it
def _stress(scene: Scene, lift: Lift) -> tuple[list[list[str]], str]:
    """`stress` for a scene with a geometry."""
    rows, geometry = [], scene.required_geometry

    def cells(largest: HertzStress) -> list[str]:
        figures = largest.figures()
        return [*map(shown, figures.values()), share_borne(figures["hertz_stress_MPa"], geometry) or "–"]

    try:
        for speed in scene.operation.speeds_rpm if scene.operation else ():
            try:
                row = cells(dynamic_stress(scene, lift, speed)[0])
            except MotionRefused as refused:
                row = ["–", "–", f"refused: {refused}", "–"]
            rows.append([f"{shown(speed)} r/min", *row])
        return [*rows, ["standing still", *cells(static_stress(scene, lift))]], ""
    except InputError as error:
        return [], f"There is no Hertz stress: {error}."


LAW_STEP_DEG = 0.5
DIGITS = 5
LAWS = (
    ("lift_mm", "Cam lift", "mm", ("max_lift_mm",)),
    ("velocity_mm_per_deg", "Velocity", "mm/deg", ()),
    ("acceleration_mm_per_deg2", "Acceleration", "mm/deg²",
     ("acceleration_max_mm_per_deg2", "acceleration_min_mm_per_deg2")),
    ("jerk_mm_per_deg3", "Jerk", "mm/deg³", ("jerk_max_mm_per_deg3",)),
)  # fmt: skip
"""The lift and its derivatives: column of the lift table, title, unit, and keys of the limits that are drawn."""
OVER_BAND = ("bounce_mm", "jump_mm", "contact_force_max_N", "contact_force_min_N", "seating_velocity_m_per_s")
SEARCHED = ("area_ratio", "worst_bounce_mm", "best_area_ratio")


def curves(run: RunFolder, cams: RunCams) -> dict[str, Any] | None:
    """Plain numbers for `curves.js`; None without a design or a cam. A cam's `place` is "design", or "within" or
    "beyond" the limits on the shape; the axes are scaled for the design and the confirmed cams."""
    scene = cams.scene
    if scene is None or scene.design is None or not cams.lifts:
        return None
    end = min(180.0, np.ceil(max(_end_deg(lift) for lift in cams.lifts.values()) + 5))
    inside = np.abs(angles_deg(LAW_STEP_DEG)) <= end
    entries = [_cam(name, lift, inside, cams.verdicts.get(name, {})) for name, lift in cams.lifts.items()]
    return {
        "from_deg": -float(end),
        "step_deg": LAW_STEP_DEG,
        "duration_deg": scene.design.duration_deg,
        "laws": [
            {"key": key, "title": title, "unit": unit, "limits": _limits(scene.design, limits)}
            for key, title, unit, limits in LAWS
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
    """Largest magnitude of the cam angle [deg] up to which a piece of the lift is not zero."""
    flat = np.all(lift.coefficients == 0, axis=1)
    edges = np.concatenate([lift.borders[:-1][~flat], lift.borders[1:][~flat]])
    return float(np.abs(edges).max(initial=lift.half_duration)) / DEG


def _cam(name: str, lift: Lift, inside: np.ndarray, verdict: dict) -> dict[str, Any]:
    table = lift_table(lift, LAW_STEP_DEG)
    broken = [str(word) for word in verdict.get("broken") or []]
    lawful = all(" at " in word for word in broken)
    return {
        "name": name,
        **page_line(name),
        "place": DESIGN if name == DESIGN else "within" if lawful else "beyond",
        "verdict": str(verdict.get("verdict", "not verified")),
        **{key: [*map(_rounded, table[key][inside].tolist())] for key, *_ in LAWS},
        "band": _band(verdict.get("band")),
    }


def _band(band: Any) -> dict[str, list] | None:
    """The curves over the band that a verdict records; None where the file, which is untrusted, has no valid ones."""
    curves = band.get("curves") if isinstance(band, dict) else None
    speeds = curves.get("speed_rpm") if isinstance(curves, dict) else None
    if not isinstance(curves, dict) or not isinstance(speeds, list) or not speeds or not all(map(is_number, speeds)):
        return None
    values = {key: curves.get(key) for key in OVER_BAND}
    stated = {key: v for key, v in values.items() if isinstance(v, list) and len(v) == len(speeds)}
    return {"speed_rpm": speeds} | {key: [*map(_rounded, row)] for key, row in stated.items()}


def _limits(design: Design, keys: tuple[str, ...]) -> list[float]:
    """The values of the limits that a design sets; the limit on the jerk with both signs."""
    values = [value for key in keys if (value := getattr(design, key, None)) is not None]
    return values + [-value for value in values if keys == ("jerk_max_mm_per_deg3",)]


def _number(value) -> float | None:
    return value if is_number(value) else None


def _rounded(value) -> float | None:
    """A number to DIGITS significant digits; None for any other value."""
    return float(f"{value:.{DIGITS}g}") if is_number(value) else None
