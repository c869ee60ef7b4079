"""Figures that compare cams: their lift laws, and the valve's motion and the contact forces at each speed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from camopt.plots.style import (
    BASE,
    DESIGN,
    SHADE,
    cam_lines,
    draw_limit,
    family_of,
    legend_above,
    new_figure,
    styled,
    write,
)
from camopt.scene.design import Design
from camopt.scene.response import Response
from camopt.scene.units import DEG, MM

Table = Mapping[str, np.ndarray]
CURVES = (
    ("lift_mm", "lift [mm]"),
    ("velocity_mm_per_deg", "velocity\n[mm/deg]"),
    ("acceleration_mm_per_deg2", "acceleration\n[mm/deg²]"),
    ("jerk_mm_per_deg3", "jerk\n[mm/deg³]"),
)
JERK_SPAN = 2.5
"""The jerk axis ends at this many times the limit, because the steps of a family without a jerk limit would flatten all
other curves."""
MOVING_MM = 0.002
"""A valve that is closer to its seat than this [mm] counts as at rest; the zoom of the closing ends there."""
ROOM = 1.3
"""Upper end of a force axis, as a multiple of the design's largest force."""
NEAR = 2.0
"""A limit on the force beyond this multiple of the design's largest force is not drawn: it would flatten the curves."""


@styled
def profiles(cams: Sequence[tuple[str, Table]], design: Design | None = None) -> Figure:
    """Draws lift, velocity, acceleration and jerk against cam angle.

    `cams` holds for each cam its name and the columns of `camopt.cam.lift.lift_table`. A `design` adds its limits, thin
    lines at the ends of its duration, and a shaded nose, on which no acceleration may be positive.
    """
    figure = new_figure(7.6, 8.6)
    rows = figure.subplots(4, 1, sharex=True, height_ratios=(1.5, 1, 1.15, 1.15))
    lines = cam_lines(name for name, _ in cams)
    for axes, (column, label) in zip(rows, CURVES, strict=True):
        for name, table in cams:
            axes.plot(table["cam_angle_deg"], table[column], label=name, **lines[name])
        axes.set_ylabel(label)
    legend_above(figure, rows[0])
    rows[0].set_ylim(bottom=0)
    rows[3].set_xlabel("cam angle [deg]")
    if design is not None:
        _draw_design(rows, cams, design)
    return figure


def _draw_design(rows: Sequence[Axes], cams: Sequence[tuple[str, Table]], design: Design) -> None:
    """Draws the design's duration and limits, and ends the axes with its event or the longest cam."""
    for axes in rows:
        _mark_duration(axes, design)
    _limits(rows, design)
    if design.jerk_max_mm_per_deg3 is not None:
        span = JERK_SPAN * design.jerk_max_mm_per_deg3
        if _name_exceeding(
            rows[3], {name: np.abs(table["jerk_mm_per_deg3"]) for name, table in cams}, span, "±mm/deg³"
        ):
            rows[3].set_ylim(-span, span)
    end = design.duration_deg / 2 + max(h / v for h, v, _ in design.ramps()) + design.ramp_foot_deg / 2 + 2
    lifted = [float(np.abs(table["cam_angle_deg"][table["lift_mm"] > 0]).max(initial=0.0)) for _, table in cams]
    end = max(end, *lifted)  # a cam that is longer than the design is shown completely
    rows[3].set_xlim(-end, end)
    rows[3].set_xlabel(f"cam angle [deg];  thin lines: duration {design.duration_deg:g} deg")


