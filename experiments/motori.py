"""Does a stiffer valve train make the contact force smoother, as Osman (2014) states of the tool MOTORI 2004?

The experiment has the counterparts of Figures 3 and 4 of the paper (motion and forces over the cam angle) and of
Figures 5 and 6 (contact force against train stiffness), and the metrics over a range of speeds. The paper's own Kurz
cam is not tabulated and is replaced by a Kurz-type cam of the scene's duration and lift. Speeds are camshaft speeds, as
in the tool.
"""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from camopt.cam.families.kurz import kurz
from camopt.cam.lift import Lift
from camopt.exact import prepare, settled_metrics
from camopt.measure.settling import Settled, settled_from_rest
from camopt.measure.sweep import at_speeds
from camopt.scene import MotionRefused, Scene, build_train, load_scene
from camopt.scene.parameters import matching, with_numbers
from camopt.scene.response import Response
from camopt.scene.units import DEG, MM, RPM
from experiments.support.panels import Panel, panels
from experiments.support.record import RESULTS, run_script, write_result

ENGINES = ("motori-1", "motori-2")
SECTIONS_DEG, DECELERATION = (24.3, 24.7, 23.0), -0.008
"""Section angles [deg] and a23 [mm/deg^2] of the cam, near the largest area under Kodama's acceleration limits; they
are the same for every variant, so that only the train changes."""
SPEED = 2000.0
STIFFNESS = {"small": (10, 50, 1000), "full": (2, 5, 10, 20, 50, 100, 150, 300, 600, 1000)}
DRAWN = (10, 20, 50, 1000)
SPAN = {"small": (500.0, 3500.0, 1500.0), "full": (300.0, 4000.0, 100.0)}
"""First and last camshaft speed and pitch [r/min]; the tool's own defaults at full size."""
TABLE = ("bounce_mm", "jump_mm", "jump_deg", "contact_force_min_N", "contact_force_max_N", "seating_velocity_m_per_s")


def main(size: str, folder=RESULTS) -> dict:
    """All tables and figures; at small size fewer stiffnesses and speeds, and no figures."""
    scenes = {name: load_scene(name) for name in ENGINES}
    content: dict = {"cam_speed_rpm": SPEED, "cam": cam_of(scenes["motori-1"]).parameters}
    content["stiffness"] = [row for zeta in (None, 0.1) for row in stiffness_table(scenes["motori-1"], size, zeta)]
    content["span"] = {name: span(scene, size) for name, scene in scenes.items()}
    figures = {}
    if size == "full":
        lift = cam_of(scenes["motori-1"])
        figures["group"] = group_figure({name: settled(s, lift, SPEED) for name, s in scenes.items()}, lift)
        figures["stiffness"] = stiffness_figure({k: drawn_forces(scenes["motori-1"], k) for k in DRAWN})
        figures["span"] = span_figure(content["span"])
    return write_result("motori", size, content, figures, folder)


def cam_of(scene: Scene) -> Lift:
    return kurz(scene, SECTIONS_DEG, DECELERATION)


def settled(scene: Scene, lift: Lift, cam_rpm: float) -> Settled:
    """The settled event-exact motion from rest at a camshaft speed [r/min]."""
    return settled_from_rest(prepare, build_train(scene), lift, cam_rpm * RPM)


