"""Work-precision of every method on one revolution (for `camopt tradeoff`).

Error is that of the first revolution from rest at the lowest and the highest listed speed; time is processor time per
revolution. Compilation and tables are in `setup_seconds`. `experiments.work_precision` has general solvers beside them,
`experiments.tradeoff` gradients, single precision and many speeds side by side.
"""

from collections.abc import Callable, Iterator
from functools import partial
from importlib import import_module

import numpy as np

from camopt import exact
from camopt.cam.lift import Lift
from camopt.measure.metrics import measure
from camopt.scene import Response, Scene, build_train, state_at_rest
from camopt.scene.response import end_state, joined
from camopt.scene.units import MM
from camopt.scene.vibration import highest_rate
from camopt.study.measurements import REFERENCE, Measurement, timed
from camopt.study.simulate.accuracy_control import valve_position
from camopt.verifier.methods import METHOD_NAMES, dop853, houbolt, rkg, tmm

FIGURES = ("bounce_mm", "jump_mm", "seating_velocity_m_per_s")
ANGLES = 720
"""Angles of the revolution at which lifts are compared."""

PHASES = {"small": (0.3,), "full": (0.6, 0.3, 0.1, 0.03)}
"""Step times highest rate [rad] of the fixed-step methods."""
EVENT_STEPS = {"small": (720,), "full": (360, 1440, 5760)}
CHORDS = {"small": (16,), "full": (8, 16, 32, 64, 128)}
"""Chords under each curved law, with which event-exact takes it."""
DOP853_STEPS = {"small": (), "full": (1440, 5760)}
REFERENCE_STEPS = 20_000
LOCATED = "DOP853, located"
SMOOTH_EPS = {"small": (), "full": (1e-6, 1e-7, 1e-8, 2e-9)}
"""Widths of the contact's layer [m], for the smooth path on its refined grid."""
TOLERANCE_OF_EPS = 5e-3


class RevolutionCase:
    """One crankshaft speed [r/min]: train, cam and rest state, and how figures are taken from a motion."""

    def __init__(self, scene: Scene, cam: Lift, speed_rpm: float):
        self.cam, self.speed_rpm = cam, speed_rpm
        self.train, self.cam_speed = build_train(scene), scene.cam_speed(speed_rpm)
        self.rest = state_at_rest(self.train)
        self.name = f"revolution at {speed_rpm:g} r/min"

    def two(self, revolve: Callable[[np.ndarray], Response]) -> Response:
        """Two revolutions from rest: the bounce of the first ends in the second."""
        first = revolve(self.rest)
        return joined([first, revolve(end_state(first))])

    def figures(self, motion: Response) -> dict:
        """Bounce, jump and seating velocity of the first revolution, and its valve lift [mm]."""
        metrics = measure(motion, self.cam)
        return {**{name: metrics[name][0] for name in FIGURES}, "lift_mm": valve_lift(motion)}

    def measured(self, revolve: Callable[[np.ndarray], Response]) -> dict:
        """The figures with the times of a revolution, as a record."""
        times, motion = timed(lambda: self.two(revolve), 2)
        return {**times, "figures": self.figures(motion)}


def valve_lift(motion: Response) -> np.ndarray:
    """Valve position at ANGLES + 1 angles of the first revolution [mm]."""
    return valve_position(motion, 1, ANGLES) / MM


def method_work(scene: Scene, cam: Lift, size: str) -> Iterator[Measurement]:
    """The measurements of all methods. The reference is event-exact at fine samples, or located DOP853 where laws are
    curved; it has no time of its own."""
    assert scene.operation is not None
    speeds = sorted({*scene.operation.speeds_rpm})
    for speed in speeds[-1:] if size == "small" else sorted({speeds[0], speeds[-1]}):
        case = RevolutionCase(scene, cam, speed)
        yield reference(case)
        for method, setting, prepared in prepared_methods(case, size):
            yield (case.name, method, setting), lambda c=case, prepared=prepared: c.measured(prepared())


def reference(case: RevolutionCase) -> Measurement:
    """The figures of a case as nearly true as they can be had."""
    name, prepare = (METHOD_NAMES["event"], exact.prepare) if case.train.straight else (LOCATED, dop853.prepare)
    prepared = partial(prepare, case.train, case.cam, case.cam_speed, REFERENCE_STEPS)
    key = case.name, REFERENCE, f"{name}, {REFERENCE_STEPS} samples"
    return key, lambda: {"figures": case.figures(case.two(prepared()))}


def prepared_methods(case: RevolutionCase, size: str) -> Iterator[tuple[str, str, Callable]]:
    """(method, setting, what prepares it): event-exact, Runge-Kutta-Gill, both transition matrix methods, Houbolt,
    located DOP853, the smooth path on its refined grid."""
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
        path, layer = import_module("camopt.smooth.simulate"), import_module("camopt.smooth.contact").Layer(eps)
        dials = {"layer": layer, "tolerance": eps * TOLERANCE_OF_EPS}
        yield "smooth, refined grid", f"eps {eps:g} m", partial(path.prepare, case.train, *motion, **dials)
