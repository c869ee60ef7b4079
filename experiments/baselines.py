"""How large is the largest cam of each family on `kodama` within 0.05 mm of bounce, with the scene's jerk limit and
without?

Every family of the registry is searched over its own free parameters (section angles and levels, exponents and design
speed) for the largest area whose bounce stays within 0.05 mm at the four listed speeds, under all limits on the shape
and without the jerk limit. Members are evaluated at the listed speeds and 0.1 % above and below them, as camopt does
with its own nominal designs, and more than five times as many as camopt's own search evaluates. `new-design` is
searched in two readings: literally (a12* from 0.5 to 0.95 a12, only possible without a jerk limit), and repaired (a12*
= 0). Where no member keeps the limit, the least bounce is reported. The best members are verified by event-exact and
Runge-Kutta-Gill together, over neighbouring lifts and states too. Jump and seating velocity are reported, not limited.
"""

from pathlib import Path

from camopt.cam.families.registry import FAMILIES
from camopt.optimizer.accuracy import ACCURACIES, design_speeds
from camopt.optimizer.baselines.largest_member import POPULATION, Baseline, largest_area_member
from camopt.scene import Scene, load_scene
from camopt.scene.units import DEG, MM
from camopt.verifier.convergence import Tolerances
from camopt.verifier.verdict import verdict_on
from experiments.support.record import RESULTS, printed, run_script, write_result

EVALUATIONS = {"small": 2 * POPULATION, "full": 48 * POPULATION}
BOUNCE_MAX_MM = 0.05
HALVINGS = {"small": 0, "full": 2}


def main(size: str = "full", folder: Path = RESULTS) -> dict:
    """Searches every family twice, prints and writes baselines.json into `folder`."""
    scene = load_scene("kodama")
    names = (*FAMILIES, "new-design:start_ratio=0") if size == "full" else ("trapezoid",)
    _, speeds = design_speeds(scene.required_operation, "nominal", ACCURACIES["standard"])
    rows = []
    for jerk in (True, False) if size == "full" else (False,):
        for name in names:
            if jerk and name == "new-design:start_ratio=0":
                continue  # plain new-design is the same under a jerk limit
            limits = {"jerk": jerk, "bounce_max_mm": BOUNCE_MAX_MM, "speeds_rpm": speeds}
            member = largest_area_member(scene, name, **limits, evaluations=EVALUATIONS[size], progress=True)
            rows.append(
                printed({"limits": "all" if jerk else "no-jerk", **row(member), **confirmed(scene, member, size)})
            )
    result = {
        "question": "largest area of every cam family within 0.05 mm of bounce at the listed speeds of kodama",
        "bounce_limit_mm": BOUNCE_MAX_MM,
        "baselines": rows,
    }
    return write_result("baselines", size, result, {}, folder)


def row(member: Baseline) -> dict:
    """The row of the best member of a family."""
    jerk = max(abs(j) for j in member.lift.extremes(3)) / MM * DEG**3
    return {
        "family": member.family,
        "holds": member.holds,
        "says": member.says,
        "area_ratio": member.area_ratio,
        "jerk_max_mm_per_deg3": jerk,
        **member.figures,
        "evaluations": member.evaluations,
        "motions_judged": member.judged,
        "seconds": round(member.seconds, 1),
        "parameters": member.lift.parameters,
    }


def confirmed(scene: Scene, member: Baseline, size: str) -> dict:
    """Largest bounce over neighbouring motions by both methods, of a member that keeps the limit."""
    if not member.holds or not HALVINGS[size]:
        return {"bounce_verified_mm": None, "methods_agree": None}
    speeds = verdict_on(scene, member.lift, None, ("event", "rkg"), None, Tolerances(5.0, HALVINGS[size])).speeds
    return {
        "bounce_verified_mm": max(s.ranges["bounce_mm"][1] for s in speeds),
        "methods_agree": all(s.verdict != "not converged" for s in speeds),
    }


if __name__ == "__main__":
    run_script(main, __doc__)
