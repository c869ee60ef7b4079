"""Figures of `experiments.table5`: valve lift and contact forces of the cams and of the methods, distance by step."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from camopt.plots import last_revolution, valve_motion
from camopt.scene.design import Design
from camopt.scene.response import Response
from experiments.support.panels import Panel, panels

Motions = Mapping[tuple[str, float], Response]
"""By cam or method, and speed [r/min]."""


def motion_figure(motions: Motions, design: Design) -> Figure:
    """Figures 5 to 8 and 12 to 15 in kind: the ninth revolution of the event-exact motion of each cam."""
    return valve_motion([last_revolution(cam, speed, response) for (cam, speed), response in motions.items()], design)


def methods_figure(motions: Motions, title: str) -> Figure:
    """The closing and the contact forces of one cam by several methods, a column per speed."""
    speeds = list(dict.fromkeys(speed for _, speed in motions))
    one = next(iter(motions.values()))
    contacts = [one.train.element_names[e] for e in one.train.cam_side]
    rows: list[list[Panel]] = [[] for _ in range(1 + len(contacts))]
    for i, speed in enumerate(speeds):
        here = [(name, last_revolution(name, speed, r)) for (name, s), r in motions.items() if s == speed]
        head = f"{title}, {speed:g} r/min"
        closing = [(name, m.cam_angle_deg, m.valve_mm) for name, m in here]
        rows[0].append(Panel("valve above\nseat touch [mm]" if i == 0 else "", closing, head, (-0.1, 0.8)))
        for row, contact in zip(rows[1:], contacts, strict=True):
            curves = [(name, m.cam_angle_deg, m.contact_force_N[contact] / 1e3) for name, m in here]
            row.append(Panel(f"{contact}\nforce [kN]" if i == 0 else "", curves))
    return panels(rows, "cam angle [deg]", (55, 140), 13, 2.0, sharey=True)


def steps_figure(distances: Sequence[Mapping]) -> Figure:
    """Distance between the methods and from the truth against the steps per revolution, a column per criterion."""
    columns = []
    criteria = list(dict.fromkeys(d["criterion"] for d in distances))
    for criterion in criteria:
        here = [d for d in distances if d["criterion"] == criterion]
        steps = np.array([d["steps_per_revolution"] for d in here], dtype=float)
        speeds = [key for key in here[0] if key.isdigit()]
        column = []
        for measure, label in (("rkg_to_tmm", "methods apart"), ("rkg_to_event", "Runge-Kutta-Gill\nto truth"),
                               ("tmm_to_event", "transition matrix\nto truth")):  # fmt: skip
            curves = [(f"{s} r/min", np.log2(steps / 1440), np.array([d[s][measure] for d in here])) for s in speeds]
            head = f"separation by {criterion}" if not column else ""
            column.append(Panel(f"{label} [mm]", curves, head, (0, 0.15)))
        columns.append(column)
    return panels([*zip(*columns, strict=True)], "halvings of 1440 steps per revolution", width=8.6)
