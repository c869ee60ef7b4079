"""What does each limit of `kodama` cost in area over the band, and how much area does a better valve spring allow?

The scene is `kodama` at accuracy draft, with constraint rows of the exact response. Computed is the largest area that
event-exact confirms over the band, against the limit on bounce (without limits on jump and seating velocity, which
would hide its effect), on jump (without the limit on seating velocity) and on jerk. Then the factors on rate and
preload of the valve spring, each within 10 %, are optimised together with the cam, and the area is confirmed by a
search with this spring.
"""

from dataclasses import replace
from pathlib import Path

from camopt.optimizer.accuracy import ACCURACIES
from camopt.optimizer.search.search import find_cam
from camopt.scene import load_scene
from camopt.study.fronts import VALUES, joint_spring, pareto
from experiments.support.record import RESULTS, run_script, write_result

RELEASED = {
    "bounce_max_mm": ("jump_max_mm", "seating_velocity_max_m_per_s"),
    "jump_max_mm": ("seating_velocity_max_m_per_s",),
    "jerk_max_mm_per_deg3": (),
}
"""By limit the other limits that are removed because they would hide its effect."""
GRADIENT = "exact"
SMALL = {"jerk_max_mm_per_deg3": (0.002, 0.004)}


def main(size: str = "full", folder: Path = RESULTS) -> dict:
    """Searches, prints and writes fronts.json and a figure per limit into `folder`."""
    scene, limits = load_scene("kodama"), VALUES if size == "full" else SMALL
    speeds = "band" if size == "full" else "nominal"
    settings = {"speeds": speeds, "gradient": GRADIENT, "progress": size == "full"}
    fronts = {n: pareto(scene, n, values, release=RELEASED[n], **settings) for n, values in limits.items()}
    content = {"fronts": {}}
    for name, front in fronts.items():
        content["fronts"][name] = {k: front.table[k].values.tolist() for k in ("limit", *front.table.data_vars)}
    design = joint_spring(scene, speeds=speeds, evaluations=30 if size == "full" else 4)
    effort = ACCURACIES["draft"]
    if size == "small":
        effort = replace(effort, feedback_rounds=4)
    as_given, together = (find_cam(s, speeds, effort, GRADIENT).confirmed[-1] for s in (scene, design.scene))
    content["spring"] = {
        "rate": design.rate,
        "preload": design.preload,
        "area_ratio_program": design.area_ratio,
        "area_ratio_program_as_given": design.area_ratio_as_given,
        "area_ratio": together.area_ratio,
        "area_ratio_as_given": as_given.area_ratio,
    }
    return write_result(
        "fronts", size, content, {name.removesuffix("_mm"): f.plot() for name, f in fronts.items()}, folder
    )


if __name__ == "__main__":
    run_script(main, __doc__)
