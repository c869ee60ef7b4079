"""The report's cam card: when each cam lets the valve open and close at the usual lifts."""

from camopt.cam.card import LIFTS_MM, cam_card
from camopt.plots.style import cam_line
from camopt.report.motion import RunCams
from camopt.report.wording import shown
from camopt.scene.units import MM

DIGITS = 5


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
            values = (event.lift_mm, event.opening_deg, event.closing_deg, event.duration_deg)
            cells = [
                shown(v, DIGITS) for v in (*values, round(event.centre_deg, 6) + 0.0, round(card.max_lift_deg, 6) + 0.0)
            ]
            rows.append({"cam": name, "colour": cam_line(name)["color"], "cells": cells})
    return rows
