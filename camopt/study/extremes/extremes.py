"""`camopt extremes`: every method on extreme scenes, with a verdict each; a wrong value without a warning is a defect.

The motion is one revolution from rest with the scene's Polydyne, under the changes of `camopt.study.extremes.cases`.
The reference is event-exact (DOP853 for curved laws), each method halves its step until its metrics converge, and
`camopt.study.extremes.classification` compares them. The smooth methods, which alone import JAX, halve the width of the
contact layer and the permitted error instead of a step.
"""

import time
from collections.abc import Collection, Iterator, Sequence
from functools import cache, partial
from pathlib import Path

import numpy as np

from camopt import exact
from camopt.cam.families.polydyne import polydyne
from camopt.cam.lift import Lift
from camopt.scene import InputError, MotionRefused, Response, Scene, Train, build_train
from camopt.scene.response import Revolve
from camopt.storage import run_folder, run_identity, write_csv
from camopt.storage.journal import Records
from camopt.study.extremes.cases import AS_IT_IS, cases
from camopt.study.extremes.classification import (
    NOT_CONVERGED,
    RANGE,
    REFUSED,
    VERDICTS,
    WITHIN,
    WRONG,
    Truth,
    doubtful_figure,
    first_answer,
    judge,
    samples,
    truth,
)
from camopt.study.measurements import COLUMNS, LINES, Measurement, measured
from camopt.verifier.convergence import Prepare, first_steps
from camopt.verifier.methods import dop853, houbolt, rkg, tmm
from camopt.verifier.verdict import event_exact

STEP_METHODS: dict[str, Prepare] = {
    "rkg": rkg.prepare,
    "tmm": tmm.prepare,
    "tmm-exponential": partial(tmm.prepare, exponential=True),
    "houbolt": houbolt.prepare,
    "houbolt-explicit": partial(houbolt.prepare, explicit=True),
}
"""Methods with fixed steps, which do not locate switchings."""
LOCATING: dict[str, Prepare] = {"event": exact.prepare, "dop853": dop853.prepare}
"""Methods that locate every switching."""
DIAL = 1024
"""First setting of the smooth methods, in place of a number of steps; at four times DIAL they have their defaults."""
SINGLE_EPS, SINGLE_TOLERANCE = 1e-6, 1e-7
"""Width of the layer and permitted error [m] at four times DIAL in single precision, which rounds lifts to 1e-9 m."""


def smooth(train: Train, lift: Lift, cam_speed: float, dial: int, narrower: float = 1.0) -> Revolve:
    """The smooth path in double precision; the width of its layer and the permitted error are divided by `narrower`."""
    from camopt.smooth.simulate import EPS, TOLERANCE, prepare

    wide = 4 * DIAL / dial / narrower
    return prepare(train, lift, cam_speed, eps=wide * EPS, tolerance=max(wide, 1.0) * TOLERANCE)


def smooth_float32(train: Train, lift: Lift, cam_speed: float, dial: int) -> Revolve:
    """The smooth path in single precision. The revolution raises MotionRefused where no grid resolves the motion."""
    import jax.numpy as jnp

    from camopt.smooth.laws import Layer
    from camopt.smooth.scan import DrivenSystem
    from camopt.smooth.simulate import STEPS, compiled_response, lift_samples
    from camopt.smooth.system import build_system, stacked

    single, wide = jnp.float32, 4 * DIAL / dial
    samples = jnp.asarray(lift_samples(lift), single)
    driven = DrivenSystem(build_system(train, single), samples, single(cam_speed))
    eps, tolerance = (jnp.asarray(wide * q, single) for q in (SINGLE_EPS, SINGLE_TOLERANCE))

    def revolve(state: np.ndarray) -> Response:
        y0 = stacked(state, len(train.mass)).astype(single)
        motion = compiled_response(driven, y0, Layer(eps), tolerance, steps=4 * STEPS)
        angle, rise, x, v, force = (np.asarray(q, dtype=float) for q in motion[:5])
        memory = np.zeros((len(angle), 0)) if motion.memory is None else np.asarray(motion.memory, dtype=float)
        if not np.all(np.isfinite(x)):
            raise MotionRefused("smooth path in single precision: no grid of permitted steps resolves the motion")
        distinct = np.append(True, np.diff(angle) > 0)
        angle[-1] = np.pi  # pi rounded to single precision is larger
        return Response(train, cam_speed, *(q[distinct] for q in (angle, rise, x, v, force, memory)))

    return revolve


SMOOTH: dict[str, Prepare] = {"smooth": smooth, "smooth-float32": smooth_float32}

