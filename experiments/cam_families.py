"""What do the cam families of the literature reach under the same limits?

All families on the conditions of the paper's Table 4 (no jerk limit, no limit on the nose; the ramp is 0.265 mm for
all), and under all limits of `kodama`: area ratio, peaks, and the steps of velocity, acceleration and jerk where the
ramp and where sections meet. Under Table 4 also the order of continuity of every junction and the bounce on `kodama`
at its listed speeds, by event-exact and Runge-Kutta-Gill; the table of README.md is printed. Polydyne and the exponent
polynomial have no searched parameters: they are the members with exponents 2-10-18-26-34, and may break a limit. Plain
`new-design` starts at a12* = 0.95 a12 where there is no jerk limit and at 0 where there is one. `full` also searches
the sectioned families for five times as many generations without any start: how far the plain members are below that,
with their few generations and known starts.
"""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from camopt.cam.families import kurz, multi_pol, new_design, trapezoid
from camopt.cam.families.largest_area import GENERATIONS, best_angles, best_levels
from camopt.cam.families.registry import FAMILIES
from camopt.cam.families.sections import flank
from camopt.cam.lift import Lift, lift_table
from camopt.cam.ramps import scene_ramps
from camopt.cam.read import read_cam
from camopt.measure.limits import broken_by_shape
from camopt.plots.cams import profiles
from camopt.plots.style import save
from camopt.scene import Scene, load_scene
from camopt.scene.design import Design
from camopt.scene.units import DEG, MM
from camopt.storage import write_json
from camopt.verifier.convergence import Tolerances
from camopt.verifier.verdict import verdict_on
from experiments.support.cam_families_table import bounces, markdown, orders_of_continuity
from experiments.support.record import RESULTS, provenance, run_script

CAMS = (*FAMILIES, "new-design:start_ratio=0", "new-design:quintic=yes")
SMALL = ("polydyne", "exponent", "trapezoid")
SPEEDS = {"small": (5000.0,), "full": None}
HALVINGS = {"small": 2, "full": 4}
TOLERANCE_UM = 5.0
JERK_SHOWN = 0.0055
LONG = 5 * GENERATIONS
SEARCHED = {
    "multi-pol": multi_pol.TABLE_1,
    "new-design:start_ratio=0.95": new_design.table_2(False, 0.95),
    "new-design:start_ratio=0": new_design.table_2(False, 0.0),
    "new-design:start_ratio=0.95,quintic=yes": new_design.table_2(True, 0.95),
    "new-design:start_ratio=0,quintic=yes": new_design.table_2(True, 0.0),
    "kurz": kurz.TABLE,
    "trapezoid": trapezoid.TABLE,
}


def main(size: str = "full", folder: Path = RESULTS) -> dict:
    """Designs every family, writes cam_families.json and the figure of those without a jerk limit into `folder`."""
    kodama = load_scene("kodama")
    freed = kodama.required_design.model_copy(update={"jerk_max_mm_per_deg3": None, "nose_deg": None})
    table_4 = kodama.model_copy(update={"design": freed})
    scenes = {"Table 4": table_4, "kodama": kodama}
    names = CAMS if size == "full" else SMALL
    cams = {where: {name: read_cam(name, scene) for name in names} for where, scene in scenes.items()}
    result = {
        "question": "what the cam families of the literature reach under the same limits",
        "cams": [
            {"cam": name, "limits": where, **figures(lift, scenes[where]), **motion(lift, scenes[where], where, size)}
            for where, found in cams.items()
            for name, lift in found.items()
        ],
        "long_search": long_search(scenes) if size == "full" else None,
        "provenance": provenance(__file__, size),
    }
    ending = "" if size == "full" else "-small"
    write_json(folder / f"cam_families{ending}.json", result)
    print("\n".join(markdown(result["cams"])))
    drawn = {name: lift for name, lift in cams["Table 4"].items() if name in FAMILIES}
    save(opening_flanks(drawn, freed), folder, f"cam_families{ending}")
    return result


