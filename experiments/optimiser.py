"""What area do the limits of a scene allow, and what does each of them cost?

camopt designs cams for three scenes: `kodama`, `kodama` with the masses of its spring a quarter heavier, and
`pushrod-5mass`, at the nominal speeds and over the band. The band is evaluated by event-exact on a 20 r/min grid that
the search did not use. Further designs on `kodama` are without jump, without the jerk limit, without the nose window,
and for the band from 4850 to 7210 r/min. Every row has the certified bound.
"""

import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from camopt.exact import settled_metrics
from camopt.measure.sweep import at_speeds
from camopt.optimizer.accuracy import ACCURACIES
from camopt.optimizer.bound.certificate import area_ratio_bound, control_is_limited
from camopt.optimizer.search.search import find_cam
from camopt.scene import InputError, load_scene
from camopt.scene.parameters import Tied, matching
from camopt.scene.schema import Scene
from experiments.support.record import RESULTS, printed, run_script, write_result

GRID_RPM = 20.0
WIDER_RPM = (4850.0, 7210.0)
BOUNCE_MM = 0.02
SHOWN = ("bounce_mm", "jump_mm", "seating_velocity_m_per_s", "impact_velocity_m_per_s", "contact_force_max_N")
EFFORT = {
    "small": replace(ACCURACIES["draft"], knot_deg=6.0, feedback_rounds=4),
    "full": ACCURACIES["standard"],
}
GRADIENT = {"small": "exact", "full": "smooth"}


def designed(scene: Scene, **limits) -> Scene:
    """The scene with other limits in its [design]; None for a limit that is left out."""
    return scene.model_copy(update={"design": scene.design.model_copy(update=limits)})


def cases(size: str) -> list[tuple[str, Scene, str]]:
    """(name, scene, speeds) of every row."""
    kodama = designed(load_scene("kodama"), bounce_max_mm=BOUNCE_MM)
    if size == "small":
        return [("kodama, nominal", kodama, "nominal")]
    heavier = Tied("coils", tuple(matching(kodama, "spring_*.mass_kg"))).scaled(kodama, 1.25)
    heavier = heavier.model_copy(update={"name": "kodama-heavy-spring"})
    others = heavier, designed(load_scene("pushrod-5mass"), bounce_max_mm=BOUNCE_MM)
    wider = kodama.model_copy(update={"operation": kodama.operation.model_copy(update={"band_rpm": WIDER_RPM})})
    rows = [(f"{s.name}, {speeds}", s, speeds) for s in (kodama, *others) for speeds in ("nominal", "band")]
    return [
        *rows,
        ("kodama, band, jump_max_mm = 0", designed(kodama, jump_max_mm=0.0), "band"),
        ("kodama, nominal, no jerk limit", designed(kodama, jerk_max_mm_per_deg3=None), "nominal"),
        ("kodama, band, no jerk limit", designed(kodama, jerk_max_mm_per_deg3=None), "band"),
        ("kodama, band, no nose window", designed(kodama, nose_deg=None), "band"),
        ("kodama, 4850 to 7210 r/min", wider, "band"),
    ]


def row(name: str, scene: Scene, speeds: str, size: str) -> dict:
    """One design: areas, worst metrics at speeds not used in the search, sign changes of the acceleration, time."""
    started = time.perf_counter()
    try:
        design = find_cam(scene, speeds, EFFORT[size], GRADIENT[size]).confirmed[-1]
    except InputError as error:
        return {"case": name, "area_ratio": None, "why": str(error)}
    seconds = time.perf_counter() - started
    lift, operation = design.lift, scene.operation
    low, high = operation.band_rpm
    grid = operation.speeds_rpm if speeds == "nominal" else np.arange(low, high + 1, GRID_RPM)
    at = at_speeds(settled_metrics, scene, lift, grid)
    certified = control_is_limited(scene.design)
    bends = np.sign(np.round(lift(np.linspace(-1, 1, 4001) * lift.half_duration, 2), 9))
    return {
        "case": name,
        "area_ratio": design.area_ratio,
        "area_ratio_bound": area_ratio_bound(scene.design).bound if certified else None,
        "speeds_judged": len(grid),
        **{n: max(r[n] for r in at) for n in SHOWN},
        "acceleration_sign_changes": int(np.count_nonzero(np.diff(bends[bends != 0]))),
        "seconds": seconds,
    }


def main(size: str = "full", folder: Path = RESULTS) -> dict:
    """Designs and prints every row, and writes optimiser.json into `folder`."""
    rows = [printed(row(*case, size)) for case in cases(size)]
    return write_result("optimiser", size, {"rows": rows}, {}, folder)


if __name__ == "__main__":
    run_script(main, __doc__)
