"""What error does each accuracy setting give, over 40 random scenes, cams and speeds?

The script writes the curves from which `--accuracy` picks its settings. Of a method: the step times the train's highest
natural frequency [rad] (of the smooth path: the width of the layer [m]) against the largest error of the valve's
position over two revolutions from rest. "settling": the change of the state over a revolution [um] at which a motion
counts as settled, against the error of the settled bounce. "band_step": the step of a band [r/min] against the part of
the largest bounce that it misses. The reference is event-exact with finer samples, settled to 1e-10 m; cases in which
event-exact with two steps differs by more than 1 um are left out and counted.
"""

from functools import partial
from pathlib import Path

import numpy as np

import camopt.verifier
from camopt.exact import engine, settled_metrics
from camopt.measure.settling import settle
from camopt.measure.sweep import at_speeds
from camopt.scene import MotionRefused, build_train
from camopt.scene.rest import state_at_rest
from camopt.scene.units import MM, UM
from camopt.storage import write_json
from camopt.study.simulate.accuracy_control import apart_um, valve_position
from camopt.study.simulate.motion import dialled
from camopt.verifier.accuracy import FILE
from experiments.support.drawn_cases import DrawnCase, drawn_cases
from experiments.support.record import RESULTS, run_script, write_result

SEED = {"small": 24, "full": 7}
REVOLUTIONS = 2
DRAWS = {"small": 2, "full": 40}
SMOOTH_DRAWS = {"small": 0, "full": 6}
BAND_DRAWS = {"small": 1, "full": 8}
PHASES = {"small": (0.1, 0.3), "full": (0.01, 0.02, 0.05, 0.1, 0.2, 0.3)}
WIDTHS = (1e-9, 1e-8, 1e-7, 1e-6)
SETTLING_UM = (0.01, 0.1, 1.0, 10.0, 100.0)
BAND_STEPS = {"small": (100, 200), "full": (5, 10, 20, 50, 100, 200)}
TRUTH_PHASE = 0.02
SETTLED = 1e-10


def of_methods(cases: list[DrawnCase], phases, smooth: int) -> tuple[dict, int]:
    """Errors [um] (cases, settings) by method, and the number of cases without a reference."""
    errors: dict[str, list] = {name: [] for name in ("event", "dop853", "rkg", "tmm", "houbolt", "smooth")}
    unknown = 0
    for i, case in enumerate(cases):
        train, cam_speed = build_train(case.scene), case.scene.cam_speed(case.speed_rpm)
        run = {name: dialled(train, case.lift, cam_speed, name, REVOLUTIONS) for name in errors}
        truth, coarse = (valve_position(run["event"](phase), REVOLUTIONS) for phase in (TRUTH_PHASE, 1.5 * TRUTH_PHASE))
        if apart_um(truth, [coarse], REVOLUTIONS).max() > 1.0:
            unknown += 1
            continue
        for name, rows in errors.items():
            if (name == "smooth" and i >= smooth) or (name == "dop853" and i % 6):  # slow ones on fewer draws
                continue
            rows.append([_error(run[name], s, truth) for s in (WIDTHS if name == "smooth" else phases)])
    return {name: rows for name, rows in errors.items() if rows}, unknown


def _error(run, setting: float, truth: np.ndarray) -> float:
    try:
        return float(apart_um(valve_position(run(setting), REVOLUTIONS), [truth], REVOLUTIONS).max())
    except MotionRefused:
        return np.inf


def of_settling(cases: list[DrawnCase]) -> list[list[float]]:
    """Errors of the settled bounce [um]: (cases that settle, tolerances)."""
    rows = []
    for case in cases:
        train = build_train(case.scene)
        revolve, rest = engine.prepare(train, case.lift, case.scene.cam_speed(case.speed_rpm)), state_at_rest(train)
        truth = settle(revolve, rest, most=300, position=SETTLED)
        if truth.periodic:
            bounce = partial(settle, revolve, rest, 300)
            bounces = [bounce(position=s * UM).metrics(case.lift).worst("bounce_mm") for s in SETTLING_UM]
            rows.append(np.abs(np.array(bounces) - truth.metrics(case.lift).worst("bounce_mm")) * MM / UM)
    return [row for row in rows if np.all(np.isfinite(row))]


def of_bands(cases: list[DrawnCase], steps) -> list[list[float]]:
    """Part of the largest bounce that each step of the band misses [um], relative to the finest: (cases, steps)."""
    rows = []
    for case in cases:
        low, high = case.scene.required_operation.band_rpm
        speeds = np.arange(low, high + 1, steps[0])
        metrics = at_speeds(settled_metrics, case.scene, case.lift, speeds)
        bounce = np.nan_to_num([row["bounce_mm"] for row in metrics], nan=np.inf)
        worst = [bounce[:: step // steps[0]].max() for step in steps]
        if np.isfinite(worst[0]):
            rows.append((worst[0] - np.array(worst)) * MM / UM)
    return rows


def curve(unit: str, setting, errors) -> dict:
    errors = np.asarray(errors)
    median, p90 = (np.quantile(errors, q, axis=0, method="higher") for q in (0.5, 0.9))
    return {"unit": unit, "setting": list(setting), "median_um": median, "p90_um": p90, "draws": len(errors)}


def main(size: str, folder=RESULTS) -> dict:
    """Measures and writes `accuracy_curves.json`; at full size also into the package."""
    cases = list(drawn_cases(SEED[size], DRAWS[size]))
    errors, unknown = of_methods(cases, PHASES[size], SMOOTH_DRAWS[size])
    curves = {
        name: curve("m", WIDTHS, rows) if name == "smooth" else curve("rad", PHASES[size], rows)
        for name, rows in errors.items()
    }
    curves["settling"] = curve("um", SETTLING_UM, of_settling(cases))
    curves["band_step"] = curve("r/min", BAND_STEPS[size], of_bands(cases[: BAND_DRAWS[size]], BAND_STEPS[size]))
    content = {"draws": DRAWS[size], "draws_without_truth": unknown, "curves": curves}
    write_result("accuracy_curves", size, content, {}, folder)
    if size == "full" and folder == RESULTS:
        package = Path(camopt.verifier.__file__).parent / FILE
        write_json(package, content | {"written_by": "python -m experiments.accuracy_curves"})
    return content


if __name__ == "__main__":
    run_script(main, __doc__)