def _limits(rows: Sequence[Axes], design: Design) -> None:
    draw_limit(rows[0], design.max_lift_mm, "reach\n{:g} mm" if design.reach_max_lift else "at most\n{:g} mm")
    draw_limit(rows[2], design.acceleration_max_mm_per_deg2, "at most\n{:g}")
    draw_limit(rows[2], design.acceleration_min_mm_per_deg2, "at least\n{:g}")
    jerk = design.jerk_max_mm_per_deg3
    if jerk is not None:
        draw_limit(rows[3], jerk, "at most\n{:g}")
        draw_limit(rows[3], -jerk, "at least\n{:g}")
    for axes in rows[2:]:
        axes.margins(y=0.14)  # space for the text on the nose
    if design.nose_deg is not None:
        rows[2].axvspan(-design.nose_deg, design.nose_deg, ymin=0, ymax=1, color=SHADE, zorder=0)
        how = {"ha": "center", "va": "top", "fontsize": BASE - 1.5, "color": "#555555"}
        write(rows[2], "nose: no positive acceleration", (0, 0.97), (0, 0), over=rows[2].get_xaxis_transform(), **how)


@dataclass(frozen=True)
class DrawnMotion:
    """One revolution of one cam at one speed: k samples from -180 to 180 deg."""

    cam: str
    speed_rpm: float  # crankshaft
    cam_angle_deg: np.ndarray  # (k)
    valve_mm: np.ndarray  # (k) signed distance of the valve from where its seat touches
    contact_force_N: Mapping[str, np.ndarray]  # (k) per contact between cam and valve


def last_revolution(cam: str, speed_rpm: float, response: Response) -> DrawnMotion:
    """The last complete revolution of a response, in the units of the figure."""
    middle = 2 * np.pi * (response.revolutions - 1)
    inside = response.angle >= middle - np.pi - 1e-9  # round-off of the revolution's first angle
    train = response.train
    forces = {train.element_names[e]: response.force[inside, e] for e in train.cam_side}
    return DrawnMotion(
        cam, speed_rpm, (response.angle[inside] - middle) / DEG, response.seat_separation()[inside] / MM, forces
    )


@styled
def valve_motion(motions: Sequence[DrawnMotion], design: Design) -> Figure:
    """Draws the valve lift, a zoom of its closing and each contact force of all cams, with one column per speed."""
    speeds = sorted({m.speed_rpm for m in motions})
    contacts = list(motions[0].contact_force_N)
    figure = new_figure(max(6.4, 1.2 + 2.9 * len(speeds)), 4.3 + 1.7 * len(contacts))
    heights = (1.1, 1.3, *(1.0 for _ in contacts))
    rows = figure.subplots(2 + len(contacts), len(speeds), sharey="row", squeeze=False, height_ratios=heights)
    start, end, top = _closing(motions, design)
    lines = cam_lines(m.cam for m in motions)
    for column, speed in enumerate(speeds):
        here = [m for m in motions if m.speed_rpm == speed]
        lift, zoom, *forces = rows[:, column]
        lift.set_title(f"{speed:g} r/min")
        for m in here:
            line = lines[m.cam]
            lift.plot(m.cam_angle_deg, m.valve_mm, label=m.cam, **line)
            zoom.plot(m.cam_angle_deg, m.valve_mm, **line)
            for axes, contact in zip(forces, contacts, strict=True):
                axes.plot(m.cam_angle_deg, m.contact_force_N[contact], **line)
        lift.axvspan(start, end, color="#eeeeee", zorder=0)
        zoom.set(xlim=(start, end), ylim=(-0.2 * top, top))
        for axes in (lift, *forces):
            _limit_to_event(axes, design)
        for axes in (zoom, *forces):
            axes.axhline(0, color="#777777", linewidth=0.7, zorder=1)
        shown = {m.cam: (start <= m.cam_angle_deg) & (m.cam_angle_deg <= end) & _after_and_touched(m)[1] for m in here}
        _name_exceeding(zoom, {m.cam: m.valve_mm[shown[m.cam]] for m in here}, top, "mm")
        for axes, contact in zip(forces, contacts, strict=True):
            high = _force_top(motions, contact, design)
            axes.set_ylim(-0.04 * high, high)
            _name_exceeding(axes, {m.cam: m.contact_force_N[contact] for m in here}, high, "N")
        force, last = design.contact_force_max_N, column == len(speeds) - 1
        draw_limit(zoom, design.bounce_max_mm, "bounce\nat most\n{:g} mm" if last else "")
        for axes in forces:
            if force is not None and force < axes.get_ylim()[1]:
                draw_limit(axes, force, "at most\n{:g} N" if last else "")
        forces[-1].set_xlabel("cam angle [deg]")
    rows[0, 0].set_ylabel("valve lift [mm]")
    rows[1, 0].set_ylabel("valve above\nseat touch [mm]")
    for axes, contact in zip(rows[2:, 0], contacts, strict=True):
        axes.set_ylabel(f"{contact}\nforce [N]")
    legend_above(figure, rows[0, 0])
    return figure


