"""How good is the best Polydyne within the scene's limits?

Exponents and design speed are searched by SciPy's differential evolution, and each member is evaluated by event-exact.
There are two answers for `kodama`: the largest area that keeps the bounce limit at the listed speeds, and, because it
is possible that no member does, the least bounce that any member reaches. Members must keep the acceleration limits;
the jerk is reported but not limited, as in the paper's Table 4.
"""

from pathlib import Path

import numpy as np
from scipy.optimize import differential_evolution

from camopt.cam.families.polydyne import polydyne
from camopt.exact import settled_metrics
from camopt.measure.limits import broken_by_shape
from camopt.measure.sweep import at_speeds
from camopt.scene import InputError, load_scene
from camopt.scene.units import DEG, MM
from experiments.support.record import RESULTS, run_script, write_result

SIZES = {"small": (1, 2), "full": (16, 12)}  # generations, population per parameter
BOUNDS = [(2, 8), (6, 40), (10, 60), (14, 80), (5000.0, 7500.0)]
BARRED = 10.0  # cost of a member that breaks the acceleration limits or the lift cap


def main(size: str = "full", folder: Path = RESULTS) -> dict:
    """Searches for both answers and writes best_polydyne.json into `folder`."""
    scene = load_scene("kodama")
    limit = scene.design.bounce_max_mm
    seen: dict[tuple, dict] = {}

    def member(parameters) -> dict | None:
        *steps, speed = parameters
        even = [2 * round(p / 2) for p in steps]
        exponents = (2, *np.maximum.accumulate([max(even[0], 4), *even[1:]]) + 2 * np.arange(4))
        key = tuple(int(e) for e in exponents), round(float(speed), -1)
        if key not in seen:
            seen[key] = figures(scene, *key)
        return seen[key]

    generations, population = SIZES[size]
    for score in (lambda m: m["bounce_mm"], lambda m: 1 - m["area_ratio"] + 20 * max(0.0, m["bounce_mm"] - limit)):

        def cost(parameters, score=score) -> float:
            judged = member(parameters)
            return BARRED if judged["barred"] else score(judged)

        differential_evolution(cost, BOUNDS, maxiter=generations, popsize=population, rng=0, polish=False)
    usable = [m for m in seen.values() if not m["barred"]]
    holding = [m for m in usable if m["bounce_mm"] <= limit]
    result = {
        "question": "best Polydyne within the scene's acceleration limits, kodama, listed speeds",
        "members_judged": len(usable),
        "bounce_limit_mm": limit,
        "largest_area_within_limit": max(holding, key=lambda m: m["area_ratio"]) if holding else None,
        "least_bounce": min(usable, key=lambda m: (m["bounce_mm"], -m["area_ratio"])),
    }
    return write_result("best_polydyne", size, result, {}, folder)


def figures(scene, exponents: tuple[int, ...], design_speed_rpm: float) -> dict:
    """Area, peaks and worst motion of one member; `barred` where it breaks a limit on acceleration or lift."""
    named = {"exponents": list(exponents), "design_speed_rpm": design_speed_rpm, "barred": True}
    try:
        lift = polydyne(scene, exponents, design_speed_rpm)
    except (InputError, np.linalg.LinAlgError):
        return named
    if set(broken_by_shape(lift, scene.design)) - {"jerk_max_mm_per_deg3"}:
        return named
    rows = at_speeds(settled_metrics, scene, lift, scene.operation.speeds_rpm)
    worst = {k: max(row[k] for row in rows) for k in ("bounce_mm", "jump_mm", "seating_velocity_m_per_s")}
    jerk = float(np.abs(lift.extremes(3)).max()) / MM * DEG**3
    area = lift.area_ratio(scene.design.max_lift_mm * MM)
    return {**named, "barred": False, "area_ratio": area, "jerk_max_mm_per_deg3": jerk, **worst}


if __name__ == "__main__":
    run_script(main, __doc__)
