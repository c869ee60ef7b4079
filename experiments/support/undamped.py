"""Undamped copies of trains, whose motion is compared with Siconos in a separate process.

Siconos formulates contact as complementarity, which allows no damper. Therefore the dampers of all contacts are
removed, in the input of Siconos and in camopt's train alike; springs keep theirs. Trains with curved laws or internal
states are left out. The valve positions are compared in the first revolution from rest: an undamped seat continues to
bounce until the next opening, and the initial state of the second revolution depends on every bounce.
"""

import json
import os
import subprocess
import sys
from functools import cache
from pathlib import Path
from shutil import which
from tempfile import TemporaryDirectory

import numpy as np

from camopt.cam.design_file import as_written, write_design
from camopt.cam.lift import Lift
from camopt.scene import Scene
from camopt.scene.text_file import scene_toml
from camopt.scene.units import MM
from camopt.storage import write_json, write_text
from camopt.verifier.from_outside import AGREES_NM, NM, SAMPLES, valve_from_rest
from camopt.verifier.outside.filed import GROUND, read_cam, read_train
from camopt.verifier.outside.forces import at_rest
from experiments.support import siconos_judge
from experiments.support.outside_changes import CHANGES

NO_SICONOS = (
    "the undamped copies are skipped: no Python here has Siconos, which Debian's package python3-siconos gives to the "
    "system's (apt-get install python3-siconos)"
)

CHANGES_FINEST = 57_600
"""Largest number of steps with a changed model; the changes are larger than the error of this coarser step."""
Case = tuple[Scene, str, Lift, list[float]]
"""A scene, the name of a cam, the cam, and speeds [r/min]."""


def undamped_part(cases: list[Case], of_change: Case | None, finest: int = siconos_judge.FINEST) -> dict:
    """Rows of the undamped copies of the cases, changes detected in one of them, and the numbers of the page.

    Where no Python has Siconos there are no rows, and `undamped_skipped` is the sentence that says so.
    """
    python, rows, changes = siconos_python(), [], []
    if python is None:
        print(NO_SICONOS)
    else:
        rows = [row for case in _copies(cases) for row in judged(python, *case, finest)]
        changes = [row for case in _copies([of_change] if of_change else []) for row in noticed(python, *case)]
    summary = {
        "undamped": len(rows),
        "undamped_agree": sum(row["agrees"] for row in rows),
        "undamped_within_nm": max((row["difference_nm"] for row in rows), default=None),
        "undamped_event_nm": max((row["event_nm"] for row in rows), default=None),
        "undamped_changes": len(changes),
        "undamped_noticed": sum(row["noticed"] for row in changes),
    }
    skipped = NO_SICONOS if python is None else ""
    return {"undamped": rows, "undamped_changes": changes, "undamped_skipped": skipped, "summary": summary}


def _copies(cases: list[Case]) -> list[Case]:
    """The cases with undamped copies of their scenes, without those that have none."""
    return [(copy, cam, lift, speeds) for scene, cam, lift, speeds in cases if (copy := undamped(scene))]


@cache
def siconos_python() -> str | None:
    """A Python that can import Siconos: this one, the first one on the path, or the system's; otherwise None."""
    for python in dict.fromkeys((sys.executable, which("python3"), which("python3", path=os.defpath))):
        if (
            python
            and not subprocess.run(
                [python, "-Ic", "import siconos.kernel"], capture_output=True, check=False
            ).returncode
        ):
            return python
    return None


def undamped(scene: Scene) -> Scene | None:
    """The scene without dampers in contacts; None for a scene with curved laws, adjusters or friction."""
    if any(e.law != "linear" or e.kind not in ("spring", "contact") for e in scene.element):
        return None
    without = {"damping_N_s_per_m": 0.0}
    elements = (e.model_copy(update=without) if e.kind == "contact" else e for e in scene.element)
    return scene.model_copy(update={"element": tuple(elements)})


def siconos_input(scene: Scene, lift: Lift, folder: Path) -> dict:
    """The input of Siconos for an undamped scene and a cam: the numbers of their files, as `camopt.verifier.outside`
    reads them. Raises ValueError for elements that complementarity cannot express."""
    write_text(folder / "scene.toml", scene_toml(scene))
    write_design(folder / "design.json", lift, scene.required_design.max_lift_mm * MM)
    train, cam = read_train(folder / "scene.toml"), read_cam(folder / "design.json")
    for e in train.elements:
        if e.law != "linear" or (e.contact and e.damping) or (e.driven and not e.contact):
            what = "it is given linear springs, and contacts without dampers"
            raise ValueError(f"Siconos cannot express {e.name}: {what}")

    def of_kind(contact: bool) -> dict:
        some = [e for e in train.elements if e.contact == contact]
        row = np.zeros((len(some), len(train.mass)))
        for signs, e in zip(row, some, strict=True):
            for end, sign in ((e.a, 1.0), (e.b, -1.0)):
                if end != GROUND:
                    signs[end] = sign
        keys = "stiffness", "damping", "preload", "gap", "driven"
        return {"row": row} | {key: np.array([getattr(e, key) for e in some], dtype=float) for key in keys}

    return {
        **{key: getattr(train, key) for key in ("mass", "drag", "load", "forcing", "valve")},
        "springs": of_kind(contact=False),
        "contacts": of_kind(contact=True),
        "rest": at_rest(train),
        "cam": {"start": cam.start, "coefficients": cam.coefficients},
    }


