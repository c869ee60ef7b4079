"""The report's sections on the cams themselves: curvature and contact with the follower, the contour, the cam card."""

import numpy as np

from camopt.cam.card import LIFTS_MM, cam_card
from camopt.cam.contact import Contact
from camopt.cam.geometry import contact
from camopt.plots.style import DESIGN, cam_line
from camopt.report.motion import RunCams
from camopt.report.wording import label_and_unit, shown
from camopt.scene import InputError
from camopt.scene.units import DEG, MM

WIDTH = 320.0
"""Width of the drawing [px]."""
CARD_DIGITS = 5


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
    keys = [key for key in keys if any(c.figures()[key] is not None for c in contacts.values())]
    rows = [
        {"cam": name, "colour": cam_line(name)["color"], "cells": [shown(c.figures()[k]) for k in keys],
         "tightest": shown(c.theta[tightest(c)] / DEG, 3), "faults": "; ".join(c.faults()) or "none"}
        for name, c in contacts.items()
    ]  # fmt: skip
    heads = [f"{label} [{unit}]" if unit else label for label, unit in map(label_and_unit, keys)]
    chosen = DESIGN if DESIGN in contacts else next(iter(contacts))
    return {"columns": heads, "rows": rows, "drawing": _drawing(contacts[chosen], chosen), "cam": chosen,
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


def cards(cams: RunCams) -> list[dict]:
    """A row per cam and lift that it passes: `cam`, `colour`, and `cells` of lift, opening, closing, duration, centre
    and the angle of the largest lift, in mm and cam degrees."""
    rows = []
    for name, lift in cams.lifts.items():
        lifts = [height for height in LIFTS_MM if height * MM < lift.max_lift]
        if not lifts:
            continue
        card = cam_card(lift, lifts)
        for event in card.events:
            middle, top = (round(angle, 6) + 0.0 for angle in (event.centre_deg, card.max_lift_deg))
            values = (event.lift_mm, event.opening_deg, event.closing_deg, event.duration_deg, middle, top)
            cells = [shown(value, CARD_DIGITS) for value in values]
            rows.append({"cam": name, "colour": cam_line(name)["color"], "cells": cells})
    return rows
