"""The report's account of the valve train: masses, elements, what is assumed, and the Hertz stress on the cam."""

from collections.abc import Sequence
from typing import Any

from camopt.cam.hertz import HertzStress
from camopt.plots.style import DESIGN
from camopt.report.assumed import MOVED, AssumedNumber, assumed_rows
from camopt.report.motion import RunCams
from camopt.report.wording import shown
from camopt.scene import InputError, Scene, build_train
from camopt.scene.element import Element
from camopt.scene.errors import MotionRefused
from camopt.scene.geometry import Geometry
from camopt.study.cam_sheet import dynamic_stress, static_stress

DIGITS = 4


def train_tables(cams: RunCams, assumed: Sequence[AssumedNumber] = ()) -> dict[str, Any] | None:
    """Rows of `masses` and `elements` with what is assumed in each, the assumed numbers `ranked`, and `stress`; None
    without a scene."""
    scene = cams.scene
    if scene is None:
        return None
    masses = [
        [m.name, shown(1000 * m.mass_kg, DIGITS), shown(m.damping_N_s_per_m, DIGITS), shown(m.force_N, DIGITS),
         _assumed(m.assumed), m.source or "–"]
        for m in scene.mass
    ]  # fmt: skip
    elements = [
        [e.name, _kind(e), " – ".join(e.between), shown(_per_mm(e.stiffness_N_per_m), DIGITS),
         shown(e.damping_N_s_per_m, DIGITS), shown(e.preload_N, DIGITS), shown(e.gap_mm, DIGITS),
         _assumed(e.assumed), e.source or "–"]
        for e in scene.element
    ]  # fmt: skip
    rows = (*scene.mass, *scene.element)
    tables = {
        "masses": masses,
        "elements": elements,
        "total_g": shown(1000 * sum(m.mass_kg for m in scene.mass), DIGITS),
        "assumed": sum(len(row.assumed) for row in rows),
        "ranked": assumed_rows(assumed),
        "moved": f"{100 * MOVED:.0f} %",
        "reference": scene.reference,
        "sourced": any(row.source for row in rows),
    }
    return tables | {"stress": _stress(cams, scene)}


def _kind(element: Element) -> str:
    law = "" if element.law == "linear" else f", {element.law}"
    return element.kind + law + (", cam driven" if element.cam_driven else "")


def _per_mm(stiffness_N_per_m: float | None) -> float | None:
    return None if stiffness_N_per_m is None else stiffness_N_per_m / 1000


def _assumed(keys: tuple[str, ...]) -> str:
    return ", ".join(keys) if keys else "–"


def _stress_cells(stress: HertzStress, geometry: Geometry) -> list[str]:
    """Stress, angle and force, and the share of what the materials bear, where the scene says so."""
    limit, figures = geometry.hertz_max_MPa, stress.figures()
    share = "–" if limit is None else f"{100 * figures['hertz_stress_MPa'] / limit:.0f} % of {limit:g} MPa"
    return [*(shown(value, DIGITS) for value in figures.values()), share]


def _stress(cams: RunCams, scene: Scene) -> dict[str, Any]:
    """The largest Hertz stress of the design at each listed speed and standing still, or the sentence on why none."""
    lift = cams.lifts.get(DESIGN)
    if lift is None:
        return {"rows": [], "says": "The design cannot be read, so there is no stress on it."}
    if scene.geometry is None:
        return {"rows": [], "says": "The scene gives no [geometry], so the stress on the cam is not known."}
    train, rows = build_train(scene), []
    try:
        for speed in scene.operation.speeds_rpm if scene.operation else ():
            try:
                stress, _ = dynamic_stress(scene, train, lift, speed)
            except MotionRefused as refused:
                rows.append([f"{shown(speed)} r/min", "–", "–", f"refused: {refused}", "–"])
                continue
            rows.append([f"{shown(speed)} r/min", *_stress_cells(stress, scene.geometry)])
        rows.append(["standing still", *_stress_cells(static_stress(scene, train, lift), scene.geometry)])
    except InputError as error:
        return {"rows": [], "says": f"There is no Hertz stress: {error}."}
    return {"rows": rows, "says": ""}
