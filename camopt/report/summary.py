"""What the page shows first: the cam with its few figures, what its limits cost, and what to do next."""

import shlex
from collections.abc import Sequence
from typing import Any

import numpy as np

from camopt.cam.lift import Lift
from camopt.plots.style import DESIGN
from camopt.report.assumed import Hanging, first_to_measure
from camopt.report.folder import RunFolder
from camopt.report.motion import RunCams
from camopt.report.tables import comparison_groups
from camopt.report.wording import label_and_unit, shown
from camopt.report.worst import worst_of
from camopt.scene.quantities import is_number
from camopt.scene.units import DEG, MM

WIDTH, HEIGHT = 300.0, 96.0
"""Size of the sketch of the lift [px]."""
POINTS = 241
LONG_OPEN_DEG = 5.0
"""A contact open over more of the cam than this is worth a decision, however little it opens."""


def sketch(lift: Lift, duration_deg: float) -> dict[str, Any]:
    """The cam's lift as the path of an SVG, over its event with the ramps."""
    lifted = [angle for angle in lift.borders if lift(np.array(angle)) > 0]
    reach = max([duration_deg / 2 * DEG, *np.abs(lifted)]) * 1.1
    theta = np.linspace(-reach, reach, POINTS)
    x, y = WIDTH * (theta / reach + 1) / 2, HEIGHT * (1 - 0.92 * lift(theta) / lift.max_lift)
    path = "M" + "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(x, y, strict=True))
    ends = [round(WIDTH * (sign * duration_deg / 2 * DEG / reach + 1) / 2, 1) for sign in (-1, 1)]
    words = f"Lift of the cam, {shown(lift.max_lift / MM)} mm at most over a duration of {shown(duration_deg)} deg"
    return {"path": path, "width": WIDTH, "height": HEIGHT, "ends": ends, "words": words}


def facts(run: RunFolder, cams: RunCams) -> list[tuple[str, str]]:
    """The cam's figures by their names: area, bound, lift, and the best other cam that is confirmed."""
    d, lift, found = run.design, cams.lifts.get(DESIGN), []
    if is_number(d.get("area_ratio")):
        found.append(("area ratio", shown(d["area_ratio"])))
    if is_number(d.get("area_gap_percent")):
        found.append(("below the bound", f"{shown(d['area_gap_percent'], 3)} %"))
    if lift is not None:
        found.append(("largest lift", f"{shown(lift.max_lift / MM)} mm"))
        found.append(("duration", f"{shown(2 * lift.half_duration / DEG)} deg"))
    groups = comparison_groups(run)
    others = [g for g in groups if g["cam"] != DESIGN and g["within"] and g["verdict"] == "confirmed" and g["area"]]
    if others and is_number(d.get("area_ratio")):
        best = max(others, key=lambda g: g["area"])
        more = 100 * (d["area_ratio"] / best["area"] - 1)
        found.append((f"area against {best['cam']}", f"{'+' if more >= 0 else '−'}{shown(abs(more), 3)} %"))
    elif groups:
        found.append(("other cams under these limits", "none confirmed"))
    return found


def next_steps(run: RunFolder, assumed: Sequence[Hanging] = ()) -> list[dict[str, str]]:
    """What to do with this verdict: a sentence each, and the command that does it, from where the report is made.

    `assumed` are the train's assumed numbers, those first on which most hangs.
    """
    verdict, name = run.verification.get("verdict"), shlex.quote(run.path or run.name)
    scene, cam = f"{shlex.quote(f'{run.path or run.name}/scene.toml')}", f"--cam {name}"
    design = {"words": "Move the limits and watch the cam.", "command": f"camopt design {scene}"}
    again = f"camopt optimize {scene} --accuracy standard"
    if verdict == "confirmed":
        table = f"camopt cam {scene} {cam} --csv lift.csv --digits 5"
        steps, settings = [], run.provenance.get("settings")
        if run.scene.get("tolerance") and not run.verification.get("yield"):
            words = "Ask how many trains as built hold."
            steps.append({"words": words, "command": f"camopt yield {scene} {cam} --trains 200"})
        if isinstance(settings, dict) and settings.get("accuracy") == "draft":
            steps.insert(0, {"words": "This was a draft: design once more before it is ground.", "command": again})
        else:
            steps.append({"words": _before_grinding(run, assumed), "command": table})
        return [*_of_the_contact(run, again), *steps, _dearest(run, scene)]
    if verdict == "rejected":
        return [{"words": "Search further: the verdict broke a limit.", "command": again}, design]
    if verdict == "sensitive":
        words = "Lower the limit that is straddled by a tenth in the scene, and design again."
        return [{"words": words, "command": again}, design]
    if verdict == "not converged":
        words = "Judge it with more methods and finer steps."
        return [{"words": words, "command": f"camopt verify {scene} {cam} --accuracy fine"}]
    if "design.json" in run.missing or "scene.toml" in run.missing:
        return []
    return [{"words": "Have the cam judged.", "command": f"camopt verify {scene} {cam}"}, design]


def _before_grinding(run: RunFolder, assumed: Sequence[Hanging]) -> str:
    """To have the cam ground, once what its motion hangs on and its outline stands on is measured."""
    geometry = run.scene.get("geometry")
    guessed = geometry.get("assumed") if isinstance(geometry, dict) else None
    names = [label_and_unit(str(key))[0] for key in guessed] if isinstance(guessed, list) else []
    parts = [f"of the train first {first_to_measure(assumed)}"] if assumed else []
    parts += [f"of the geometry {', '.join(names)}"] if names else []
    if not parts:
        return "Take the cam to the grinder."
    return f"Measure what the scene assumes ({'; '.join(parts)}), then take the cam to the grinder."


def _of_the_contact(run: RunFolder, again: str) -> list[dict[str, str]]:
    """What to do where the contact opens over more than a few degrees and nothing in the scene forbids it."""
    angle, design = worst_of(run, "jump_deg"), run.scene.get("design")
    limited = isinstance(design, dict) and ("jump_max_deg" in design or "contact_force_min_N" in design)
    if limited or angle is None or angle.value is None or angle.value <= LONG_OPEN_DEG:
        return []
    opens = f"A contact is open over {shown(angle.value)} deg, {angle.where}"
    return [{"words": f"{opens}: if it must not be, set contact_force_min_N.", "command": again}]


def _dearest(run: RunFolder, scene: str) -> dict[str, str]:
    """To move the limits, the one first of which one per cent buys most."""
    worth = run.design.get("limit_worth")
    known = {str(k): v for k, v in worth.items() if is_number(v)} if isinstance(worth, dict) else {}
    first = max(known, key=lambda key: known[key]) if known else None
    words = f"Move the limits; {label_and_unit(first)[0]} buys most area." if first else "Move the limits."
    return {"words": words, "command": f"camopt design {scene}"}
