"""What does it cost in area that the train or the grinding may be a little off?

    python -m experiments.price_list [small|full]

`kodama` over its band: the cam designed for the train as given, and how far each perturbation takes it beyond the
limits; then, for each group of perturbations, the largest area of a cam that holds every limit under all of the group.
Spring rate, preload and contact stiffness 10 % off, lash 0.05 mm off, one at a time and both ways; 20 seeded grinding
errors of 5 um peak, harmonics 2 to 40. At accuracy draft for all, so that the differences are those of the demands.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from camopt.optimizer.accuracy import ACCURACIES
from camopt.optimizer.search.judge import Judge
from camopt.optimizer.search.robust import perturbations
from camopt.optimizer.search.search import find_cam
from camopt.scene import InputError, load_scene
from experiments.support.record import RESULTS, run_script, write_result

GROUPS = ("spring rate", "preload", "contact stiffness", "lash", "grinding")
SPEEDS = {"small": 3, "full": 41}


def main(size: str = "full", folder: Path = RESULTS) -> dict:
    """Designs and judges, prints the list and writes price_list.json into `folder`."""
    scene, effort = load_scene("kodama"), ACCURACIES["draft"]
    if size == "small":
        effort = replace(effort, knot_deg=6.0, program_speeds=2, judged_speeds=5, judge_stride=1)
    named = perturbations(scene, seeds=20 if size == "full" else 1)
    given, _ = find_cam(scene, "band", effort)
    area, low_high = given.best.area_ratio, scene.operation.band_rpm
    off = []
    for name, perturbed in named.items():
        judged = Judge(perturbed.scene, np.linspace(*low_high, SPEEDS[size]))(perturbed.applied(given.best.lift))
        off.append({"perturbation": name, **{n: judged.worst(n) for n in judged.figures}})
        print(f"{name:<24} bounce {off[-1]['bounce_mm']:.3f} mm, jump {off[-1]['jump_mm']:.3f} mm", flush=True)
    prices = []
    for group in GROUPS if size == "full" else GROUPS[1:2]:
        own = {name: p for name, p in named.items() if name.startswith(group)}
        try:
            found, _ = find_cam(scene, "band", effort, perturbations=own)
            ratio, why = found.best.area_ratio, None
        except InputError as error:
            ratio, why = None, str(error)
        price = None if ratio is None else 100 * (1 - ratio / area)
        prices.append({"group": group, "area_ratio": ratio, "price_percent": price, "why": why})
        print(f"{group:<24} area ratio {ratio}, price {price} %", flush=True)
    content = {"area_ratio": area, "as_designed": off, "prices": prices}
    write_result("price_list", size, content, {}, folder)
    return content


if __name__ == "__main__":
    run_script(main, __doc__)
