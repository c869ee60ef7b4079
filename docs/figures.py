"""Draws the figures of the pages: `python -m docs.figures` writes docs/model-metrics.png, docs/model-train.png and
docs/smoothing.png.

The first shows the settled event-exact motion of a scene's Polydyne; its labelled angles and values are those of the
metrics. The second is a sketch of a bucket tappet as it is modelled. The third, of docs/how-to/smoothing.md, shows the
computed force of a contact for several widths of its layer and several values of the tie.
"""

import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon, Rectangle

import camopt
from camopt.cam.lift import Lift
from camopt.exact.engine import prepare
from camopt.measure.hermite import Hermite
from camopt.measure.metrics import measure
from camopt.measure.settling import settle
from camopt.plots.style import BASE, INK, LIMIT, new_figure, styled
from camopt.scene.response import Response
from camopt.scene.rest import rest_position
from camopt.scene.train import build_train
from camopt.scene.units import DEG, MM
from camopt.smooth.laws import Layer, raw_force
from camopt.storage import write_bytes

STEEL, CAM, COIL = "#c8d2dc", "#9A6A00", "#0072B2"
VALVE = COIL


@styled
def model_train():
    """The train, and the forces of its elements against compression."""
    figure = new_figure(8.4, 3.6)
    scheme, laws = figure.subplots(1, 2, width_ratios=(1.15, 1))
    _scheme(scheme)
    _laws(laws)
    return figure


def _scheme(axes: Axes) -> None:
    """Cam, mass, spring and seat on the valve's axis; x is positive downwards, the opening direction of the valve."""
    angle = np.linspace(0, 2 * np.pi, 200)
    radius = 0.62 + 0.33 * np.exp(-(((angle - 1.1 * np.pi) / 0.5) ** 2))
    axes.add_patch(Polygon(np.column_stack([radius * np.cos(angle), 4.8 + radius * np.sin(angle)]), fc="w", ec=CAM))
    axes.add_patch(Rectangle((-0.9, 3.3), 1.8, 0.75, fc=STEEL, ec="k"))
    axes.plot([0, 0], [3.3, 1.0], color="k", linewidth=3)
    axes.plot([-0.75, 0.75], [1.03, 1.03], color="k", linewidth=3)
    y = np.linspace(1.75, 3.3, 60)
    axes.plot(
        1.35 + 0.16 * np.sign(np.sin(9 * (y - 1.75) * np.pi)) * np.abs(np.sin(9 * (y - 1.75) * np.pi)), y, color=COIL
    )
    axes.plot([0.9, 1.35], [3.3, 3.3], color=COIL)
    for left in (-1.7, 0.35):
        axes.add_patch(Rectangle((left, 1.08), 1.35, 0.28, fc="w", ec="k", hatch="////"))
    axes.add_patch(Rectangle((1.05, 1.36), 0.65, 0.39, fc="w", ec="k", hatch="////"))
    axes.annotate("", (-2.1, 2.3), (-2.1, 4.2), arrowprops={"arrowstyle": "-|>", "linewidth": 1})
    axes.text(-2.2, 3.2, "x: the valve opens", rotation=90, ha="right", va="center", fontsize=BASE - 1)
    words = (
        (4.6, "cam, which turns and pushes by the lift"),
        (4.18, 'contact "cam": pushes only, its gap is the lash'),
        (3.65, "mass: valve, bucket, retainer"),
        (2.6, 'spring: ["valve", "ground"], preloaded'),
        (0.95, 'contact "seat": ["ground", "valve"]'),
    )
    for height, text in words:
        axes.text(2.0, height, text, va="center", fontsize=BASE - 1)
    axes.plot([0.35, 1.9], [4.22, 4.18], color="#888888", linewidth=0.6)
    axes.plot([0.8, 1.9], [0.99, 0.95], color="#888888", linewidth=0.6)
    axes.set(xlim=(-2.7, 6.6), ylim=(0.5, 6.1), aspect="equal")
    axes.set_axis_off()
    axes.set_title("A train of one mass and three elements")


