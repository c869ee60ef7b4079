"""Measurements of `camopt tradeoff`: work-precision of every method on a revolution, cost of each dial of the job.

The error of a method is that of the first revolution from rest at the lowest and the highest listed speed; its time is
processor time per revolution, with compilation and tables in `setup_seconds`. `experiments.work_precision` adds general
solvers, `experiments.tradeoff` gradients, single precision and many speeds side by side. A dial of the job is compared
with its finest setting: errors of bounce are those of event-exact's largest bounce, seconds are processor time of the
whole step of the job.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache, partial
from importlib import import_module
from pathlib import Path

import numpy as np

from camopt import exact
from camopt.cam.design_file import design_record, read_design
from camopt.cam.lift import Lift
from camopt.exact import engine
from camopt.measure.metrics import measure
from camopt.measure.settling import settle, settled_from_rest
from camopt.optimizer.accuracy import ACCURACIES, Accuracy
from camopt.scene import Response, Scene, build_train, state_at_rest
from camopt.scene.response import Revolve, record_of
from camopt.scene.units import DEG, MM, UM
from camopt.scene.vibration import highest_rate
from camopt.storage import write_json
from camopt.study.measurements import REFERENCE, Measurement, timed
from camopt.study.reduce.reduced_models import smaller_models
from camopt.study.reduce.reduction import Candidate, reduce
from camopt.study.simulate.accuracy_control import valve_position
from camopt.study.simulate.motion import TOLERANCE_OF_WIDTH
from camopt.verifier import ACCURACY_NAMES, DRAFT
from camopt.verifier.at_speed import LIFT_NEIGHBOUR, SPEED_NEIGHBOUR, STATE_NEIGHBOUR
from camopt.verifier.methods import METHOD_NAMES, dop853, houbolt, rkg, tmm

FIGURES = ("bounce_mm", "jump_mm", "seating_velocity_m_per_s")
ANGLES = 720
"""Number of angles of the revolution at which lifts are compared."""

PHASES = {"small": (0.3,), "full": (0.6, 0.3, 0.1, 0.03)}
"""Step times highest rate [rad] of the fixed-step methods."""
EVENT_STEPS = {"small": (720,), "full": (360, 1440, 5760)}
CHORDS = {"small": (16,), "full": (8, 16, 32, 64, 128)}
"""Numbers of chords of each curved law in event-exact."""
DOP853_STEPS = {"small": (), "full": (1440, 5760)}
REFERENCE_STEPS = 20_000
LOCATED = "DOP853, located"
SMOOTH_EPS = {"small": (), "full": (1e-6, 1e-7, 1e-8, 2e-9)}
"""Widths of the contact layer [m] of the smooth path on its refined grid."""
SETTLING_UM = {"small": (1.0, 1e-3), "full": (100.0, 10.0, 1.0, 0.1, 1e-3)}
BAND_STEPS = {"small": (200, 100), "full": (200, 100, 50, 20, 10, 5)}
SAMPLES = {"small": (2, 4), "full": (2, 6, 20, 100)}
KNOTS_DEG = (4.0, 3.0, 2.0, 1.5)
"""Settings of the dials, the finest last."""
JUDGED_STEP_RPM = 10


class RevolutionCase:
    """Train, cam and rest state at one crankshaft speed [r/min], and the metrics of a motion."""

    def __init__(self, scene: Scene, cam: Lift, speed_rpm: float):
        self.cam, self.speed_rpm = cam, speed_rpm
        self.train, self.cam_speed = build_train(scene), scene.cam_speed(speed_rpm)
        self.rest = state_at_rest(self.train)
        self.name = f"revolution at {speed_rpm:g} r/min"

    def two(self, revolve: Revolve) -> Response:
        """Two revolutions from rest, because the bounce of the first ends in the second."""
        return record_of(revolve, self.rest, 2)

    def figures(self, motion: Response) -> dict:
        """Bounce, jump and seating velocity of the first revolution, and its valve lift [mm]."""
        metrics = measure(motion, self.cam)
        return {**{name: metrics[name][0] for name in FIGURES}, "lift_mm": valve_lift(motion)}

    def measured(self, revolve: Revolve) -> dict:
        """The metrics with the times of a revolution, as a record."""
        times, motion = timed(lambda: self.two(revolve), 2)
        return {**times, "figures": self.figures(motion)}


def valve_lift(motion: Response) -> np.ndarray:
    """Valve position [mm] at ANGLES + 1 angles of the first revolution."""
    return valve_position(motion, 1, ANGLES) / MM


def method_work(scene: Scene, cam: Lift, size: str) -> Iterator[Measurement]:
    """The measurements of all methods. The reference, which is not timed, is event-exact with fine samples, or located
    DOP853 for curved laws."""
    speeds = sorted({*scene.required_operation.speeds_rpm})
    for speed in speeds[-1:] if size == "small" else sorted({speeds[0], speeds[-1]}):
        case = RevolutionCase(scene, cam, speed)
        yield reference(case)
        for method, setting, prepared in prepared_methods(case, size):
            yield (case.name, method, setting), lambda c=case, prepared=prepared: c.measured(prepared())


def reference(case: RevolutionCase) -> Measurement:
    """The reference metrics of a case."""
    name, prepare = (METHOD_NAMES["event"], exact.prepare) if case.train.straight else (LOCATED, dop853.prepare)
    prepared = partial(prepare, case.train, case.cam, case.cam_speed, REFERENCE_STEPS)
    key = case.name, REFERENCE, f"{name}, {REFERENCE_STEPS} samples"
    return key, lambda: {"figures": case.figures(case.two(prepared()))}


def prepared_methods(case: RevolutionCase, size: str) -> Iterator[tuple[str, str, Callable]]:
    """Method, setting and the function that prepares it, for event-exact, Runge-Kutta-Gill, both transition matrix
    methods, Houbolt, located DOP853, and the smooth path on its refined grid."""
    motion, event = (case.cam, case.cam_speed), METHOD_NAMES["event"]
    fixed = {METHOD_NAMES["rkg"]: rkg.prepare}
    if case.train.straight:
        for steps in EVENT_STEPS[size]:
            yield event, f"{steps} samples", partial(exact.prepare, case.train, *motion, steps)
        fixed |= {
            METHOD_NAMES["tmm"]: tmm.prepare,
            "transition matrix, exponential": partial(tmm.prepare, exponential=True),
            METHOD_NAMES["houbolt"]: houbolt.prepare,
        }
    else:
        for count in CHORDS[size]:
            yield event, f"{count} chords", lambda n=count: exact.prepare(exact.with_chords(case.train, n), *motion)
    for phase in PHASES[size]:
        steps = max(720, int(np.ceil(2 * np.pi * highest_rate(case.train) / case.cam_speed / phase)))
        for name, prepare in fixed.items():
            yield name, f"{steps} steps", partial(prepare, case.train, *motion, steps)
    for steps in DOP853_STEPS[size]:
        yield LOCATED, f"{steps} samples", partial(dop853.prepare, case.train, *motion, steps)
    for eps in SMOOTH_EPS[size]:
        dials = {"eps": eps, "tolerance": eps * TOLERANCE_OF_WIDTH}
        prepare = import_module("camopt.smooth.simulate").prepare
        yield "smooth, refined grid", f"eps {eps:g} m", partial(prepare, case.train, *motion, **dials)


def job_work(scene: Scene, cam: Lift, size: str, folder: Path) -> Iterator[Measurement]:
    """The measurements of all dials; the designs that they produce are stored in `folder`."""
    settled, band, perturbed = (partial(_bounce, partial(run, scene, cam)) for run in (_settled, _band, _perturbed))
    yield from _dial("settling tolerance", "event-exact, listed speeds", "{:g} um", settled, SETTLING_UM[size])
    yield from _dial("band step", "event-exact sweep", "{:g} r/min", band, BAND_STEPS[size])
    yield from _dial("perturbation samples", "event-exact, highest speed", "{:g} samples", perturbed, SAMPLES[size])
    yield from _masses(scene, cam, size)
    if size == "full":
        designs = folder / "designs"

        def by_knots(deg: float) -> dict:
            return _designed(scene, "nominal", replace(ACCURACIES[DRAFT], knot_deg=deg), designs)

        def by_effort(name: str) -> dict:
            return _designed(scene, "band", ACCURACIES[name], designs)

        yield from _dial("knots", "search, listed speeds", "{:g} deg", by_knots, KNOTS_DEG)
        yield from _dial("search effort", "search, band", "{}", by_effort, ACCURACY_NAMES)


def _dial(dial: str, method: str, shown: str, run: Callable, settings: Sequence) -> Iterator[Measurement]:
    """The measurements of a dial's settings; the last and finest is the reference."""
    for setting in settings:
        name = REFERENCE if setting == settings[-1] else method
        yield (f"job: {dial}", name, shown.format(setting)), partial(run, setting)


