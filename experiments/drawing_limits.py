"""What does each limit of an engineer's drawing cost in area, and does it hold at every angle?

Each limit is set a step beyond the value of the cam of largest area without it, so that this cam breaks the limit.
Every area is reported with its bound. The sources of the trains give no geometry, so a flat follower is assumed for
most limits. Radii under a roller or pad are separate cases: with the finger that the scene `kodama` assumes, and with a
roller.
"""

import numpy as np

from camopt.cam.geometry import contact, crossing
from camopt.cam.lift import Lift
from camopt.cam.linear_limits import piston_drop
from camopt.measure.limits import broken_by_shape
from camopt.optimizer.bound.certificate import area_ratio_bound
from camopt.optimizer.bound.fine_program import left_out
from camopt.optimizer.program.kinematic import kinematic_optimum
from camopt.optimizer.program.program_cam import program_cam
from camopt.scene import Scene, load_scene
from camopt.scene.design import Piston
from camopt.scene.geometry import Geometry
from camopt.scene.units import DEG, MM, MM_PER_DEG4
from experiments.support.record import RESULTS, run_script, write_result

GEOMETRY = {
    "kodama": Geometry(follower="flat", base_radius_mm=22.0, assumed=("follower", "base_radius_mm")),
    "pushrod-5mass": Geometry(
        follower="flat", base_radius_mm=20.0, rocker_ratio=1.5, assumed=("follower", "base_radius_mm", "rocker_ratio")
    ),
}
CIRCLES = {
    "kodama": (load_scene("kodama").geometry, ("nose_radius_min_mm",)),  # its cam is nowhere concave
    "pushrod-5mass": (
        Geometry(
            follower="roller", base_radius_mm=15.0, roller_radius_mm=8.0, rocker_ratio=1.5,
            assumed=("follower", "base_radius_mm", "roller_radius_mm", "rocker_ratio"),
        ),
        ("nose_radius_min_mm", "concave_radius_min_mm"),
    ),
}  # fmt: skip
"""Followers with a circular contact surface, and the limits on radii that are set with them."""
PISTON = Piston(stroke_mm=86.0, rod_mm=143.0, gap_at_top_mm=4.0, clearance_mm=1.0, lobe_centre_deg=108.0)
LIFT_AT_DEG = -54.0
"""Cam angle [deg] of the piston's top dead centre: 108 crank degrees before the lobe's centre."""
DURATION_AT_MM = 5.0
STEP = {
    "lift_at": -0.3,
    "duration_at": -3.0,
    "piston": 0.4,
    "nose_radius_min_mm": 3.0,
    "face_width_mm": -2.0,
    "waves_max": -2,
}
"""Step of each limit beyond the value of the cam without it: mm, deg, mm, mm, mm, sign changes of the jerk."""
CONCAVE_STEP_MM = 20.0
ENTRAINMENT_M_PER_S = 0.2
"""The limit on the least entrainment velocity; without the limit the velocity passes through zero."""
SNAP_SHARE = 0.5
"""The limit on snap, as a share of the largest snap of the cam without it."""
LIMITS = (*STEP, "snap_max_mm_per_deg4", "entrainment_min_m_per_s")
KNOT_DEG = {"small": 4.0, "full": 2.0}
GRID_DEG = 0.001
NO_JERK = 1e-5
"""Share of the largest jerk below which differences on the grid are rounding errors."""


def main(size: str, folder=RESULTS) -> dict:
    """Computes a row for each limit and train, and writes `drawing_limits.json`."""
    names = list(GEOMETRY)[: 1 if size == "small" else None]
    rows = [row for name in names for row in rows_of(name, KNOT_DEG[size])]
    geometry = {n: [one.model_dump() for one in (GEOMETRY[n], CIRCLES[n][0])] for n in names}
    content = {"geometry": geometry, "piston": PISTON.model_dump(), "rows": rows}
    return write_result("drawing_limits", size, content, {}, folder)