def _laws(axes: Axes) -> None:
    """Elastic force against compression of a spring, a contact and a contact with a gap."""
    d = np.linspace(-1.2, 1.0, 200)
    axes.axhline(0, color="#888888", linewidth=0.6)
    axes.axvline(0, color="#888888", linewidth=0.6)
    axes.plot(d, 0.5 + 0.55 * d, color=COIL, label="spring with a preload: pushes and pulls")
    axes.plot(
        d, np.maximum(0.0, 0.3 + 1.3 * d), color=LIMIT, linestyle="--", label="contact with a preload: pushes only"
    )
    axes.plot(d, np.maximum(0.0, 1.3 * (d - 0.3)), color=CAM, linestyle=":", label="contact with a gap: touches later")
    axes.set(xticks=[0], yticks=[0], xlabel="compression d", ylabel="elastic force p")
    axes.legend(fontsize=BASE - 1, loc="upper left")
    axes.set(ylim=(-0.3, 2.2))
    axes.set_title("What elements do")


SMOOTHED, SMOOTHED_RPM = "kodama", 7000
"""The scene's Polydyne jumps at this speed."""
WIDTHS_UM = (2.0, 6.0)
TIES = {0.0: "#9A6A00", 0.01: "#009E73", 1.0: "#0072B2"}


@styled
def smoothing():
    """Force against compression for two widths, and force against cam angle for three values of the tie."""
    figure = new_figure(8.4, 3.4)
    layer, tie = figure.subplots(1, 2, width_ratios=(1, 1.35))
    u = np.linspace(-4.0, 6.0, 400)
    layer.plot(u, np.maximum(u, 0.0), color=INK, label="law of the scene")
    for width, line in zip(WIDTHS_UM, ((0, (5, 2)), (0, (1, 1.5))), strict=True):
        force = raw_force(u * 1e-6, 0.0 * u, 1e6, 0.0, Layer(width * 1e-6))
        layer.plot(u, np.asarray(force), color=LIMIT, linestyle=line, label=f"width_um = {width:g}")
    layer.set(xlabel="compression [um]", ylabel="force [N] at 1 N/um", title="The layer")
    layer.legend(fontsize="small")
    scene = camopt.load_scene(SMOOTHED)
    cam = camopt.polydyne(scene)
    contact = next(one.name for one in scene.element if one.cam_driven)
    motions = {"exact": camopt.simulate(scene, cam, SMOOTHED_RPM)}
    motions |= {f"tie = {share:g}": camopt.simulate(scene, cam, SMOOTHED_RPM, "smooth", tie=share) for share in TIES}
    for (name, motion), color in zip(motions.items(), (INK, *TIES.values()), strict=True):
        shown = (motion.revolution == 1) & (abs(motion.cam_angle_deg) < 80)
        force = motion.force_N.sel(element=contact)[shown]
        line = (0, (5, 2)) if name == "tie = 0" else "-"
        tie.plot(motion.cam_angle_deg[shown], force, color=color, label=name, linestyle=line, linewidth=1.2)
    tie.axhline(0.0, color=INK, linewidth=0.6)
    tie.set(xlabel="cam angle [deg]", ylabel="force at the cam [N]", ylim=(-500, 1800), title="The tie")
    tie.legend(fontsize="small", ncols=2)
    return figure


SCENE, SPEED_RPM = "motori-1", 6000
"""At this speed the jump and the bounce of the scene's Polydyne are large enough to be seen in the figure."""
EVENT, WINDOW = "#e8eef4", "#f6ecd9"


@dataclass(frozen=True)
class Drawn:
    """A cam's settled motion and the labelled values of the figure: angles in deg, lengths in mm."""

    lift: Lift
    response: Response
    lash_mm: float
    touch_deg: float
    nominal_deg: float
    figures: dict[str, float]  # metrics of the first measured revolution


