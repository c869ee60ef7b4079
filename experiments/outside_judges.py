"""Do independently developed simulation engines confirm the motions of camopt, and do they detect small changes of the
model?

Exudyn is given only the scene file and the pieces of a design file (`camopt.verifier.outside`). The valve positions are
compared at every half degree of the first two revolutions from rest; with jumps above 0.05 mm only in the first,
because the motion is then chaotic. The metrics of the settled motion are compared with those of event-exact, and as
ranges where the motion is aperiodic. The cams are the design at accuracy draft of each built-in scene that has one, and
its Polydyne. Then ten small changes are made to the model that Exudyn is given, and each of them must be detected.

A second engine, Siconos, formulates contact as complementarity and computes undamped copies of the trains with linear
laws (`experiments.support.undamped`). Each has a row for the first revolution from rest at the scene's first speed,
with the design or, where there is none, the Polydyne, and with the step that was used.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from matplotlib.figure import Figure

from camopt.cam.design_file import as_written, read_design
from camopt.cam.families.polydyne import polydyne
from camopt.cam.lift import Lift
from camopt.exact import prepare
from camopt.optimizer.run import optimize
from camopt.scene import InputError, Scene, build_train, builtin_scenes, load_scene
from camopt.scene.rest import state_at_rest
from camopt.scene.units import MM
from camopt.study.reduce.reduction import milliseconds
from camopt.verifier.accuracy import EFFORTS
from camopt.verifier.from_outside import NM, compared, outside_motions, valve_from_rest
from camopt.verifier.verdict import verdict_on
from experiments.support.outside_changes import CHANGES
from experiments.support.panels import DASHED, Panel, panels
from experiments.support.record import RESULTS, run_script, write_result
from experiments.support.undamped import Case, undamped_part

FIGURES = "bounce_mm", "jump_mm", "seating_velocity_m_per_s", "contact_force_max_N"
WITHIN_MM, WITHIN = 1e-4, 0.01
"""Tolerances of settled metrics: lengths [mm], and the relative tolerance of every metric."""
MEASURED = 4, 8
"""Measured revolutions of a settled motion, and of an aperiodic one."""
CHANGED, CHANGED_RPM = "kodama", 6000.0
"""Scene and speed [r/min] of the changed models."""
DRAWN = ("kodama", 6000.0), ("exhaust-gas", 6000.0), ("finger-hydraulic", 6000.0)
SMALL_STEPS = 57_600
"""Largest number of steps of an undamped revolution at the small size."""


def main(size: str = "full", folder=RESULTS) -> dict:
    """Differences from rest and of settled metrics, the detected changes, and the computing times."""
    with TemporaryDirectory() as made:
        if size == "small":
            scene, changed_scene = load_scene("motori-1"), load_scene(CHANGED)
            rows, cams = of_cam(scene, "polydyne", polydyne(scene), [5000.0]), {}
            changes = changed(changed_scene, polydyne(changed_scene), 2)
            beside = undamped_part([(changed_scene, "polydyne", polydyne(changed_scene), [5000.0])], None, SMALL_STEPS)
        else:
            scenes = [load_scene(name) for name in builtin_scenes() if load_scene(name).design]
            cams = {scene.name: delivered(scene, Path(made)) for scene in scenes}
            cases = [case for scene in scenes for case in cases_of(scene, cams[scene.name])]
            rows = [row for case in cases for row in of_cam(*case)]
            changed_scene, design = load_scene(CHANGED), needed(cams[CHANGED])
            changes = changed(changed_scene, design, len(CHANGES))
            slowest = [(*case[:3], case[3][:1]) for case in {case[0].name: case for case in reversed(cases)}.values()]
            beside = undamped_part(slowest, (changed_scene, "design", design, [CHANGED_RPM]))
    content = {"rows": rows, "changes": changes, **beside, "summary": summary(rows, changes) | beside["summary"]}
    figures = {} if size == "small" else {"motion": motion_figure([_drawn(cams, *case) for case in DRAWN])}
    if beside["undamped"]:
        figures["halvings"] = halvings_figure(beside["undamped"])
    return write_result("outside_judges", size, content, figures, folder)


def delivered(scene: Scene, runs: Path) -> Lift | None:
    """The design of a scene at accuracy draft; None where none is found."""
    run = runs / scene.name
    if not run.is_dir():
        try:
            optimize(scene, accuracy="draft", out=run, compare=False)
        except InputError as error:
            print(f"{scene.name}: {error}")
    return read_design(run / "design.json", scene) if (run / "design.json").is_file() else None


def cases_of(scene: Scene, design: Lift | None) -> list[Case]:
    """A scene's design, where there is one, and its Polydyne, each at the scene's speeds."""
    cams = {"design": design, "polydyne": polydyne(scene)}
    speeds = list(scene.required_operation.speeds_rpm)
    return [(scene, name, lift, speeds) for name, lift in cams.items() if lift]


def of_cam(scene: Scene, cam: str, lift: Lift, speeds_rpm: list[float]) -> list[dict]:
    """A row for each speed [r/min]."""
    lift, rows = as_written(lift), []
    verdict = verdict_on(scene, lift, tuple(speeds_rpm), ("event",), None, EFFORTS["draft"].tolerances)
    for speed in verdict.speeds:
        answer = speed.methods["event"]
        measured = MEASURED[0] if answer.periodic else MEASURED[1]
        options = "--settled", str(answer.revolutions), "--measured", str(measured)
        outside = outside_motions(scene, lift, [speed.speed_rpm], *options)
        at_speed = outside["speeds"][0]
        comparison = compared(outside["engine"], at_speed, *valve_from_rest(scene, lift, speed.speed_rpm))
        settled = {
            name: _beside(name, answer.range[name], answer.error[name], at_speed["settled"], answer.periodic)
            for name in FIGURES
        }
        ms = {"exudyn": 1e3 * at_speed["seconds_per_revolution"], "event": revolution_ms(scene, lift, speed.speed_rpm)}
        jump_mm = max(f["jump_mm"] for f in at_speed["figures"])
        row = {"scene": scene.name, "cam": cam, **comparison, "jump_mm": jump_mm, "tolerance": at_speed["tolerance"]}
        rows.append(row | {"periodic": answer.periodic, "settled": settled, "ms": ms})
        print({key: rows[-1][key] for key in ("scene", "cam", "speed_rpm", "difference_nm", "stated_nm", "agrees")})
    return rows


def _beside(name: str, ours: tuple[float, float], error: float, theirs: list[dict], periodic: bool) -> dict:
    """One settled metric of both engines: the range of each, and whether they agree.

    The worst revolutions are compared where the motion is periodic; where it is aperiodic, the ranges must overlap. The
    tolerance includes camopt's own error estimate.
    """
    values = [np.nan if f.get(name) is None else f[name] for f in theirs]
    low, high = min(values), max(values)
    allowed = error + max(WITHIN * abs(ours[1]), WITHIN_MM if name.endswith("_mm") else 0.0)
    if periodic:
        same = abs(high - ours[1]) <= allowed
    else:
        same = low <= ours[1] + allowed and ours[0] <= high + allowed
    return {"ours": list(ours), "theirs": [low, high], "off": abs(high - ours[1]), "same": bool(same)}


def revolution_ms(scene: Scene, lift: Lift, speed_rpm: float) -> float:
    """Least processor time of an event-exact revolution from rest [ms]."""
    train = build_train(scene)
    revolve, state = prepare(train, lift, scene.cam_speed(speed_rpm)), state_at_rest(train)
    return milliseconds(lambda: revolve(state))


def changed(scene: Scene, lift: Lift, count: int) -> list[dict]:
    """Rows of the first `count` changes, of which only Exudyn is given the changed model."""
    lift = as_written(lift)
    valve, rows = valve_from_rest(scene, lift, CHANGED_RPM), []
    for change in CHANGES[:count]:
        model = change.scene(scene), as_written(change.cam(lift)), [CHANGED_RPM]
        outside = outside_motions(*model, "--law", change.law)
        comparison = compared(outside["engine"], outside["speeds"][0], *valve)
        rows.append({"change": change.name, **comparison, "noticed": not comparison["agrees"]})
    return rows


def summary(rows: list[dict], changes: list[dict]) -> dict:
    """The numbers that the page states."""
    calm = [row for row in rows if row["revolutions"] == 2]
    settled = [row for row in rows if row["periodic"]]
    return {
        "motions": len(rows),
        "agree": sum(row["agrees"] for row in rows),
        "calm": len(calm),
        "calm_within_nm": max(row["difference_nm"] for row in calm),
        "beyond_within_nm": max((r["difference_nm"] for r in rows if r["revolutions"] == 1), default=0.0),
        "settled": len(settled),
        "settled_same": sum(all(f["same"] for f in row["settled"].values()) for row in settled),
        "wander": len(rows) - len(settled),
        "wander_same": sum(all(f["same"] for f in r["settled"].values()) for r in rows if not r["periodic"]),
        "noticed": sum(row["noticed"] for row in changes),
        "changes": len(changes),
    }


def needed(cam: Lift | None) -> Lift:
    assert cam is not None, "a draft delivers a cam for this scene"
    return cam


def _drawn(cams: dict[str, Lift | None], name: str, speed_rpm: float) -> dict:
    """A motion of a design for the figure: the valve by camopt [m], and the difference of Exudyn's from it [nm]."""
    scene, lift = load_scene(name), as_written(needed(cams[name]))
    ours, _ = valve_from_rest(scene, lift, speed_rpm)
    exudyn = np.array(outside_motions(scene, lift, [speed_rpm])["speeds"][0]["valve_m"])
    return {"title": f"{name}, {speed_rpm:.0f} r/min", "valve_m": ours, "off_nm": (exudyn - ours) / NM}