def _limit_to_event(axes: Axes, design: Design) -> None:
    """Limits the axis to the event with its ramps, and marks the duration."""
    end = design.duration_deg / 2 + max(h / v for h, v, _ in design.ramps()) + design.ramp_foot_deg
    axes.set_xlim(-end, end)
    _mark_duration(axes, design)


def _mark_duration(axes: Axes, design: Design) -> None:
    """Marks the ends of the duration, between which jump is measured, by thin lines."""
    for angle in (-design.duration_deg / 2, design.duration_deg / 2):
        axes.axvline(angle, color="#999999", linewidth=0.7, zorder=1)


def _leading(motions: Sequence[DrawnMotion]) -> Sequence[DrawnMotion]:
    """The motions for which the axes are scaled: those of the design and of cams outside the families, or all where
    there are none. A bouncing cam of a family would flatten the other curves."""
    return [m for m in motions if family_of(m.cam) in (DESIGN, "")] or motions


def _force_top(motions: Sequence[DrawnMotion], contact: str, design: Design) -> float:
    """Upper end [N] of a contact's force axis, which includes the limit where it is within `NEAR`."""
    largest = max(float(np.max(m.contact_force_N[contact])) for m in _leading(motions))
    limit = design.contact_force_max_N or 0.0
    return ROOM * max(largest, limit if limit < NEAR * largest else 0.0, 1.0)


def _after_and_touched(motion: DrawnMotion) -> tuple[np.ndarray, np.ndarray]:
    """Masks (k) of the samples after the revolution's greatest lift, and of those after the valve touches its seat."""
    after = motion.cam_angle_deg > motion.cam_angle_deg[np.argmax(motion.valve_mm)]
    return after, np.cumsum(after & (motion.valve_mm <= 0)) > 0


def _name_exceeding(axes: Axes, values: Mapping[str, np.ndarray], top: float, unit: str) -> bool:
    """Writes above the axis which cams exceed it and their largest values; returns whether any does."""
    beyond = {cam: float(np.max(v, initial=0.0)) for cam, v in values.items()}
    words = [f"{cam} {largest:.3g}" for cam, largest in beyond.items() if largest > top]
    if words:
        lines = "\n".join(", ".join(words[i : i + 2]) for i in range(0, len(words), 2))
        axes.set_title(f"beyond this axis [{unit}]: {lines}", fontsize=BASE - 2, fontweight="normal")
    return bool(words)


def _closing(motions: Sequence[DrawnMotion], design: Design) -> tuple[float, float, float]:
    """First angle [deg], last angle [deg] and height [mm] of the zoom, which begins at the end of the duration or at an
    earlier touch."""
    start = design.duration_deg / 2
    end, top = start + 15.0, 3 * (design.bounce_max_mm or 0.02)
    for m in _leading(motions):
        after, touched = _after_and_touched(m)
        moving = m.cam_angle_deg[after & (m.valve_mm > MOVING_MM)]
        end = max(end, min(180.0, moving[-1] + 4.0)) if len(moving) else end
        start = min(start, m.cam_angle_deg[touched][0] - 3.0) if touched.any() else start
        top = max(top, 1.2 * np.max(m.valve_mm[touched], initial=0.0))
    return start, end, top
