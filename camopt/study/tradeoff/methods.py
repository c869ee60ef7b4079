"""Work-precision of every method on one revolution, alone and side by side (for `camopt tradeoff`).

Error is that of the first revolution from rest at the lowest and the highest listed speed; time is processor time per
revolution. Compilation and tables are in `setup_seconds`. `experiments.work_precision` has general solvers beside them.
"""

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from camopt import exact
from camopt.cam.lift import Lift
from camopt.scene import Scene
from camopt.scene.vibration import highest_rate
from camopt.study.measured_rows import REFERENCE, Measurement
from camopt.study.timing import timed
from camopt.study.tradeoff.case import RevolutionCase, valve_lift
from camopt.verifier.methods import METHOD_NAMES, dop853, houbolt, rkg, tmm

PHASES = {"small": (0.3,), "full": (0.6, 0.3, 0.1, 0.03)}
"""Step times highest rate [rad] of the fixed-step methods."""
EVENT_STEPS = {"small": (720,), "full": (360, 1440, 5760)}
CHORDS = {"small": (16,), "full": (8, 16, 32, 64, 128)}
"""Chords under each curved law, with which event-exact takes it."""
DOP853_STEPS = {"small": (), "full": (1440, 5760)}
REFERENCE_STEPS = 20_000
SIDE_BY_SIDE = 16
LOCATED = "DOP853, located"


def method_work(scene: Scene, cam: Lift, size: str) -> Iterator[Measurement]:
    """The measurements of all methods."""
    assert scene.operation is not None
    speeds = scene.operation.speeds_rpm
    cases = [RevolutionCase(scene, cam, s) for s in sorted({min(speeds), max(speeds)})]
    for case in cases[-1:] if size == "small" else cases:
        yield from _revolution(case, size)
    yield from _side_by_side(cases[-1], size)


def _revolution(case: RevolutionCase, size: str) -> Iterator[Measurement]:
    """One revolution by every method. The reference is event-exact at fine samples with its adjoint's gradient, or
    located DOP853 where laws are curved."""
    straight, full = case.train.straight, size == "full"
    name, prepare = (METHOD_NAMES["event"], exact.prepare) if straight else (LOCATED, dop853.prepare)

    def reference() -> dict:
        figures = case.figures(prepare(case.train, case.cam, case.cam_speed, REFERENCE_STEPS))
        return {"figures": {**figures, **({"gradient": exact_gradient(case)} if straight else {})}}

    def adjoint() -> dict:
        times, gradient = timed(lambda: exact_gradient(case))
        return {**times, "figures": {"gradient": gradient}}

    yield (case.name, REFERENCE, f"{name}, {REFERENCE_STEPS} samples"), reference
    if straight and full:
        yield (case.name, "event-exact, adjoint", "default step"), adjoint
    for method, setting, prepared in prepared_methods(case, size):
        yield (case.name, method, setting), lambda prepared=prepared: case.measured(prepared())
    if full:
        from camopt.study.tradeoff.smooth_path import smooth_work

        yield from smooth_work(case)


def exact_gradient(case: RevolutionCase) -> np.ndarray:
    """Seating velocity of the first revolution by every stiffness, times that stiffness [m/s], by the adjoint."""
    from camopt.exact.adjoint.motion import TracedMotion

    motion = TracedMotion(case.train, case.cam, case.cam_speed, case.rest, 1, mechanical=True)
    slopes = motion.gradient(("seating_velocity_m_per_s",)).by_train
    assert slopes is not None, "asked for by mechanical"
    return slopes.stiffness[0] * case.train.parameters["stiffness"]


def prepared_methods(case: RevolutionCase, size: str) -> Iterator[tuple[str, str, Callable]]:
    """(method, setting, what prepares it): event-exact, Runge-Kutta-Gill, both transition matrix methods, Houbolt,
    located DOP853."""
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


def _side_by_side(case: RevolutionCase, size: str) -> Iterator[Measurement]:
    """Many speeds just below the highest: lifts of all, time per revolution of one."""
    name, straight = f"{SIDE_BY_SIDE} speeds side by side up to {case.speed_rpm:g} r/min", case.train.straight
    cam_speeds = np.linspace(0.95, 1.0, SIDE_BY_SIDE) * case.cam_speed

    def loop(prepare: Callable, steps: int) -> dict:
        revolves = [prepare(case.train, case.cam, s, steps) for s in cam_speeds]
        times, lifts = timed(lambda: np.array([valve_lift(r(case.rest)) for r in revolves]), SIDE_BY_SIDE)
        return {**times, "figures": {"lift_mm": lifts}}

    truth = partial(loop, exact.prepare, REFERENCE_STEPS) if straight else partial(loop, dop853.prepare, 5760)
    yield (name, REFERENCE, "fine samples"), truth
    if straight:
        yield (name, METHOD_NAMES["event"], "1440 samples"), partial(loop, exact.prepare, 1440)
    for steps in (2880, 11_520):
        yield (name, METHOD_NAMES["rkg"], f"{steps} steps"), partial(loop, rkg.prepare, steps)
    if size == "full":
        from camopt.study.tradeoff.smooth_path import batch_work

        yield from batch_work(name, case, cam_speeds)
