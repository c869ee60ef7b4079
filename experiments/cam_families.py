"""What area do the cam families of the literature reach under the paper's Table 4, and under all limits of `kodama`?

All families are designed for the conditions of the paper's Table 4 (no jerk limit, no limit on the nose; a ramp of
0.265 mm for all), and under all limits of `kodama`. The result has their area ratio, peak values, and the order of
continuity at every junction, and for Table 4 also the bounce on `kodama` at its listed speeds by event-exact and
Runge-Kutta-Gill. Polydyne and the exponent polynomial have no searched parameters: they are the members with exponents
2-10-18-26-34, and may break a limit. Plain `new-design` starts at a12* = 0.95 a12 where there is no jerk limit and at 0
where there is one.
"""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from camopt.cam.families.registry import FAMILIES
from camopt.cam.lift import Lift, lift_table
from camopt.cam.read import read_cam
from camopt.measure.limits import broken_by_shape
from camopt.plots.cams import profiles
from camopt.plots.style import save
from camopt.scene import Scene, load_scene
from camopt.scene.design import Design
from camopt.scene.units import DEG, MM
from camopt.verifier.convergence import Tolerances
from camopt.verifier.verdict import verdict_on
from experiments.support.record import RESULTS, run_script, write_result

CONTINUOUS = 1e-6
"""Largest step at a junction, relative to the derivative's largest value in the event, that counts as round-off."""
HIGHEST = 4
"""Highest derivative that is checked."""
SAME_MM = 0.005
"""Width of a range of bounce above which the range is printed in place of one value."""
HEADS = (
    "cam", "area ratio", "acceleration [mm/deg²]", "jerk [mm/deg³]", "continuity: ramp; sections; nose",
)  # fmt: skip


def orders_of_continuity(lift: Lift) -> dict[str, list[int]]:
    """Order of the highest continuous derivative where the opening ramp ends, where sections meet, and at the nose.

    A derivative counts as continuous where all lower ones are and its step is at most CONTINUOUS of its largest value
    in the event; derivatives above HIGHEST are not checked. Cams without sections have junctions at the ramp and the
    nose only.
    """
    half = lift.half_duration
    first, last = np.searchsorted(lift.borders, [-half - 1e-9, half - 1e-9])
    at = np.stack([lift.borders[:-1], lift.borders[1:]])  # the start and the end of every piece
    ends = [lift.of_piece(np.arange(len(lift.coefficients)), at, k) for k in range(HIGHEST + 1)]
    scale = [np.abs(values[:, first:last]).max() for values in ends]

    def order(angle: float) -> int:
        i = int(np.argmin(np.abs(lift.borders - angle)))
        for k, (values, largest) in enumerate(zip(ends, scale, strict=True)):
            if abs(values[0, i] - values[1, i - 1]) > CONTINUOUS * largest:
                return k - 1
        return HIGHEST

    inside = -half + np.cumsum(lift.parameters.get("sections_deg", ())[:-1]) * DEG
    return {"ramp": [order(-half)], "sections": [order(a) for a in inside], "nose": [order(0.0)]}


def markdown(cams: list[dict]) -> list[str]:
    """Lines of the table: one row per cam under the conditions of Table 4."""
    rows = [cam for cam in cams if cam["limits"] == "Table 4"]
    speeds = [f"bounce {b['speed_rpm']:g}" for b in rows[0]["bounce"]]
    lines = ["| " + " | ".join([*HEADS, *speeds]) + " |", "|---" * (len(HEADS) + len(speeds)) + "|"]
    for cam in rows:
        low, high = cam["acceleration_min_mm_per_deg2"], cam["acceleration_max_mm_per_deg2"]
        orders = "; ".join(" ".join(map(str, highest)) or "–" for highest in cam["continuity"].values())
        shape = [f"{cam['area_ratio']:.4f}", f"{high:.4f} / −{-low:.4f}", f"{cam['jerk_max_mm_per_deg3']:.4f}", orders]
        lines.append("| " + " | ".join([f"`{cam['cam']}`", *shape, *(_bounce(b) for b in cam["bounce"])]) + " |")
    return lines


def _bounce(row: dict) -> str:
    """A bounce [mm], or its range over neighbouring motions where wide; an asterisk marks disagreeing methods."""
    if row["bounce_mm"] is None:
        return "never seats"
    mark = "" if row["methods_agree"] else "*"
    low, high = row["bounce_range_mm"]
    if high - low > SAME_MM:
        return f"{low:.2f} to {high:.2f}{mark}"
    return f"{row['bounce_mm']:.3f}{mark}"


CAMS = (*FAMILIES, "new-design:start_ratio=0", "new-design:quintic=yes")
SMALL = ("polydyne", "exponent", "trapezoid")
SPEEDS = {"small": (5000.0,), "full": None}
HALVINGS = {"small": 2, "full": 4}
TOLERANCE_UM = 5.0
BOUNCES = ("bounce_mm", "bounce_error_mm", "bounce_range_mm")
JERK_SHOWN = 0.0055


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
            for where, lifts in cams.items()
            for name, lift in lifts.items()
        ],
    }
    print("\n".join(markdown(result["cams"])))
    drawn = {name: lift for name, lift in cams["Table 4"].items() if name in FAMILIES}
    save(opening_flanks(drawn, freed), folder, "cam_families")
    return write_result("cam_families", size, result, {}, folder)


def opening_flanks(cams: dict[str, Lift], design: Design) -> Figure:
    """The opening flanks of all cams; the jerk axis is cut: steps of 0.015 would hide curves of 0.002 mm/deg3."""
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
    """Bounce at the listed speeds by two methods, with error, range and agreement, for Table 4 only."""
    if where != "Table 4":
        return {}
    tolerances, keys = Tolerances(TOLERANCE_UM, HALVINGS[size]), ("speed_rpm", *BOUNCES)
    verdict = verdict_on(scene, lift, SPEEDS[size], ("event", "rkg"), None, tolerances)
    speeds = [speed.as_dict() for speed in verdict.speeds]
    rows = [{key: s[key] for key in keys} | {"methods_agree": s["verdict"] != "not converged"} for s in speeds]
    return {"bounce": rows}


def figures(lift: Lift, scene: Scene) -> dict:
    """Area ratio, peaks inside the duration, continuity of the junctions, and broken limits."""
    half = lift.half_duration
    low, high = (value / MM * DEG**2 for value in lift.extremes(2, -half, half))
    return {
        "area_ratio": lift.area_ratio(scene.required_design.max_lift_mm * MM),
        "acceleration_max_mm_per_deg2": high,
        "acceleration_min_mm_per_deg2": low,
        "jerk_max_mm_per_deg3": float(np.abs(lift.extremes(3, -half, half)).max()) / MM * DEG**3,
        "continuity": orders_of_continuity(lift),
        "broken": broken_by_shape(lift, scene.design),
        "parameters": lift.parameters,
    }


if __name__ == "__main__":
    run_script(main, __doc__)
