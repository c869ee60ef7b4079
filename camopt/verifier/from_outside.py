"""Comparison with Exudyn, an engine that is not part of camopt and runs in a separate process.

`camopt.verifier.outside` is that process, which imports nothing else of camopt. Its motions from rest are compared with
event-exact's or, for curved laws, with DOP853's, which has no chords.
"""

import json
import subprocess
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from camopt.cam.design_file import as_written, write_design
from camopt.cam.lift import Lift
from camopt.scene.errors import InputError
from camopt.scene.response import end_state
from camopt.scene.rest import state_at_rest
from camopt.scene.schema import Scene
from camopt.scene.shapes import Float
from camopt.scene.text_file import scene_toml
from camopt.scene.train import build_train
from camopt.scene.units import MM
from camopt.storage import write_text
from camopt.verifier.record import outside_entry
from camopt.verifier.verdict import method_named

ENGINE = "Exudyn"
AGREES_NM = 1.0
"""Allowed difference of the two motions [nm] beyond the error estimates of both."""
NM = 1e-9
JUMPS_MM = 0.05
"""Jump [mm] beyond which the motion is chaotic within a revolution or two, so that only the first one is compared."""
REVOLUTIONS = 2
TIMEOUT_S = 300.0
"""Longest time that Exudyn may take for one speed [s]; a few seconds are usual."""
SAMPLES = 720
"""Number of equal intervals of a revolution at whose ends the valve's position is compared."""
DOP853_STEPS = 4 * SAMPLES
"""Steps per revolution of DOP853 for a permitted relative error of 1e-8; twice as many permit an eighth of it."""


def require_outside() -> None:
    """Raises InputError, with the remedy, if Exudyn is not installed."""
    if find_spec("exudyn") is None:
        raise InputError(
            f"the judge from outside needs {ENGINE}, which is not installed: pip install 'camopt[outside]', "
            f"or leave --outside away"
        )


def outside_motions(scene: Scene, lift: Lift, speeds_rpm: Sequence[float], *options: str) -> dict:
    """The record of `python -m camopt.verifier.outside` for a scene and a cam at speeds (k) [r/min].

    `options` are further arguments of that command. Raises InputError if Exudyn is not installed, takes too long, or
    if the process cannot express the scene.
    """
    require_outside()
    with TemporaryDirectory() as folder:
        files = [str(Path(folder) / name) for name in ("scene.toml", "design.json", "motion.json")]
        write_text(files[0], scene_toml(scene))
        write_design(files[1], lift, scene.required_design.max_lift_mm * MM)
        arguments = ["--speeds", *(repr(float(s)) for s in speeds_rpm), "--out", files[2], *options]
        command = [sys.executable, "-m", "camopt.verifier.outside", *files[:2], *arguments]
        timeout_s = TIMEOUT_S * len(speeds_rpm)
        try:
            ended = subprocess.run(command, capture_output=True, text=True, check=False, timeout=timeout_s)
        except subprocess.TimeoutExpired:
            raise InputError(
                f"the judge from outside has no answer after {timeout_s:g} s: ask for fewer speeds, or leave "
                f"--outside away where contacts chatter"
            ) from None
        if ended.returncode == 2:
            raise InputError(ended.stderr.strip())
        if ended.returncode:
            raise RuntimeError(f"the judge from outside broke off: {ended.stderr.strip()[-500:]}")
        return json.loads(Path(files[2]).read_text(encoding="utf-8"))


def valve_from_rest(
    scene: Scene, lift: Lift, speed_rpm: float
) -> tuple[Float[np.ndarray, "revolutions samples"], Float[np.ndarray, " revolutions"]]:
    """Valve position [m] by camopt in the first revolutions from rest, at SAMPLES + 1 equal angles, and its error [m].

    If all laws are straight lines it is event-exact's motion, which counts as exact. Otherwise it is DOP853's, and the
    error is the change by doubling the number of steps.
    """
    if build_train(scene).straight:
        return _valve(scene, lift, speed_rpm, "event", SAMPLES), np.zeros(REVOLUTIONS)
    coarse, fine = (_valve(scene, lift, speed_rpm, "dop853", n) for n in (DOP853_STEPS, 2 * DOP853_STEPS))
    return fine, np.abs(fine - coarse).max(axis=1)


def _valve(scene: Scene, lift: Lift, speed_rpm: float, method: str, steps: int) -> np.ndarray:
    """Valve position [m] by one method; `steps` per revolution must be a multiple of SAMPLES."""
    train = build_train(scene)
    revolve = method_named(method)(train, lift, scene.cam_speed(speed_rpm), steps)
    angles, state, rows = np.linspace(-np.pi, np.pi, SAMPLES + 1), state_at_rest(train), []
    for _ in range(REVOLUTIONS):
        motion = revolve(state)
        after = np.clip(np.searchsorted(motion.angle, angles), 1, len(motion.angle) - 1)
        before = np.abs(motion.angle[after - 1] - angles) < np.abs(motion.angle[after] - angles)
        rows.append(motion.x[after - before, train.valve])
        state = end_state(motion)
    return np.array(rows)


def from_outside(scene: Scene, lift: Lift, speeds_rpm: Sequence[float]) -> tuple[dict, ...]:
    """The entries of outside.json: differences of Exudyn's and camopt's motions from rest at speeds (k) [r/min].

    Raises the errors of `outside_motions`.
    """
    lift = as_written(lift)
    record = outside_motions(scene, lift, speeds_rpm, "--revolutions", str(REVOLUTIONS), "--samples", str(SAMPLES))
    return tuple(
        compared(record["engine"], row, *valve_from_rest(scene, lift, row["speed_rpm"])) for row in record["speeds"]
    )


def compared(engine: str, row: dict, valve: np.ndarray, error: np.ndarray) -> dict:
    """The entry of one speed, from Exudyn's record `row` and camopt's valve position and error by `valve_from_rest`."""
    calm = all(figures["jump_mm"] < JUMPS_MM for figures in row["figures"])
    count = len(valve) if calm else 1
    difference = np.abs(np.array(row["valve_m"])[:count] - valve[:count]).max() / NM
    stated = AGREES_NM + max(row["moved_nm"][:count]) + error[:count].max() / NM
    return outside_entry(row["speed_rpm"], engine, count, float(difference), float(stated))
