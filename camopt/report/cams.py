"""The report's sections on the cams themselves: curvature and contact with the follower, the contour, the cam card, and
the Hertz stress.
"""

import numpy as np

from camopt.cam.card import LIFTS_MM, CamCard, cam_card
from camopt.cam.contact import Contact
from camopt.cam.geometry import contact
from camopt.cam.hertz import HertzStress
from camopt.plots.style import DESIGN, cam_line
from camopt.report.motion import RunCams
from camopt.report.wording import shown
from camopt.scene import InputError, MotionRefused
from camopt.scene.units import DEG, MM
from camopt.study.cam_sheet import dynamic_stress, share_borne, static_stress

WIDTH = 320.0
"""Width of the drawing [px]."""


def geometry(cams: RunCams) -> dict | None:
    """Figures and faults per cam and a drawing of the design's contour; None where the scene has no [geometry].

    `none` has a sentence for each cam that the follower cannot run on. The tightest spot is where the contour's radius
    of curvature is smallest, convex or concave.
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
    return {"columns": keys, "rows": rows, "drawing": _drawing(contacts[chosen], chosen), "cam": chosen,
            "none": none}  # fmt: skip


def tightest(c: Contact) -> int:
    """Sample of the smallest radius of curvature, convex or concave; a cusp has one near zero."""
    return int(np.argmin(np.abs(c.radius_of_curvature)))


def _drawing(c: Contact, name: str) -> dict:
    """Contour, base circle and tightest spot in pixels, the nose up."""
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
    """By cam its card, at the lifts that it passes."""
    passed = {name: [height for height in LIFTS_MM if height * MM < lift.max_lift] for name, lift in cams.lifts.items()}
    return [(name, cam_card(lift, passed[name])) for name, lift in cams.lifts.items() if passed[name]]


def stress(cams: RunCams) -> tuple[list[list[str]], str]:
    """Rows on the largest Hertz stress of the design at each listed speed and standing still: stress [MPa], cam angle
    [deg], force [N], and the share of what the materials bear, where the scene says so; or the sentence on why none."""
    scene, lift = cams.scene, cams.lifts.get(DESIGN)
    if lift is None or scene is None:
        return [], "The design cannot be read, so there is no stress on it."
    if scene.geometry is None:
        return [], "The scene gives no [geometry], so the stress on the cam is not known."
    rows, geometry = [], scene.geometry

    def cells(found: HertzStress) -> list[str]:
        figures = found.figures()
        return [*map(shown, figures.values()), share_borne(figures["hertz_stress_MPa"], geometry) or "–"]

    try:
        for speed in scene.operation.speeds_rpm if scene.operation else ():
            try:
                found = cells(dynamic_stress(scene, lift, speed)[0])
            except MotionRefused as refused:
                found = ["–", "–", f"refused: {refused}", "–"]
            rows.append([f"{shown(speed)} r/min", *found])
        return [*rows, ["standing still", *cells(static_stress(scene, lift))]], ""
    except InputError as error:
        return [], f"There is no Hertz stress: {error}."