def opening_flanks(cams: dict[str, Lift], design: Design) -> Figure:
    """The opening flanks over each other; few jerk axes show a step of 0.015 and a curve of 0.002 mm/deg3 at once."""
    figure = profiles([(name, lift_table(lift, 0.05)) for name, lift in cams.items()], design)
    _, velocity, _, jerk = figure.axes
    velocity.set_ylim(bottom=-0.02)
    jerk.set_ylim(-JERK_SHOWN, JERK_SHOWN)
    largest = {name: np.abs(lift.extremes(3)).max() / MM * DEG**3 for name, lift in cams.items()}
    beyond = [f"{name} to ±{value:.2g}" for name, value in largest.items() if value > JERK_SHOWN]
    jerk.set_title("beyond this axis: " + ", ".join(beyond), fontweight="normal", fontsize="small")
    jerk.set_xlim(-80, 2)
    jerk.set_xlabel("cam angle [deg], from the end of the ramp at −72 deg to the nose; all cams are symmetric")
    return figure


def motion(lift: Lift, scene: Scene, where: str, size: str) -> dict:
    """Bounce at the listed speeds by two methods, where it is asked for: under the conditions of Table 4."""
    if where != "Table 4":
        return {}
    return {
        "bounce": bounces(
            verdict_on(scene, lift, SPEEDS[size], ("event", "rkg"), None, Tolerances(TOLERANCE_UM, HALVINGS[size]))
        )
    }


def figures(lift: Lift, scene: Scene) -> dict:
    """Area ratio, peaks inside the duration, steps at the ramp top and between sections, limits that are broken."""
    half = lift.half_duration
    units = {"velocity_mm_per_deg": 1, "acceleration_mm_per_deg2": 2, "jerk_mm_per_deg3": 3}
    low, high = (value / MM * DEG**2 for value in lift.extremes(2, -half, half))
    inside = lift.borders[(lift.borders > -half + 1e-9) & (lift.borders < half - 1e-9)]
    steps = {
        f"{place}_step_{name}": largest_step(lift, borders, k) / MM * DEG**k
        for place, borders in (("ramp", np.array([-half, half])), ("section", inside))
        for name, k in units.items()
    }
    return {
        "area_ratio": lift.area_ratio(scene.required_design.max_lift_mm * MM),
        "acceleration_max_mm_per_deg2": high,
        "acceleration_min_mm_per_deg2": low,
        "jerk_max_mm_per_deg3": float(np.abs(lift.extremes(3, -half, half)).max()) / MM * DEG**3,
        **steps,
        "continuity": orders_of_continuity(lift),
        "broken": broken_by_shape(lift, scene.design),
        "parameters": lift.parameters,
    }


def largest_step(lift: Lift, borders: np.ndarray, order: int) -> float:
    """Largest step of a derivative at piece borders [rad], from the pieces on both sides."""
    found = [0.0]
    for right in np.searchsorted(lift.borders, borders - 1e-9):
        before, after = (np.polynomial.Polynomial(c).deriv(order) for c in lift.coefficients[[right - 1, right]])
        found.append(abs(float(after(0.0) - before(lift.borders[right] - lift.borders[right - 1]))))
    return max(found)


def long_search(scenes: dict[str, Scene]) -> list[dict]:
    """Angles and area ratio of the sectioned families from a search without starts."""
    rows = []
    for where, scene in scenes.items():
        design = scene.required_design
        ramp, _ = scene_ramps(design)
        for name, table in SEARCHED.items():
            angles = best_angles(table, design, ramp, True, (), LONG)
            one = flank(table, angles)
            x, stretch = best_levels(table, one, design, ramp, True, {})
            ratio = one.lift(x, ramp, name, {}).area_ratio(design.max_lift_mm * MM)
            shares = (angles / angles.sum()).tolist()
            row = {"cam": name, "limits": where, "generations": LONG, "area_ratio": ratio, "stretch": stretch}
            rows.append({**row, "sections_deg": (angles / DEG).tolist(), "shares_of_half_duration": shares})
    return rows


if __name__ == "__main__":
    run_script(main, __doc__)