def _bounce(run: Callable, setting: float) -> dict:
    """The bounce by a step of the job at a setting, with its processor time."""
    begin = time.process_time()
    bounce = run(setting)
    return {"seconds": time.process_time() - begin, "figures": {"bounce_mm": bounce}}


def _settled(scene: Scene, cam: Lift, um: float) -> np.ndarray:
    """Bounce at each listed speed after settling to `um`."""
    train = build_train(scene)
    revolves = (engine.prepare(train, cam, scene.cam_speed(s)) for s in scene.required_operation.speeds_rpm)
    settled = (settle(revolve, state_at_rest(train), most=80, position=um * UM) for revolve in revolves)
    return np.array([motion.metrics(cam).worst("bounce_mm") for motion in settled])


def _band(scene: Scene, cam: Lift, step: float) -> float:
    """Largest bounce over the band in steps of `step` r/min."""
    low, high = scene.required_operation.band_rpm
    return _largest_bounce(scene, cam, np.unique(np.append(np.arange(low, high, step), high)))


def _largest_bounce(scene: Scene, cam: Lift, speeds_rpm: Sequence[float] | np.ndarray) -> float:
    train, speeds = build_train(scene), map(scene.cam_speed, speeds_rpm)
    return max(settled_from_rest(engine.prepare, train, cam, s).metrics(cam).worst("bounce_mm") for s in speeds)