def figures_of(scene: Scene, lift: Lift, cam_rpm: float) -> dict:
    """Metrics of the settled motion, and the contact force against that of a rigid valve train.

    `ripple_N`: root mean square, over the duration, of the contact force less m omega^2 h'' + F_2 of a valve that
    follows the cam; `landing_force_N`: largest contact force anywhere (the clearance closes on the ramp, outside the
    duration); `hop_um`: largest separation anywhere between the nominal closing and opening of the clearance.
    """
    try:
        motion = settled(scene, lift, cam_rpm)
    except MotionRefused as refused:
        return {"refused": str(refused)}
    response, metrics = motion.response, motion.metrics(lift)
    train, omega = response.train, cam_rpm * RPM
    angle = np.mod(response.angle + np.pi, 2 * np.pi) - np.pi
    spring = train.element_names.index("spring")
    rigid = np.maximum(0.0, train.mass[0] * omega**2 * lift(angle, 2) + train.preload[spring]
                       + train.stiffness[spring] * (lift(angle) - train.lash))  # fmt: skip
    contact = response.force[:, train.cam_side[0]]
    step = np.gradient(response.angle) * (np.abs(angle) <= lift.half_duration)
    lashed = np.abs(angle) < lift.closing_angle(train.lash)
    row = {name: metrics.worst(name) for name in TABLE}
    row["ripple_N"] = float(np.sqrt(np.sum(step * (contact - rigid) ** 2) / np.sum(step)))
    row["landing_force_N"] = float(contact.max())
    row["seat_force_max_N"] = float(response.force[:, train.seat].max())
    row["clash_force_max_N"] = float(response.force[:, train.element_names.index("coil_clash")].max())
    row["hop_um"] = round(response.separation(train.cam_side[0])[lashed].max() * 1e6, 6)  # smaller: round-off
    return row | {"periodic": motion.periodic}


def stiffened(scene: Scene, kN_per_mm: float, zeta: float | None) -> Scene:
    """The scene with another stiffness of the train, and its damping constant (None) or a damping ratio `zeta`."""
    new = {"train.stiffness_N_per_m": kN_per_mm * 1e6}
    if zeta is not None:
        new["train.damping_N_s_per_m"] = 2 * zeta * np.sqrt(kN_per_mm * 1e6 * scene.mass[0].mass_kg)
    return with_numbers(scene, {n: value for name, value in new.items() for n in matching(scene, name)})


def stiffness_table(scene: Scene, size: str, zeta: float | None) -> list[dict]:
    """The numbers of Figures 5 and 6: the contact force against the train's stiffness [kN/mm]."""
    lift = cam_of(scene)
    damping = "damping ratio 0.1" if zeta else "damping constant 1200 kg/s"
    rows = []
    for k in STIFFNESS[size]:
        row = {"engine": scene.name, "train_kN_per_mm": k, "kept": damping}
        rows.append(row | figures_of(stiffened(scene, k, zeta), lift, SPEED))
    return rows


def span(scene: Scene, size: str) -> dict[str, list[float]]:
    """Metrics over a range of camshaft speeds with start, end and step."""
    first, last, pitch = SPAN[size]
    speeds = np.arange(first, last + pitch / 2, pitch)
    rows = at_speeds(settled_metrics, scene, cam_of(scene), speeds / scene.required_operation.cam_per_crank)
    return {"cam_speed_rpm": speeds.tolist()} | {name: [row[name] for row in rows] for name in TABLE}


def drawn_forces(scene: Scene, kN_per_mm: float) -> dict[str, Response]:
    """Motions at one train stiffness, with constant damping and with constant damping ratio."""
    lift = cam_of(scene)
    dampings = {"damping constant kept (1200 kg/s)": None, "damping ratio kept (0.1)": 0.1}
    return {k: settled(stiffened(scene, kN_per_mm, zeta), lift, SPEED).response for k, zeta in dampings.items()}


EVENT = (-110, 110)
"""Range of cam angles of the figures [deg]: the event with its ramps."""
SPAN_ROWS = {
    "contact_force_max_N": "peak contact\nforce [N]",
    "contact_force_min_N": "least contact\nforce [N]",
    "jump_mm": "jump [mm]",
    "bounce_mm": "bounce [mm]",
    "seating_velocity_m_per_s": "seating\nvelocity [m/s]",
}


def group_figure(motions: Mapping[str, Settled], lift: Lift) -> Figure:
    """Counterpart of Figures 3 and 4: a column per engine of lift, velocity, acceleration and forces."""
    columns = [_group(name, motion.response, lift) for name, motion in motions.items()]
    return panels([*zip(*columns, strict=True)], "cam angle [deg]", EVENT, 9.5)


def _group(engine: str, response: Response, lift: Lift) -> list[Panel]:
    """The panels of one engine. Its spring acceleration -F2 / m is this project's interpretation of h0PR''."""
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
    """Counterpart of Figures 5 and 6: contact force against cam angle, a panel per train stiffness [kN/mm]."""
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


if __name__ == "__main__":
    run_script(main, __doc__)