def motion_figure(cases: list[dict]) -> Figure:
    """A column for each motion, with its two revolutions from rest in sequence."""
    above, below = [], []
    for i, case in enumerate(cases):
        revolutions, samples = case["valve_m"].shape
        angle = np.concatenate([np.linspace(-180, 180, samples) + 360 * r for r in range(revolutions)])
        labels = ("valve, from rest [mm]", "Exudyn less camopt [nm]") if i == 0 else ("", "")
        above.append(Panel(labels[0], [("camopt", angle, case["valve_m"].ravel() / MM)], case["title"]))
        below.append(Panel(labels[1], [("Exudyn less camopt", angle, case["off_nm"].ravel())]))
    return panels([above, below], "cam angle [deg]", width=9.6, row_height=1.8)


def halvings_figure(rows: list[dict]) -> Figure:
    """Difference of Siconos's valve against its step, a line for each undamped motion, with the slope of order two."""
    curves = []
    for row in rows:
        us = [row["step_us"] * row["steps"] / h["steps"] for h in row["halvings"]]
        curves.append((row["scene"], us, [h["difference_nm"] for h in row["halvings"]]))
    ends = np.array([min(us[-1] for _, us, _ in curves), max(us[0] for _, us, _ in curves)])
    curves.append(("order two", ends, 0.05 * (ends / 0.05) ** 2))
    look = {"order two": DASHED | {"marker": ""}}
    panel = Panel("difference of the valve [nm]", curves)
    return panels([[panel]], "step [us]", None, 5.6, 2.9, scale=("log", "log"), marker="o", look=look)


if __name__ == "__main__":
    run_script(main, __doc__)
