"""How does the computing time of a Jacobian of the paths grow with the numbers of masses, speeds, trains and
coefficients?

`camopt.linearised` of the calmest free cam of `kodama`, by both sources: forces and gaps of the settled motion with
tied contacts, and their derivatives by every coefficient. One number is varied, and the others are fixed: ten masses,
the top speed alone, the train as designed, and the coefficients of knots every 6 degrees. The spring is divided more
finely for more masses and reduced as `camopt reduce` does for fewer. Times are processor times of the second call; the
first one compiles.
"""

from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np

import camopt
from camopt.optimizer.ascent.ascent import calmest
from camopt.scene import Scene
from camopt.study.measurements import fastest
from experiments.cost_scaling import exponent, scenes_by_masses
from experiments.support.record import RESULTS, printed, run_script, write_result

SOURCES = ("smooth", "exact")
MASSES = {"small": (10, 1), "full": (45, 25, 15, 10, 5, 3, 2)}
SPEEDS = {"small": (1, 2), "full": (1, 4, 16, 64)}
TRAINS = {"small": (1, 2), "full": (1, 4, 16, 64)}
KNOTS_DEG = {"small": (6.0, 3.0), "full": (6.0, 3.0, 1.5, 1.0, 0.7)}
KNOT_DEG = 6.0
SLOWEST_RPM, TOP_RPM = 5000.0, 7000.0


def main(size: str = "full", folder: Path = RESULTS) -> dict:
    """Time of each Jacobian [ms] by source, and the exponents of its growth; writes `jacobian_cost.json`."""
    rows, powers = [], []
    for source in SOURCES:
        measured: dict[tuple, tuple[float, dict]] = {}
        for by, scene, arguments, knot_deg in grown(size):
            case = len(scene.mass), knot_deg, *arguments.items()  # the first case of each varied number is the same
            if case not in measured:
                call = partial(camopt.linearised, scene, calmest(scene, knot_deg), source=source, **arguments)
                seconds, paths = fastest(call, 1)
                measured[case] = float(seconds), dict(paths.sizes)
            seconds, sizes = measured[case]
            count = {"masses": len(scene.mass), "coefficients": sizes["coefficient"], "speeds": sizes["speed_rpm"]}
            count["trains"] = sizes.get("train", 1)
            rows.append(printed({"source": source, "by": by, "count": count[by], "ms": 1e3 * seconds}))
        for by in count if size == "full" else ():
            tried = [(row["count"], row["ms"]) for row in rows if (row["source"], row["by"]) == (source, by)]
            powers.append({"source": source, "by": by, "power": exponent(tried)})
    return write_result("jacobian_cost", size, {"rows": rows, "powers": powers}, {}, folder)


def grown(size: str) -> Iterator[tuple[str, Scene, dict, float]]:
    """(varied number, scene, further arguments of `linearised`, interval of the knots [deg]) of each case."""
    kodama, top = camopt.load_scene("kodama"), {"speeds_rpm": (TOP_RPM,)}
    for scene in scenes_by_masses(kodama, size):
        if len(scene.mass) in MASSES[size]:
            yield "masses", scene, top, KNOT_DEG
    for count in SPEEDS[size]:
        yield "speeds", kodama, {"speeds_rpm": tuple(np.linspace(TOP_RPM, SLOWEST_RPM, count))}, KNOT_DEG
    for count in TRAINS[size]:
        yield "trains", kodama, top | ({"trains": count} if count > 1 else {}), KNOT_DEG
    for knot_deg in KNOTS_DEG[size]:
        yield "coefficients", kodama, top, knot_deg


if __name__ == "__main__":
    run_script(main, __doc__)