def motion() -> Drawn:
    """The settled motion of the figure."""
    scene = camopt.load_scene(SCENE)
    train, lift = build_train(scene), camopt.polydyne(scene)
    rest = np.concatenate([rest_position(train), np.zeros(len(train.mass))])
    response = settle(prepare(train, lift, scene.cam_speed(SPEED_RPM)), rest).response
    distance = Hermite(response.angle, response.seat_separation(), response.v[:, train.valve] / response.cam_speed)
    touch = distance.falls_through_zero(0.0, 2 * np.pi + lift.opening_foot)[0]
    figures = {name: float(values[0]) for name, values in measure(response, lift).items()}
    return Drawn(lift, response, train.lash / MM, touch / DEG, lift.closing_angle(train.lash) / DEG, figures)


@styled
def model_metrics(drawn: Drawn):
    """The cam's lift and the valve's motion, the separation between them, and an enlarged view of the closing."""
    figure = new_figure(8.4, 6.4)
    top, below = figure.subfigures(2, 1, height_ratios=(1.25, 1))
    whole = top.subplots()
    jump, closing = below.subplots(1, 2, width_ratios=(1, 1.25))
    _whole(whole, drawn)
    _jump(jump, drawn)
    _closing(closing, drawn)
    return figure


def _curves(drawn: Drawn) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angle [deg], cam lift [mm] and distance of the valve from its seat touch [mm] of the record."""
    response = drawn.response
    return response.angle / DEG, response.lift / MM, response.seat_separation() / MM


def _name(axes: Axes, words: str, at: tuple[float, float], text: tuple[float, float], **look) -> None:
    """Writes a label with an arrow to a point of the data."""
    arrow = {"arrowstyle": "-|>", "linewidth": 0.7, "color": "#333333", "shrinkB": 1}
    axes.annotate(words, at, text, fontsize=BASE - 1, arrowprops=arrow, va="center", **{"ha": "center"} | look)


def _span(axes: Axes, low: float, high: float, height: float, words: str, above: float) -> None:
    """Draws a double arrow from one angle to another, with words above it."""
    axes.annotate("", (low, height), (high, height), arrowprops={"arrowstyle": "<|-|>", "linewidth": 0.8})
    axes.text(0.5 * (low + high), height + above, words, ha="center", va="bottom", fontsize=BASE - 1)


def _whole(axes: Axes, drawn: Drawn) -> None:
    angle, cam, valve = _curves(drawn)
    half, foot = drawn.lift.half_duration / DEG, drawn.lift.opening_foot / DEG
    ramp = float(drawn.lift(-drawn.lift.half_duration)) / MM
    axes.axvspan(-half, half, color=EVENT, zorder=0)
    axes.plot(angle, cam, color=CAM, linestyle=(0, (5, 2)), label="lift of the cam above the base circle")
    axes.plot(angle, valve, color=VALVE, label="distance s of the valve from where its seat touches")
    axes.plot([-half, half], [ramp, ramp], "o", color=CAM, markersize=4)
    axes.plot([foot, -foot], [0, 0], "s", color=CAM, markersize=4)
    axes.axhline(drawn.lift.max_lift / MM, color="#888888", linewidth=0.7)
    axes.text(-128, 9.55, f"maximum lift {drawn.lift.max_lift / MM:g} mm, ramps included", fontsize=BASE - 1)
    _span(axes, -half, half, 1.1, f"duration D = {2 * half:g} deg, from ramp top to ramp top", 0.15)
    axes.text(0, 2.5, "jump and contact forces are judged inside", ha="center", fontsize=BASE - 1)
    _name(axes, f"ramp top: the lift is\nthe ramp height, {ramp:g} mm", (-half, ramp), (-93, 3.6))
    _name(axes, "opening foot:\nthe lift\nleaves zero", (foot, 0), (-112, 1.6))
    _name(axes, "closing foot", (-foot, 0), (114, 1.6))
    _name(axes, "ramp top", (half, ramp), (93, 3.0))
    axes.set(xlim=(-130, 130), ylim=(-0.3, 11.9), xlabel="cam angle [deg]", ylabel="mm")
    axes.set_title(f"{SCENE}, its Polydyne, {SPEED_RPM} r/min, settled event-exact motion")
    axes.legend(loc="upper right", fontsize=BASE - 1)


def _jump(axes: Axes, drawn: Drawn) -> None:
    response, half = drawn.response, drawn.lift.half_duration / DEG
    angle = response.angle / DEG
    gap = response.separation(response.train.cam_side[0]) / MM
    inside = np.abs(angle) <= half
    most = int(np.argmax(np.where(inside, gap, 0.0)))
    axes.axvspan(-half, half, color=EVENT, zorder=0)
    axes.fill_between(angle, gap, color=LIMIT, alpha=0.25, linewidth=0)
    axes.plot(angle, gap, color=LIMIT)
    words = f"jump {drawn.figures['jump_mm']:.2f} mm,\nover {drawn.figures['jump_deg']:.0f} deg in all"
    _name(axes, words, (angle[most], gap[most]), (-30, 1.3 * gap[most]))
    _name(axes, f"the lash\n({drawn.lash_mm:g} mm)", (-108, drawn.lash_mm), (-106, 0.94 * gap[most]))
    axes.set(xlim=(-130, 130), ylim=(0, 1.45 * gap[most]), xlabel="cam angle [deg]", ylabel="mm")
    axes.set_title("Separation of the contact at the cam")


def _closing(axes: Axes, drawn: Drawn) -> None:
    angle, cam, valve = _curves(drawn)
    start, bounce = min(drawn.touch_deg, drawn.nominal_deg), drawn.figures["bounce_mm"]
    low, high = start - 12, start + 26
    window = (angle >= start) & (angle <= 180)
    hop = np.flatnonzero(window)[np.argmax(valve[window])]
    axes.axvspan(start, high, color=WINDOW, zorder=0)
    axes.plot(angle, cam, color=CAM, linestyle=(0, (5, 2)))
    axes.plot(angle, valve, color=VALVE)
    axes.axhline(drawn.lash_mm, color="#888888", linewidth=0.7)
    axes.plot([drawn.nominal_deg], [drawn.lash_mm], "o", color=CAM, markersize=4)
    axes.plot([drawn.touch_deg], [0], "o", color=VALVE, markersize=4)
    axes.text(low + 0.3, drawn.lash_mm + 0.01, f"lash {drawn.lash_mm:g} mm", fontsize=BASE - 1)
    speed = drawn.figures["seating_velocity_m_per_s"]
    _name(axes, f"touch, at the seating\nvelocity {speed:.2f} m/s", (drawn.touch_deg, 0), (start - 6.2, -0.085))
    nominal = "nominal closing: the lift\nhas fallen to the lash"
    _name(axes, nominal, (drawn.nominal_deg, drawn.lash_mm), (start + 14, 0.34))
    words = f"bounce {bounce:.2f} mm: the\nlargest s in the window"
    axes.plot([angle[hop]], [valve[hop]], "D", color=LIMIT, markersize=4)
    _name(axes, words, (angle[hop], valve[hop]), (start + 18, 0.19))
    axes.text(start + 0.5, 0.43, "the bounce window begins here and ends\nat the next opening foot", fontsize=BASE - 1)
    axes.set(xlim=(low, high), ylim=(-0.14, 0.52), xlabel="cam angle [deg]", ylabel="mm")
    axes.set_title("Closing")


def main() -> None:
    """Writes the figures."""
    drawn = {"model-metrics": model_metrics(motion()), "model-train": model_train(), "smoothing": smoothing()}
    for name, figure in drawn.items():
        path, content = Path(__file__).with_name(f"{name}.png"), io.BytesIO()
        figure.savefig(content, format="png", dpi=130)
        write_bytes(path, content.getvalue())
        print(path)


if __name__ == "__main__":
    main()