def compared(
    python: str, scene: Scene, lift: Lift, model: tuple[Scene, Lift], speeds_rpm: list[float], finest: int
) -> tuple[str, list[dict]]:
    """(Siconos's name, a row for each speed [r/min]): camopt's motion of an undamped scene and a cam compared with that
    of Siconos, which is given the scene and cam of `model`."""
    with TemporaryDirectory() as held:
        folder = Path(held)
        speeds = [(speed, scene.cam_speed(speed)) for speed in speeds_rpm]
        source, target = folder / "given.json", folder / "motion.json"
        write_json(source, siconos_input(*model, folder) | {"speeds": speeds, "finest": finest})
        command = [python, "-I", siconos_judge.__file__, str(source), "--out", str(target)]
        ended = subprocess.run(command, capture_output=True, text=True, check=False)
        if ended.returncode:
            raise RuntimeError(f"Siconos failed: {ended.stderr.strip()[-500:]}")
        motions = json.loads(target.read_text(encoding="utf-8"))
    valves = [valve_from_rest(scene, lift, one["speed_rpm"])[0][0] for one in motions["speeds"]]
    rows = [apart(one, valve, 2 * lift.half_duration) for one, valve in zip(motions["speeds"], valves, strict=True)]
    return motions["engine"], rows


def judged(python: str, scene: Scene, cam: str, lift: Lift, speeds_rpm: list[float], finest: int) -> list[dict]:
    """A row for each speed [r/min] of an undamped scene."""
    lift = as_written(lift)
    engine, rows = compared(python, scene, lift, (scene, lift), speeds_rpm, finest)
    for row in rows:
        print(scene.name, cam, {key: row[key] for key in ("speed_rpm", "difference_nm", "stated_nm", "agrees")})
    return [{"scene": scene.name, "cam": cam, "engine": engine, **row} for row in rows]


def apart(one: dict, valve: np.ndarray, duration: float) -> dict:
    """Differences of Siconos from `valve` (SAMPLES + 1) [m] at each number of steps, and its stated error.

    The stated error is 1 nm plus the larger change of its valve position by the last two halvings of the step.
    `event_nm` is the difference within the cam's `duration` [rad], before the valve strikes the undamped seat.
    """
    halvings = one["halvings"]
    positions = np.array([h["valve_m"] for h in halvings])
    moved = np.abs(np.diff(positions, axis=0)).max(axis=1) / NM
    off = np.abs(positions - valve) / NM
    event = np.abs(np.linspace(-np.pi, np.pi, SAMPLES + 1)) <= duration / 2
    stated = AGREES_NM + float(moved[-2:].max(initial=0.0))
    steps = halvings[-1]["steps"]
    return {
        "speed_rpm": one["speed_rpm"],
        "steps": steps,
        "step_us": 1e6 * one["turn_s"] / steps,
        "difference_nm": float(off[-1].max()),
        "event_nm": float(off[-1, event].max()),
        "stated_nm": stated,
        "agrees": bool(off[-1].max() <= stated),
        "halvings": [
            {"steps": h["steps"], "difference_nm": float(o.max()), "seconds": h["seconds"]}
            for h, o in zip(halvings, off, strict=True)
        ],
    }


def noticed(
    python: str, scene: Scene, cam: str, lift: Lift, speeds_rpm: list[float], finest: int = CHANGES_FINEST
) -> list[dict]:
    """Rows of the changes that only Siconos is given, without those of contact dampers, which have no effect here."""
    lift, rows = as_written(lift), []
    for change in CHANGES:
        changed, changed_lift = undamped(change.scene(scene)), as_written(change.cam(lift))
        assert changed is not None, "no change brings in a law"
        if changed == scene and np.array_equal(changed_lift.coefficients, lift.coefficients):
            continue
        _, found = compared(python, scene, lift, (changed, changed_lift), speeds_rpm, finest)
        rows += [{"change": change.name, "cam": cam, **row, "noticed": not row["agrees"]} for row in found]
    return rows
