"""Is a result as accurate as `--accuracy` asks, and is it flagged where it is not?

200 scenes, cams and speeds are drawn at random, each with a requested accuracy between 0.1 and 100 um. Computed are the
valve's position over two revolutions from rest by `simulate` (with event-exact, and with a fixed-step method chosen at
random), and the settled bounce by `verify`. An answer that is not flagged is a promise, which is kept if the true error
is at most what was requested. The reference is event-exact with finer samples, in some cases compared with DOP853 with
located switchings. It has an uncertainty of its own: the difference of two such answers, and the range of a motion that
never repeats. An answer is good if its error plus this uncertainty is within what was requested, and off if the error
less the uncertainty is not; between the two there is no reference and the answer must be flagged.
"""

import math
import time
from collections import Counter
from itertools import islice

import numpy as np

from camopt.exact import engine
from camopt.measure.settling import settle
from camopt.scene import build_train
from camopt.scene.rest import state_at_rest
from camopt.scene.units import MM, UM
from camopt.study.simulate.accuracy_control import apart_um, valve_position
from camopt.study.simulate.motion import delivered, dialled
from camopt.verifier.accuracy import effort_of
from camopt.verifier.record import bounce_error_um
from camopt.verifier.verdict import verdict_on
from experiments.support.drawn_cases import DrawnCase, drawn_cases
from experiments.support.record import RESULTS, called, run_script, write_result

SEED = {"small": 25, "full": 20}
DRAWS = {"small": 3, "full": 200}
DOP853_EVERY = 10
REVOLUTIONS = 2
ASKED_UM = (0.1, 100.0)
TRUTH_PHASES = (0.02, 0.03)
TRUTH_SAMPLES = (9000, 11_000)
SETTLED = 1e-10
ALL = "all"


def lift_rows(case: DrawnCase, asked_um: float, step_method: str, dop853: bool) -> list[dict]:
    """Rows of `simulate` by event-exact and by another method."""
    train, cam_speed = build_train(case.scene), case.scene.cam_speed(case.speed_rpm)
    event = dialled(train, case.lift, cam_speed, "event", REVOLUTIONS)
    truth, again = (valve_position(event(phase), REVOLUTIONS) for phase in TRUTH_PHASES)
    unknown_um = float(apart_um(truth, [again], REVOLUTIONS).max())
    rows = []
    for method in ("event", step_method):
        begin = time.perf_counter()
        answer = delivered(train, case.lift, cam_speed, method, REVOLUTIONS, asked_um)
        seconds = time.perf_counter() - begin
        true_um = float(apart_um(valve_position(answer.response, REVOLUTIONS), [truth], REVOLUTIONS).max())
        rows.append(row(f"lift, {method}", asked_um, float(answer.estimate_um.max()), true_um, unknown_um, seconds))
    if dop853:
        located = dialled(train, case.lift, cam_speed, "dop853", REVOLUTIONS)(0.1)
        rows[0]["truth_against_dop853_um"] = float(
            apart_um(valve_position(located, REVOLUTIONS), [truth], REVOLUTIONS).max()
        )
    return rows


def bounce_row(case: DrawnCase, asked_um: float) -> dict:
    """Row of `verify` by event-exact; the bounce of an aperiodic motion is uncertain by its range."""
    effort, train = effort_of(asked_um), build_train(case.scene)
    begin = time.perf_counter()
    verdict = verdict_on(case.scene, case.lift, (case.speed_rpm,), ("event",), None, effort.tolerances)
    seconds = time.perf_counter() - begin
    (speed,) = verdict.speeds
    bounces, spreads = [], []
    for samples in TRUTH_SAMPLES:
        revolve = engine.prepare(train, case.lift, case.scene.cam_speed(case.speed_rpm), samples)
        settled = settle(revolve, state_at_rest(train), most=200, position=SETTLED)
        figures = settled.metrics(case.lift)
        bounces.append(figures.worst("bounce_mm") * MM / UM)
        low, high = figures.range("bounce_mm")
        spreads.append(0.0 if settled.periodic else (high - low) * MM / UM)
    unknown = max(abs(bounces[0] - bounces[1]), *spreads)
    true = abs(speed.methods["event"].worst["bounce_mm"] * MM / UM - bounces[0])
    return row("bounce, event", asked_um, bounce_error_um(speed.as_dict()) or math.inf, true, unknown, seconds)


def row(quantity: str, requested: float, estimate: float, true: float, unknown: float, seconds: float) -> dict:
    """The row of one answer: its errors and its outcome."""
    flagged = not estimate <= requested
    # where an error is NaN neither comparison holds: there is no reference
    quality = "good" if true + unknown <= requested else "off" if true - unknown > requested else "no truth"
    outcome = f"{quality}, {'flagged' if flagged else 'promised'}"
    names = "quantity", "asked_um", "estimated_um", "true_um", "truth_unknown_um", "seconds", "outcome"
    return dict(zip(names, (quantity, requested, estimate, true, unknown, seconds, outcome), strict=True))


def counts(rows: list[dict]) -> dict[str, dict]:
    """By quantity and for all: outcomes, and the shares of promises kept and of good answers flagged."""
    by_quantity = {}
    for quantity in (*dict.fromkeys(r["quantity"] for r in rows), ALL):
        of = Counter(r["outcome"] for r in rows if quantity in (r["quantity"], ALL))
        promised = sum(n for outcome, n in of.items() if outcome.endswith("promised"))
        good = of["good, promised"] + of["good, flagged"]
        by_quantity[quantity] = dict(sorted(of.items())) | {
            "promises_kept_percent": 100 * of["good, promised"] / promised if promised else None,
            "good_ones_flagged_percent": 100 * of["good, flagged"] / good if good else None,
        }
    return by_quantity


def main(size: str, folder=RESULTS) -> dict:
    """Draws and evaluates the cases, counts, prints and writes `accuracy_promise.json`."""
    rng, cases = np.random.default_rng(SEED[size] + 1), []
    for number in range(DRAWS[size]):
        asked_um = float(10 ** rng.uniform(*np.log10(ASKED_UM)))
        cases.append({"number": number, "asked_um": asked_um, "other": str(rng.choice(("rkg", "tmm", "houbolt")))})
    results = called("experiments.accuracy_promise:judged", [{**case, "size": size} for case in cases], size)
    rows = [row for of in results for row in of["rows"]]
    located = [r for r in rows if "truth_against_dop853_um" in r and r["truth_unknown_um"] <= 0.5 * r["asked_um"]]
    content = {
        "draws": DRAWS[size],
        "counts": counts(rows),
        "truth_against_dop853_um": max((r["truth_against_dop853_um"] for r in located), default=None),
        "rows": [{k: float(f"{v:.4g}") if isinstance(v, float) else v for k, v in r.items()} for r in rows],
    }
    return write_result("accuracy_promise", size, content, {}, folder)


def judged(number: int, asked_um: float, other: str, size: str) -> dict:
    """The rows of the random case of a number."""
    case = next(islice(drawn_cases(SEED[size], DRAWS[size]), number, None))
    rows = [*lift_rows(case, asked_um, other, number % DOP853_EVERY == 0), bounce_row(case, asked_um)]
    where = {"scene": case.scene.name, "cam": case.cam_name, "speed_rpm": case.speed_rpm}
    return {"rows": [where | row for row in rows]}


if __name__ == "__main__":
    run_script(main, __doc__)
