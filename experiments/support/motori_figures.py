"""Figures of `experiments.motori`: the tool's group view, contact force by train stiffness, and the span of speeds."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from camopt.cam.lift import Lift
from camopt.measure.settling import Settled
from camopt.scene.response import Response
from camopt.scene.units import DEG, MM
from experiments.support.panels import Panel, panels

EVENT = (-110, 110)
"""Cam angles drawn [deg]: the event with its ramps."""
SPAN_ROWS = {
    "contact_force_max_N": "peak contact\nforce [N]",
    "contact_force_min_N": "least contact\nforce [N]",
    "jump_mm": "jump [mm]",
    "bounce_mm": "bounce [mm]",
    "seating_velocity_m_per_s": "seating\nvelocity [m/s]",
}


def group_figure(motions: Mapping[str, Settled], lift: Lift) -> Figure:
    """Figures 3 and 4 in kind: a column per engine of lift, velocity and acceleration of cam and valve, all forces."""
    columns = [_group(name, motion.response, lift) for name, motion in motions.items()]
    return panels([*zip(*columns, strict=True)], "cam angle [deg]", EVENT, 9.5)


def _group(engine: str, response: Response, lift: Lift) -> list[Panel]:
    """The spring acceleration -F2 / m, what the spring alone gives the valve, is this project's reading of h0PR''."""
    turn = response.angle <= np.pi
    angle, x, v, force = response.angle[turn], response.x[turn, 0], response.v[turn, 0], response.force[turn]
    omega, degrees, mass = response.cam_speed, angle / DEG, response.train.mass[0]
    f1, f2, f3, f4 = (force[:, i] for i in range(4))
    total = f1 - f2 + f3 - f4
    speed = f"{engine}, {omega * 30 / np.pi:.0f} cam r/min"
    cam = lift(angle, 2) * omega**2
    accelerations = [("cam", degrees, cam / 1e3), ("valve", degrees, total / mass / 1e3)]
    return [
        Panel("lift [mm]", [("cam", degrees, lift(angle) / MM), ("valve", degrees, x / MM)], speed),
        Panel("velocity [m/s]", [("cam", degrees, lift(angle, 1) * omega), ("valve", degrees, v)]),
        Panel("acceleration\n[km/s²]", [*accelerations, ("spring", degrees, -f2 / mass / 1e3)]),
        Panel("cam, spring and\ntotal force [N]", [("F1", degrees, f1), ("F2", degrees, f2), ("F", degrees, total)]),
        Panel("seat and coil\nclash force [N]", [("F3", degrees, f3), ("F4", degrees, f4)]),
    ]


def stiffness_figure(motions: Mapping[float, Mapping[str, Response]]) -> Figure:
    """Figures 5 and 6 in kind: contact force against cam angle, a panel per train stiffness [kN/mm]."""
    rows = []
    for k, by_damping in motions.items():
        curves = []
        for label, response in by_damping.items():
            turn = response.angle <= np.pi
            curves.append((label, response.angle[turn] / DEG, response.force[turn, 0]))
        rows.append([Panel("F1 [N]", curves, f"train stiffness {k} kN/mm")])
    return panels(rows, "cam angle [deg]", EVENT, row_height=1.75)


def span_figure(spans: Mapping[str, dict]) -> Figure:
    """Metrics of the engines over the camshaft speed."""
    rows = []
    for key, label in SPAN_ROWS.items():
        curves = [(engine, np.array(s["cam_speed_rpm"]), np.array(s[key], dtype=float)) for engine, s in spans.items()]
        rows.append([Panel(label, curves)])
    return panels(rows, "camshaft speed [r/min]")
