"""What each dial of the job costs and what it gets wrong against its finest setting (for `camopt tradeoff`).

Errors of bounce are those of event-exact's largest bounce; seconds are processor time of the whole step of the job.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import numpy as np

from camopt.cam.design_file import design_record, read_design
from camopt.cam.lift import Lift
from camopt.exact import engine
from camopt.measure.settling import settle, settled_from_rest
from camopt.optimizer.accuracy import ACCURACIES, Accuracy
from camopt.scene import Scene, build_train
from camopt.scene.rest import state_at_rest
from camopt.scene.units import DEG, MM, UM
from camopt.storage import write_json
from camopt.study.measurements import REFERENCE, Measurement
from camopt.study.reduce.reduced_models import smaller_models
from camopt.study.reduce.reduction import Candidate, reduce
from camopt.verifier.at_speed import LIFT_NEIGHBOUR, SPEED_NEIGHBOUR, STATE_NEIGHBOUR

SETTLING_UM = {"small": (1.0, 1e-3), "full": (100.0, 10.0, 1.0, 0.1, 1e-3)}
BAND_STEPS = {"small": (200, 100), "full": (200, 100, 50, 20, 10, 5)}
SAMPLES = {"small": (2, 4), "full": (2, 6, 20, 100)}
KNOTS_DEG = (4.0, 3.0, 2.0, 1.5)
EFFORTS = "draft", "standard", "fine"
"""Settings of the dials, the finest last."""
JUDGED_STEP_RPM = 10


def job_work(scene: Scene, cam: Lift, size: str, folder: Path) -> Iterator[Measurement]:
    """The measurements of all dials; a design that one of them finds is kept in `folder`."""
    settled, band, perturbed = (partial(_bounce, partial(run, scene, cam)) for run in (_settled, _band, _perturbed))
    yield from _dial("settling tolerance", "event-exact, listed speeds", "{:g} um", settled, SETTLING_UM[size])
    yield from _dial("band step", "event-exact sweep", "{:g} r/min", band, BAND_STEPS[size])
    yield from _dial("perturbation samples", "event-exact, highest speed", "{:g} samples", perturbed, SAMPLES[size])
    yield from _masses(scene, cam, size)
    if size == "full":
        designed, designs = partial(_designed, scene), folder / "designs"
        knots = lambda deg: designed("nominal", replace(ACCURACIES["draft"], knot_deg=deg), designs)  # noqa: E731
        yield from _dial("knots", "search, listed speeds", "{:g} deg", knots, KNOTS_DEG)
        effort = lambda name: designed("band", ACCURACIES[name], designs)  # noqa: E731
        yield from _dial("search effort", "search, band", "{}", effort, EFFORTS)


def _dial(dial: str, method: str, shown: str, run: Callable, settings: Sequence) -> Iterator[Measurement]:
    """Settings of a dial; the last and finest is the reference."""
    for setting in settings:
        name = REFERENCE if setting == settings[-1] else method
        yield (f"job: {dial}", name, shown.format(setting)), partial(run, setting)


def _bounce(run: Callable, setting: float) -> dict:
    """The bounce that a step of the job finds at a setting, with its processor time."""
    begin = time.process_time()
    bounce = run(setting)
    return {"seconds": time.process_time() - begin, "figures": {"bounce_mm": bounce}}


def _settled(scene: Scene, cam: Lift, um: float) -> np.ndarray:
    """Bounce at each listed speed after settling to `um`."""
    train, bounces = build_train(scene), []
    assert scene.operation is not None
    for speed in scene.operation.speeds_rpm:
        revolve = engine.prepare(train, cam, scene.cam_speed(speed))
        settled = settle(revolve, state_at_rest(train), most=80, position=um * UM)
        bounces.append(settled.metrics(cam).worst("bounce_mm"))
    return np.array(bounces)


def _band(scene: Scene, cam: Lift, step: float) -> float:
    """Largest bounce of the band in steps of `step` r/min."""
    assert scene.operation is not None
    low, high = scene.operation.band_rpm
    return _largest_bounce(scene, cam, np.unique(np.append(np.arange(low, high, step), high)))


def _largest_bounce(scene: Scene, cam: Lift, speeds_rpm: Sequence[float] | np.ndarray) -> float:
    train, speeds = build_train(scene), map(scene.cam_speed, speeds_rpm)
    return max(settled_from_rest(engine.prepare, train, cam, s).metrics(cam).worst("bounce_mm") for s in speeds)


def _perturbed(scene: Scene, cam: Lift, count: int) -> float:
    """Largest bounce over `count` neighbouring speeds, lifts and states, those of the verdict, drawn uniformly."""
    rng, train = np.random.default_rng(0), build_train(scene)
    assert scene.operation is not None
    cam_speed, rest = scene.cam_speed(max(scene.operation.speeds_rpm)), state_at_rest(train)
    away = np.repeat(STATE_NEIGHBOUR, len(train.mass))
    bounces = []
    for _ in range(count):
        speed, height = 1 + SPEED_NEIGHBOUR * rng.uniform(-1, 1), 1 + LIFT_NEIGHBOUR / cam.max_lift * rng.uniform(-1, 1)
        near = replace(cam, coefficients=cam.coefficients * height)
        start = rest + away * rng.uniform(-1, 1, len(away))
        bounces.append(settle(engine.prepare(train, near, cam_speed * speed), start).metrics(near).worst("bounce_mm"))
    return max(bounces)


def _masses(scene: Scene, cam: Lift, size: str) -> Iterator[Measurement]:
    """Smaller models against the full one, from `reduce`; seconds: of a revolution, event-exact."""
    assert scene.operation is not None
    speeds = (min(scene.operation.speeds_rpm),) if size == "small" else None

    @cache
    def candidates() -> dict[str, Candidate]:
        found = reduce(scene, cam, speeds).candidates
        return {c.smaller.scene.name: c for c in found}

    def compared(name: str) -> dict:
        c = candidates()[name]
        errors = {k: c.error[k] for k in ("bounce_mm", "jump_mm", "lift_mm")}
        return {"seconds": c.ms["event"] / 1e3 if c.ms else None, "errors": errors, "failure": c.refusal}

    for model in (m.scene for m in smaller_models(scene)):
        key = "job: masses", "reduced model, event-exact", f"{len(model.mass)} masses ({model.name})"
        yield key, partial(compared, model.name)


def _designed(scene: Scene, speeds: str, effort: Accuracy, folder: Path) -> dict:
    """Area of the cam that a search finds and a verdict confirms, its bounce on a grid finer than the search's."""
    from camopt.optimizer.candidates import largest_confirmed
    from camopt.optimizer.search.search import find_cam

    begin = time.process_time()
    search = find_cam(scene, speeds, effort)
    seconds = time.process_time() - begin
    assert scene.operation is not None and scene.design is not None
    chosen = largest_confirmed(scene, search.confirmed, "nominal", ACCURACIES["draft"])
    folder.mkdir(exist_ok=True)
    path = folder / f"{speeds}-{effort.knot_deg:g}deg-{effort.judged_speeds}-speeds.json"
    write_json(path, design_record(chosen.cam.lift, scene.design.max_lift_mm * MM))
    cam = read_design(path, scene)
    listed = scene.operation.speeds_rpm
    bounce = _largest_bounce(scene, cam, listed) if speeds == "nominal" else _band(scene, cam, JUDGED_STEP_RPM)
    figures = {"area_mm_deg": cam.area / MM / DEG, "bounce_mm": bounce}
    return {"seconds": seconds, "figures": figures, "verdict": chosen.verdict.verdict}
