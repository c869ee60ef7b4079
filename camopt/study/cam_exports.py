"""The files that `camopt cam` writes: lift table, contour, drawing, figure."""

from dataclasses import dataclass
from pathlib import Path

from camopt.cam.dxf import write_dxf
from camopt.cam.exports import write_contour, write_rounded_table
from camopt.cam.lift import Lift
from camopt.cam.tables.lift_table import write_lift_table
from camopt.scene import Scene
from camopt.storage import write_bytes

CONTOUR_DIGITS = 6


@dataclass(frozen=True)
class Files:
    """Where each is written, None where it is not asked for: the lift `table` (every digit where `digits` is None), the
    `contour` as a table, its `dxf`, and the `figure`, PNG or SVG by its suffix: lift, velocity, acceleration and jerk
    with the scene's limits."""

    table: str | None = None
    contour: str | None = None
    dxf: str | None = None
    figure: str | None = None


def export(scene: Scene, lift: Lift, files: Files, step_deg: float = 0.1, digits: int | None = None) -> list[str]:
    """Writes the files that are asked for, and says in a sentence each what was rounded by how much.

    Raises InputError where no contour gives this lift to the scene's follower.
    """
    geometry = scene.geometry
    said = []
    if files.table and digits is None:
        write_lift_table(files.table, lift, step_deg)
    elif files.table and digits is not None:
        write_rounded_table(files.table, lift, step_deg, digits, geometry.rocker_ratio if geometry else 1.0)
    if files.contour or files.dxf:
        assert geometry is not None, "the verb asks for it"
        if files.contour:
            write_contour(files.contour, lift, geometry, step_deg, CONTOUR_DIGITS if digits is None else digits)
        if files.dxf:
            write_dxf(files.dxf, lift, geometry, step_deg)
    if files.figure:
        from camopt.plots.style import picture

        write_bytes(files.figure, picture(lift.plot(scene.design), Path(files.figure).suffix[1:].lower()))
    return said
