"""Is every motion that is called periodic really periodic, and does an aperiodic motion stay in its stated range for
400 revolutions?

Scenes and cams are random (experiments/support/drawn_cases.py), each at speeds near the lowest one at which it breaks a
limit on the motion. The statement about a motion is that of the event-exact method of a verdict: whether it is
periodic, and the range and error of every metric. The reference is event-exact over 400 further revolutions, from the
state at which the verdict's motion ended: the states, and the metrics of each revolution. A motion has settled if the
distance of its states a revolution apart tends to zero.
"""

import numpy as np

from camopt.cam.lift import Lift
from camopt.exact import prepare, settled_metrics
from camopt.exact.settled import ERRORS
from camopt.measure.limits import limited_metrics, motion_limits
from camopt.scene import Scene, build_train
from camopt.scene.rest import state_at_rest
from camopt.scene.settled import APERIODIC, SETTLED_POSITION, SETTLED_VELOCITY
from camopt.scene.train import Train
from camopt.verifier.at_speed import Case
from camopt.verifier.convergence import Converged, Tolerances
from camopt.verifier.methods import rkg
from camopt.verifier.spot_checks import event_alone
from camopt.verifier.verdict import event_exact
from experiments.support.drawn_cases import drawn_cases
from experiments.support.record import RESULTS, printed, run_script, write_result

CASES = {"small": 1, "full": 50}
REVOLUTIONS = {"small": 80, "full": 400}
ABOUT = 0.98, 1.02, 1.06, 1.12
"""Speeds as shares of the lowest one at which a limit is broken."""
LOOKED_AT = np.linspace(0.4, 1.6, 61)
"""Speeds, as shares of the band's top, at which limits are checked."""
REST, LAST = 1e-2, 20
"""Largest distance of the LAST states of a settled motion from those a revolution before, in tolerances of settling."""


def first_broken(scene: Scene, lift: Lift) -> float | None:
    """The lowest of the checked speeds [r/min] at which the settled motion breaks a limit, or None."""
    speeds = LOOKED_AT * scene.required_operation.band_rpm[1]
    metrics = settled_metrics([build_train(scene)], [lift], [scene.cam_speed(s) for s in speeds])
    shares = [limit.share(metrics.worst(limit.metric)[0, 0]) for limit in motion_limits(scene.design).values()]
    broken = np.flatnonzero(~(np.max(shares, axis=0) <= 1.0)) if shares else []
    return float(speeds[broken[0]]) if len(broken) else None


def event_answer(scene: Scene, lift: Lift, speed_rpm: float) -> Converged:
    """The event-exact answer of a verdict for the motion at a speed."""
    tolerances = Tolerances(limited=limited_metrics(scene.design))
    methods = {"event": event_exact, "rkg": rkg.prepare}
    return event_alone(Case(scene, lift, methods, tolerances, settled_metrics), speed_rpm).methods["event"]


def apart(train: Train, lift: Lift, cam_speed: float, state: np.ndarray, revolutions: int) -> np.ndarray:
    """Distances of the states a revolution apart, in the tolerances of settling."""
    revolve, n, distances = prepare(train, lift, cam_speed), len(train.mass), []
    units = np.repeat([SETTLED_POSITION, SETTLED_VELOCITY, SETTLED_POSITION], [n, n, len(state) - 2 * n])
    for _ in range(revolutions):
        before, state = state, revolve.advance(state, 1)
        distances.append(np.abs((state - before) / units).max())
    return np.array(distances)


def compared(scene: Scene, lift: Lift, speed_rpm: float, revolutions: int) -> dict:
    """The row of one speed: the verdict's statement, and the comparison with the further revolutions."""
    train, cam_speed = build_train(scene), scene.cam_speed(speed_rpm)
    answer = event_answer(scene, lift, speed_rpm)
    state = prepare(train, lift, cam_speed).advance(state_at_rest(train), answer.revolutions)
    how = {"most": 0, "measured": 1, "aperiodic": APERIODIC * (revolutions // APERIODIC)}  # measures all of them
    long = settled_metrics([train], [lift], [cam_speed], starts=state, workers=1, **how)
    left = {}
    for name in ERRORS:
        (low, high), doubt = answer.range[name], answer.doubt(name)
        beyond = max(low - long.lowest[name][0, 0, 0], long.highest[name][0, 0, 0] - high)
        seats = np.isfinite([low, high, beyond])
        left[name] = float(beyond / doubt) if seats.all() else 0.0 if not seats.any() else np.inf
    worst = max(left, key=lambda name: left[name])
    distances = apart(train, lift, cam_speed, state, revolutions)
    return {
        "speed_rpm": speed_rpm,
        "periodic": answer.periodic,
        "revolutions": answer.revolutions,
        "rests": bool(distances[-LAST:].max() < REST),
        "smallest_distance": float(distances.min()),
        "left_by": left[worst],  # in stated errors
        "metric": worst,
    }


def main(size: str, folder=RESULTS) -> dict:
    """Compares, prints and writes `wandering.json`."""
    rows = []
    for case in drawn_cases(0, 10**6):
        if len(rows) >= CASES[size] * len(ABOUT):
            break
        broken = first_broken(case.scene, case.lift)
        for share in ABOUT if broken is not None else ():
            row = {"scene": case.scene.name, "cam": case.cam_name}
            rows.append(printed(row | compared(case.scene, case.lift, share * broken, REVOLUTIONS[size])))
    content = {
        "revolutions": REVOLUTIONS[size],
        "pairs": len(rows),
        "called_periodic": sum(row["periodic"] for row in rows),
        "rest": sum(row["rests"] for row in rows),
        "falsely_periodic": sum(row["periodic"] and not row["rests"] for row in rows),
        "falsely_wandering": sum(row["rests"] and not row["periodic"] for row in rows),
        "within_tolerance_once": sum(not row["rests"] and row["smallest_distance"] < 1.0 for row in rows),
        "ranges_left": sum(row["left_by"] > 1.0 for row in rows),
        "furthest": max(row["left_by"] for row in rows),
        "rows": rows,
    }
    return write_result("wandering", size, content, {}, folder)


if __name__ == "__main__":
    run_script(main, __doc__)