def rows_of(name: str, knot_deg: float) -> list[dict]:
    """The limits on one train."""
    flat, circle = (load_scene(name).model_copy(update={"geometry": g}) for g in (GEOMETRY[name], CIRCLES[name][0]))
    free = kinematic_optimum(flat.design, program_cam(flat.design, knot_deg))
    rows = []
    for scene, key in [*((flat, key) for key in LIMITS), *((circle, key) for key in CIRCLES[name][1])]:
        reached = value_of(key, free.lift, scene)
        limit = asked_for(key, reached)
        limited = with_limit(scene, key, limit)
        held = kinematic_optimum(limited.design, program_cam(limited.design, knot_deg))
        rows.append(
            {
                "scene": name,
                "limit": key,
                "follower": scene.geometry.follower,
                "value_without": reached,
                "value_asked": limit,
                "value_with": value_of(key, held.lift, limited),
                "broken_without": broken_by_shape(free.lift, limited.design),
                "broken_with": broken_by_shape(held.lift, limited.design),
                "area_ratio_without": free.area_ratio,
                "area_ratio_with": held.area_ratio,
                "bound": area_ratio_bound(limited.design).bound,
                "bound_leaves_out": left_out(limited.design),
                "price_percent": 100 * (1 - held.area_ratio / free.area_ratio),
            }
        )
    return rows


def asked_for(key: str, reached: float) -> float:
    """Value of a limit where the cam without it has the value `reached`."""
    if key == "snap_max_mm_per_deg4":
        return SNAP_SHARE * reached
    if key == "entrainment_min_m_per_s":
        return ENTRAINMENT_M_PER_S
    return reached + (CONCAVE_STEP_MM if key == "concave_radius_min_mm" else STEP[key])


def with_limit(scene: Scene, key: str, value: float) -> Scene:
    """The scene with one limit of the drawing."""
    if key == "face_width_mm":
        return scene.model_copy(update={"geometry": scene.geometry.model_copy(update={key: value})})
    limit = {
        "lift_at": ((LIFT_AT_DEG, 0.0, value),),
        "duration_at": ((DURATION_AT_MM, 0.0, value),),
        "piston": PISTON.model_copy(update={"clearance_mm": value}),
    }.get(key, value)
    return scene.model_copy(update={"design": scene.design.model_copy(update={key: limit})})


def value_of(key: str, lift: Lift, scene: Scene) -> float:
    """Value of a limited quantity of a cam, on a grid of 0.001 deg, in the limit's unit."""
    half = scene.design.duration_deg / 2
    theta = np.arange(-half, half + GRID_DEG / 2, GRID_DEG) * DEG
    if key == "lift_at":
        return float(lift(LIFT_AT_DEG * DEG)) / MM
    if key == "duration_at":
        return float(np.ptp(crossing(lift, DURATION_AT_MM * MM))) / DEG
    if key == "piston":
        drop = piston_drop(PISTON, PISTON.lobe_centre_deg * DEG + theta / scene.operation.cam_per_crank)
        return float((PISTON.gap_at_top_mm * MM + drop - lift(theta)).min()) / MM
    if key == "snap_max_mm_per_deg4":
        return float(np.abs(lift(theta[1:-1], 4)).max()) / MM_PER_DEG4
    if key == "waves_max":
        jerk = np.diff(lift(theta, 2))
        return int(np.count_nonzero(np.diff(np.sign(jerk[np.abs(jerk) > NO_JERK * np.abs(jerk).max()]))))
    if key == "entrainment_min_m_per_s":
        y, bend = (lift(theta, k) / scene.geometry.rocker_ratio for k in (0, 2))
        return scene.design.slowest * float(((scene.geometry.base_radius_mm * MM + y) / 2 + bend).min())
    touching = contact(lift, scene.geometry, theta)
    if key == "face_width_mm":
        return touching.face_width / MM
    if key == "concave_radius_min_mm":
        return np.inf if touching.smallest_concave is None else touching.smallest_concave / MM
    flat = scene.geometry.follower == "flat"
    return float(touching.radius_of_curvature.min() if flat else touching.smallest_convex) / MM


if __name__ == "__main__":
    run_script(main, __doc__)