def _perturbed(scene: Scene, cam: Lift, count: int) -> float:
    """Largest bounce over `count` neighbouring speeds, lifts and states of the verdict's size, drawn uniformly."""
    rng, train = np.random.default_rng(0), build_train(scene)
    cam_speed, rest = scene.cam_speed(max(scene.required_operation.speeds_rpm)), state_at_rest(train)
    away = np.repeat(STATE_NEIGHBOUR, len(train.mass))
    bounces = []
    for _ in range(count):
        speed, height = 1 + SPEED_NEIGHBOUR * rng.uniform(-1, 1), 1 + LIFT_NEIGHBOUR / cam.max_lift * rng.uniform(-1, 1)
        near = replace(cam, coefficients=cam.coefficients * height)
        start = rest + away * rng.uniform(-1, 1, len(away))
        bounces.append(settle(engine.prepare(train, near, cam_speed * speed), start).metrics(near).worst("bounce_mm"))
    return max(bounces)


def _masses(scene: Scene, cam: Lift, size: str) -> Iterator[Measurement]:
    """Smaller models against the full one, by `reduce`; seconds are those of an event-exact revolution."""
    speeds = (min(scene.required_operation.speeds_rpm),) if size == "small" else None

    @cache
    def candidates() -> dict[str, Candidate]:
        return {c.smaller.scene.name: c for c in reduce(scene, cam, speeds).candidates}

    def compared(name: str) -> dict:
        c = candidates()[name]
        errors = {k: c.error[k] for k in ("bounce_mm", "jump_mm", "lift_mm")}
        return {"seconds": c.ms["event"] / 1e3 if c.ms else None, "errors": errors, "failure": c.refusal}

    for model in (m.scene for m in smaller_models(scene)):
        key = "job: masses", "reduced model, event-exact", f"{len(model.mass)} masses ({model.name})"
        yield key, partial(compared, model.name)


def _designed(scene: Scene, speeds: str, effort: Accuracy, folder: Path) -> dict:
    """Area of the cam that a search finds and a verdict confirms, its bounce on a finer grid than the search's."""
    from camopt.optimizer.candidates import largest_confirmed
    from camopt.optimizer.search.search import find_cam

    begin = time.process_time()
    search = find_cam(scene, speeds, effort)
    seconds = time.process_time() - begin
    chosen = largest_confirmed(scene, search.confirmed, "nominal", ACCURACIES[DRAFT])
    folder.mkdir(exist_ok=True)
    path = folder / f"{speeds}-{effort.knot_deg:g}deg-{effort.judged_speeds}-speeds.json"
    write_json(path, design_record(chosen.cam.lift, scene.required_design.max_lift_mm * MM))
    cam = read_design(path, scene)
    listed = scene.required_operation.speeds_rpm
    bounce = _largest_bounce(scene, cam, listed) if speeds == "nominal" else _band(scene, cam, JUDGED_STEP_RPM)
    figures = {"area_mm_deg": cam.area / MM / DEG, "bounce_mm": bounce}
    return {"seconds": seconds, "figures": figures, "verdict": chosen.verdict.verdict}
