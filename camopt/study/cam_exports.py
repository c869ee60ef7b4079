"""The files that `camopt cam` writes: lift table, contour, drawing, figure."""

from argparse import Namespace
from pathlib import Path

import numpy as np

from camopt.cam import exports
from camopt.cam.lift import Lift
from camopt.cam.tables.lift_table import write_lift_table
from camopt.measure.rounded import moving_average
from camopt.scene import Scene, build_train
from camopt.scene.geometry import BELONGS
from camopt.scene.units import DEG, MM, UM
from camopt.storage import write_bytes
from camopt.study.cam_force import last_revolution

CONTOUR_KEYS = ("base_radius_mm", "rocker_ratio", *BELONGS, "valve_arm_deg")
"""Keys of [geometry] on which the contour depends."""
DEFAULT_DIGITS = 6
"""Default number of decimals of the lift in tables without derivative columns."""


def export(scene: Scene, lift: Lift, files: Namespace) -> list[str]:
    """Writes the files that the arguments of `camopt cam` name; returns sentences that state their errors.

    Contour, drawing and figure of a rounded table are those of its moving average (`camopt.measure.rounded`). Raises
    InputError where no contour gives this lift to the scene's follower, and for steps that do not divide a turn.
    """
    lines = _table(scene, lift, files) if files.csv else []
    geometry, law = scene.geometry, moving_average(lift)[0]
    digits = DEFAULT_DIGITS if files.digits is None else files.digits
    if files.contour:
        geometry = scene.required_geometry
        exports.write_contour(files.contour, law, geometry, files.step_deg, digits)
        lines.append(
            f"contour: for a {geometry.follower} follower on a base circle of radius {geometry.base_radius_mm:g} mm; "
            "with x to the right and y up the cam turns clockwise, its opening flank below: for the other sense of "
            "rotation change the sign of y"
        )
    if files.dxf:
        arcs, miss = exports.write_dxf(files.dxf, law, scene.required_geometry, files.dxf_tolerance_um * UM)
        lines.append(f"drawing: {arcs} arcs that join without a corner, within {miss / UM:.2g} um of the contour")
    assumed = [key for key in geometry.assumed if key in CONTOUR_KEYS] if geometry else []
    if assumed and (files.contour or files.dxf):
        lines.append(f"note: the outline depends on assumed numbers: measure {', '.join(assumed)} before it is ground")
    if files.figure:
        from camopt.plots.style import picture

        write_bytes(files.figure, picture(law.plot(scene.design), Path(files.figure).suffix[1:].lower()))
    if files.valve_lift or files.dynamic_lift:
        lines += _valve_lifts(scene, lift, files, digits)
    return lines


def _valve_lifts(scene: Scene, lift: Lift, files: Namespace, digits: int) -> list[str]:
    """Writes the valve's static lift, and its lift at a speed, by crank degree; returns where the rows begin."""
    per_crank, lash = scene.required_operation.cam_per_crank, build_train(scene).lash
    crank = exports.crank_rows(lift, lash, per_crank)
    lines = []
    if files.valve_lift:
        static = np.maximum(lift(crank * per_crank * DEG) - lash, 0.0)
        exports.write_valve_lift(files.valve_lift, static, digits)
        lines.append(
            f"valve lift: {_crank_degrees(crank)}; it is the cam's lift less the lash of {lash / MM:g} mm, in mm"
        )
    if files.dynamic_lift:
        motion, method = last_revolution(scene, lift, files.speed)
        turn = np.arange(crank[0], 180.0 / per_crank + 1)  # a bouncing valve settles later than the cam closes
        valve = np.interp(turn * per_crank * DEG, motion.angle, np.maximum(motion.seat_separation(), 0.0))
        rows = int(np.flatnonzero(valve)[-1]) + 2
        exports.write_valve_lift(files.dynamic_lift, valve[:rows], digits)
        lines.append(
            f"valve lift at {files.speed:g} r/min: {_crank_degrees(turn[:rows])}; it is the valve's distance from its "
            f"seat in a settled revolution, by {method}, in mm"
        )
    return lines


def _crank_degrees(crank: np.ndarray) -> str:
    return f"degrees 0 to {len(crank) - 1} are crank degrees {crank[0]:g} to {crank[-1]:g} from the duration's middle"


def _table(scene: Scene, lift: Lift, files: Namespace) -> list[str]:
    """Writes the lift table; returns its error where it is rounded or in steps of the crank angle."""
    assert files.csv and scene.operation, "the verb asks for both"
    digits, step, unit = files.digits, files.step_deg, "cam"
    if files.step_crank_deg is not None:
        digits, unit = DEFAULT_DIGITS if digits is None else digits, "crank"
        step = files.step_crank_deg * scene.operation.cam_per_crank
        exports.write_crank_table(files.csv, lift, files.step_crank_deg, digits, scene.operation.cam_per_crank)
    elif digits is None:
        write_lift_table(files.csv, lift, step)
        return []
    else:
        ratio = scene.geometry.rocker_ratio if scene.geometry else 1.0
        exports.write_rounded_table(files.csv, lift, step, digits, ratio)
    error = exports.table_error(lift, step, digits)
    rows = f"a row every {files.step_crank_deg or step:g} {unit} deg, {digits} decimals"
    return [
        f"lift table: {rows}: off by at most {error.rows:.1e} mm at its rows; between them by {error.spline:.1e} mm "
        f"along a cubic spline, by {error.lines:.1e} mm along straight lines"
    ]