UNSTABLE = 32
"""Divisor that puts the first steps beyond every explicit method's stability limit, also after two halvings."""
NARROWER = {"eps 2e-13 m": 1e4, "eps 2e-18 m": 1e9, "eps zero": float("inf")}
"""Divisors of the width of the smooth contact layer, by label, for widths that tend to zero."""
DOP853_STEPS = 20_000
"""First number of steps per revolution above which a case leaves out DOP853, which would take minutes."""
REFERENCE = "event"


def extremes(
    scenes: Sequence[Scene],
    folder: str | Path,
    resume: bool = False,
    progress: bool = True,
    named: Collection[str] | None = None,
) -> list[dict]:
    """Runs all cases of `scenes` and writes `extremes.csv` into `folder`; returns its rows.

    With `named` only the cases of these names are run; with `resume` stored measurements are not repeated. Raises
    InputError for a folder that exists without `resume` or cannot be written.
    """
    with run_folder(folder, run_identity("extremes", scenes), resume, [LINES]) as run:
        chosen = [(s, *case) for s in scenes for case in cases(s) if named is None or case[0] in named]
        work = [measurement for case in chosen for measurement in _measurements(*case)]
        rows = measured(Records(run / LINES, "case", "method"), work, progress)
        write_csv(run / "extremes.csv", {name: [row[name] for row in rows] for name in COLUMNS})
    return rows


def _measurements(scene: Scene, case: str, changed: Scene) -> Iterator[Measurement]:
    """The measurements of one case at its highest listed speed, beginning with that of the reference.

    For curved laws DOP853 is the reference, and event-exact with chords is one of the methods judged.
    """
    train, cam_speed = build_train(changed), changed.cam_speed(max(changed.required_operation.speeds_rpm))
    motion = train, polydyne(scene), cam_speed

    @cache
    def true() -> Truth | InputError:
        try:
            return truth(LOCATING[REFERENCE if train.straight else "dop853"], *motion)
        except InputError as refusal:
            return refusal

    def row(unit: str, arguments: tuple | None) -> dict:
        begin = time.perf_counter()
        try:
            if isinstance(reference := true(), InputError):
                raise reference
            begin = begin if arguments is None else time.perf_counter()
            prepare, *dial = arguments or (None,)
            answer = reference.answer if prepare is None else first_answer(prepare, *motion, *dial)
        except InputError as refusal:
            record = {"setting": str(refusal), "error": None, "error_of": "", "seconds": 0.0}
            return record | {"converged": False, "verdict": REFUSED}
        verdict, name, error = judge(answer, reference)
        if prepare is None:  # the reference is judged by its own error estimate
            name, share = doubtful_figure(reference)
            verdict = WITHIN if share <= 1.0 else RANGE if reference.sensitive(name) else NOT_CONVERGED
            error = answer.error[name]
        stated = error if np.isfinite(error) else None if np.isnan(error) else str(error)
        setting, seconds = f"{answer.steps_per_revolution} {unit}", round(time.perf_counter() - begin, 3)
        record = {"setting": setting, "error": stated, "error_of": name, "seconds": seconds}
        return record | {"converged": answer.converged, "verdict": verdict}

    if train.straight:
        yield (f"{scene.name}: {case}", REFERENCE), partial(row, "samples", None)
    for label, method, *arguments in methods(case, train, cam_speed):
        unit = "dial" if method in SMOOTH else "steps"
        yield (f"{scene.name}: {label}", method), partial(row, unit, tuple(arguments))


def methods(case: str, train: Train, cam_speed: float) -> Iterator[tuple]:
    """The measurements of a case other than the reference: case, method, its `prepare`, and halvings and first steps
    where they differ from those of `first_answer`. The unchanged scene is also run with steps beyond the stability
    limit and with widths of the smooth contact layer that tend to zero."""
    first = first_steps(train, cam_speed)
    yield from ((case, *method) for method in STEP_METHODS.items())
    if not train.straight:
        yield case, REFERENCE, event_exact
    elif first <= DOP853_STEPS:
        yield case, "dop853", LOCATING["dop853"], 2, samples(first)
    if " + " not in case:
        yield from ((case, *method, 2, DIAL) for method in SMOOTH.items())
    if case == AS_IT_IS:
        yield from (("steps past the limit", *method, 2, -(-first // UNSTABLE)) for method in STEP_METHODS.items())
        yield from ((label, "smooth", partial(smooth, narrower=by), 2, DIAL) for label, by in NARROWER.items())


def defects(rows: list[dict]) -> list[dict]:
    """The rows with a wrong value without a warning."""
    return [r for r in rows if r["verdict"] == WRONG]


def counts(rows: list[dict]) -> dict[str, dict[str, int]]:
    """Number of rows by method and verdict."""
    by_method = {m: [r["verdict"] for r in rows if r["method"] == m] for m in dict.fromkeys(r["method"] for r in rows)}
    return {m: {v: verdicts.count(v) for v in VERDICTS if v in verdicts} for m, verdicts in by_method.items()}
