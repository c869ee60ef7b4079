"""Work-precision of every method on one revolution, alone and side by side (for `camopt tradeoff`).

Error is that of the first revolution from rest at the lowest and the highest listed speed; time is processor time per
revolution. Compilation and tables are in `setup_seconds`. `experiments.work_precision` has general solvers beside them.
"""

from collections.abc import Callable
from functools import partial

import numpy as np

from camopt.cam.lift import Lift
from camopt.scene import Scene
from camopt.scene.vibration import highest_rate
from camopt.study.tradeoff.case import RevolutionCase, valve_lift
from camopt.study.tradeoff.measurement import REFERENCE, Measurement, timed
from camopt.verifier.methods import METHOD_NAMES, dop853, houbolt, rkg, tmm

PHASES = {"small": (0.3,), "full": (0.6, 0.3, 0.1, 0.03)}
"""Step times highest rate [rad] of the fixed-step methods."""
EVENT_STEPS = {"small": (720,), "full": (360, 1440, 5760)}
CHORDS = {"small": (16,), "full": (8, 16, 32, 64, 128)}
"""Chords under each curved law, with which event-exact takes it."""
REFERENCE_STEPS = 20_000
SIDE_BY_SIDE = 16


def method_work(scene: Scene, cam: Lift, size: str) -> list[Measurement]:
    """The measurements of all methods."""
    assert scene.operation is not None
    speeds = scene.operation.speeds_rpm
    cases = [RevolutionCase(scene, cam, s) for s in sorted({min(speeds), max(speeds)})]
    work: list[Measurement] = []
    for case in cases[-1:] if size == "small" else cases:
        work += [*_reference(case), *fixed_steps(case, size)]
        if size == "full":
            from camopt.study.tradeoff.smooth_path import smooth_work

            work += smooth_work(case)
    return work + _side_by_side(cases[-1], size)


def _event(case: RevolutionCase, steps: int | None):
    from camopt.exact import engine

    return engine.prepare(case.train, case.cam, case.cam_speed, steps)


def _chords(case: RevolutionCase, count: int):
    from camopt.exact import prepare, with_chords

    return prepare(with_chords(case.train, count), case.cam, case.cam_speed)


def _reference(case: RevolutionCase) -> list[Measurement]:
    """Event-exact at fine samples with its adjoint's gradient; located DOP853 where laws are curved."""
    straight = case.train.straight
    method = METHOD_NAMES["event"] if straight else "DOP853, located"

    def reference() -> dict:
        prepare = _event if straight else lambda c, steps: dop853.prepare(c.train, c.cam, c.cam_speed, steps)
        figures = case.figures(case.two(prepare(case, REFERENCE_STEPS)))
        return {"figures": {**figures, **({"gradient": exact_gradient(case)} if straight else {})}}

    return [Measurement(case.name, REFERENCE, f"{method}, {REFERENCE_STEPS} samples", reference)]


def exact_gradient(case: RevolutionCase) -> np.ndarray:
    """Seating velocity of the first revolution by every stiffness, times that stiffness [m/s], by the adjoint."""
    from camopt.exact.adjoint.motion import TracedMotion

    motion = TracedMotion(case.train, case.cam, case.cam_speed, case.rest, 1, mechanical=True)
    slopes = motion.gradient(("seating_velocity_m_per_s",)).by_train
    assert slopes is not None, "asked for by mechanical"
    return slopes.stiffness[0] * case.train.parameters["stiffness"]


def fixed_steps(case: RevolutionCase, size: str) -> list[Measurement]:
    """Event-exact, Runge-Kutta-Gill, both transition matrix methods, Houbolt, located DOP853."""
    arguments, work = (case.train, case.cam, case.cam_speed), []
    straight = case.train.straight

    def add(method: str, setting: str, prepare: Callable):
        def run() -> dict:
            revolve = prepare()
            return case.measured(lambda: case.two(revolve))

        work.append(Measurement(case.name, method, setting, run))

    for steps in EVENT_STEPS[size] if straight else ():
        add(METHOD_NAMES["event"], f"{steps} samples", partial(_event, case, steps))
    for count in () if straight else CHORDS[size]:
        add(METHOD_NAMES["event"], f"{count} chords", partial(_chords, case, count))
    if straight and size == "full":
        work.append(Measurement(case.name, "event-exact, adjoint", "default step", lambda: _timed_gradient(case)))
    methods = {METHOD_NAMES["rkg"]: rkg.prepare}
    if straight:
        methods |= {
            METHOD_NAMES["tmm"]: tmm.prepare,
            "transition matrix, exponential": partial(tmm.prepare, exponential=True),
            METHOD_NAMES["houbolt"]: houbolt.prepare,
        }
    for phase in PHASES[size]:
        steps = max(720, int(np.ceil(2 * np.pi * highest_rate(case.train) / case.cam_speed / phase)))
        for name, prepare in methods.items():
            add(name, f"{steps} steps", partial(prepare, *arguments, steps))
    if size == "full":
        for steps in (1440, 5760):
            add("DOP853, located", f"{steps} samples", partial(dop853.prepare, *arguments, steps))
    return work


def _timed_gradient(case: RevolutionCase) -> dict:
    times, gradient = timed(lambda: exact_gradient(case))
    return {**times, "figures": {"gradient": gradient}}


def _side_by_side(case: RevolutionCase, size: str) -> list[Measurement]:
    """Many speeds just below the highest: lifts of all, time per revolution of one."""
    name, straight = f"{SIDE_BY_SIDE} speeds side by side up to {case.speed_rpm:g} r/min", case.train.straight
    cam_speeds = np.linspace(0.95, 1.0, SIDE_BY_SIDE) * case.cam_speed

    def loop(prepare: Callable, steps: int) -> dict:
        revolves = [prepare(case.train, case.cam, s, steps) for s in cam_speeds]
        times, lifts = timed(lambda: np.array([valve_lift(r(case.rest)) for r in revolves]), SIDE_BY_SIDE)
        return {**times, "figures": {"lift_mm": lifts}}

    def exact(steps: int) -> dict:
        from camopt.exact import engine

        return loop(engine.prepare, steps)

    fixed = {s: partial(loop, rkg.prepare, s) for s in (2880, 11_520)}
    truth = partial(exact, REFERENCE_STEPS) if straight else partial(loop, dop853.prepare, 5760)
    work = [Measurement(name, REFERENCE, "fine samples", truth)]
    if straight:
        work.append(Measurement(name, METHOD_NAMES["event"], "1440 samples", partial(exact, 1440)))
    work += [Measurement(name, METHOD_NAMES["rkg"], f"{steps} steps", run) for steps, run in fixed.items()]
    if size == "full":
        from camopt.study.tradeoff.smooth_path import batch_work

        work += batch_work(name, case, cam_speeds)
    return work
