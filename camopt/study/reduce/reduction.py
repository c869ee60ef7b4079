"""Error and saving of every smaller model of a scene, and the cheapest model within a tolerance."""

import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from html import escape

import numpy as np

from camopt.cam.lift import Lift
from camopt.exact import engine
from camopt.measure.hermite import Hermite
from camopt.measure.settling import Settled, settle
from camopt.scene import InputError, MotionRefused, Scene, Train, build_train, state_at_rest
from camopt.scene.response import Revolve
from camopt.scene.text_file import scene_toml
from camopt.scene.units import DEG, MM
from camopt.study.measurements import fastest
from camopt.study.reduce.idle_contacts import LeftOut, idle_contacts, leave_out
from camopt.study.reduce.reduced_models import SmallerModel, smaller_models
from camopt.verifier.convergence import first_steps
from camopt.verifier.methods import rkg, tmm

REFINEMENT = 4
"""Runge-Kutta-Gill's steps for curved laws, as a multiple of the first ones: its bounce is then accurate to some um."""
COMPARED = ("bounce_mm", "jump_mm", "seating_velocity_m_per_s", "contact_force_max_N")
"""Metrics whose error is stated, beside that of the lift."""
WITHIN = ("bounce_mm", "jump_mm", "lift_mm")
"""Errors to which the tolerance applies."""
GRID = np.arange(-180.0, 180.0, 0.1) * DEG
REPEATS = 5


@dataclass(frozen=True)
class Candidate:
    """A smaller model against the full one: its largest error over the speeds, and the cost of a revolution."""

    smaller: SmallerModel
    model: LeftOut
    error: dict[str, float]  # COMPARED and lift_mm; NaN where one of the two motions never seats
    refusal: str  # reason why the model was refused, or ""
    operations: int  # multiplications per revolution at the top speed, equal on every machine
    ms: dict[str, float]  # processor time per revolution at the top speed, by path

    def within(self, tolerance_mm: float) -> bool:
        """Whether the errors of bounce, jump and lift are known and within the tolerance at every speed."""
        return not self.refusal and all(self.error[name] <= tolerance_mm for name in WITHIN)

    def as_dict(self) -> dict:
        return {
            "name": self.smaller.scene.name,
            "masses": len(self.smaller.scene.mass),
            "surge_masses": self.smaller.surge_masses,
            "condensed": list(self.smaller.condensed),
            "left_out": {"never_close": list(self.model.open), "never_open": list(self.model.closed)},
            "error": self.error,
            "refusal": self.refusal,
            "operations_per_revolution": self.operations,
            "ms_per_revolution": self.ms,
        }


@dataclass(frozen=True)
class Reduction:
    """The result of `reduce`; the first candidate is the full model, with idle contacts left out."""

    scene: Scene
    cam: str
    speeds_rpm: tuple[float, ...]
    aperiodic_rpm: dict[float, tuple[float, float]]  # ranges of bounce at speeds where the full model does not settle
    tolerance_mm: float
    full_ms: dict[str, float]
    candidates: tuple[Candidate, ...]

    @property
    def proposed(self) -> Candidate:
        """The candidate within the tolerance with the fewest counted operations; measured times are only reported."""
        allowed = [c for c in self.candidates if c.within(self.tolerance_mm)]
        return min(allowed, key=lambda c: c.operations, default=self.candidates[0])

    def _repr_html_(self) -> str:
        return f"<pre>{escape(chr(10).join(reduction_lines(self)))}</pre>"

    def as_dict(self) -> dict:
        """The content of `reduce --json`; the proposed scene as TOML keeps every contact, as none is monitored."""
        return {
            "scene": self.scene.name,
            "cam": self.cam,
            "speeds_rpm": list(self.speeds_rpm),
            "aperiodic": [
                {"speed_rpm": s, "bounce_low_mm": low, "bounce_high_mm": high}
                for s, (low, high) in self.aperiodic_rpm.items()
            ],
            "tolerance_mm": self.tolerance_mm,
            "full_ms_per_revolution": self.full_ms,
            "proposed": self.proposed.smaller.scene.name,
            "proposed_toml": scene_toml(self.proposed.smaller.scene),
            "models": [c.as_dict() for c in self.candidates],
        }


def reduce(
    scene: Scene,
    cam: Lift | None = None,
    speeds_rpm: Sequence[float] | None = None,
    *,
    tolerance_mm: float = 0.01,
    workers: int = 2,
) -> Reduction:
    """Smaller models of a scene, from all its masses down to one, compared with the full model for a cam.

    `cam` is by default the plain Polydyne, `speeds_rpm` (k) [crankshaft r/min] the scene's. A model is within the
    tolerance [mm] where bounce, jump, and lift at every angle of the settled motion differ by no more at any speed. The
    motion is event-exact, or that of Runge-Kutta-Gill under nonlinear laws. Contacts that never switch in the full
    model, except the seat and those between cam and valve, are left out and monitored. Raises InputError for a scene
    without valve or operation, or unusable numbers.
    """
    if scene.operation is None or scene.seat is None:
        raise InputError(f"scene {scene.name}: reduce needs valve, seat and [operation]")
    if not (np.isfinite(tolerance_mm) and tolerance_mm > 0):
        raise InputError(f"reduce: tolerance {tolerance_mm} mm: a number above 0 is needed")
    speeds = tuple(map(float, scene.operation.speeds_rpm if speeds_rpm is None else speeds_rpm))
    if not speeds or not all(np.isfinite(s) and s > 0 for s in speeds):
        raise InputError(f"reduce: speeds {list(speeds)}: crankshaft speeds above 0 r/min are needed")
    if cam is None:
        from camopt.cam.families.polydyne import polydyne

        cam = polydyne(scene)
    full = LeftOut(scene)
    truth = _settled(full, cam, speeds, workers)
    idle = idle_contacts([t.response for t in truth])
    keep = {end for e in scene.element if e.name in idle[0] | idle[1] for end in e.between} - {"ground"}
    rows = [_candidate(model, idle, cam, speeds, truth, workers) for model in smaller_models(scene, frozenset(keep))]
    ranges = {s: t.metrics(cam).range("bounce_mm") for s, t in zip(speeds, truth, strict=True) if not t.periodic}
    full_ms = path_times(full, build_train(scene), cam, scene.cam_speed(max(speeds)))
    return Reduction(scene, cam.family, speeds, ranges, tolerance_mm, full_ms, tuple(rows))


def reduction_lines(reduction: Reduction) -> list[str]:
    """The table of `camopt reduce`, its remarks on aperiodic speeds, and the proposed model."""
    paths = list(reduction.full_ms)
    speeds = ", ".join(f"{s:g}" for s in reduction.speeds_rpm)
    heads = ("bounce mm", "jump mm", "lift mm", "seating m/s", "peak N", "operations", *(f"{p} ms" for p in paths))
    lines = [
        f"{reduction.scene.name}, {reduction.cam}, {speeds} r/min: largest error against the full model; "
        f"counted operations and measured ms per revolution",
        f"{'model':<24}" + "".join(f"{h:>12}" for h in heads),
    ]
    for candidate in reduction.candidates:
        values = [*(candidate.error[k] for k in (*WITHIN, *COMPARED[2:])), candidate.operations, *candidate.ms.values()]
        cells = f"  refused: {candidate.refusal}" if candidate.refusal else "".join(f"{v:12.4g}" for v in values)
        lines.append(f"{candidate.smaller.scene.name:<24}{cells}" + " <" * (candidate is reduction.proposed))
    for speed, (low, high) in reduction.aperiodic_rpm.items():
        lines.append(
            f"at {speed:g} r/min the full model itself does not repeat (bounce {low:.4f} to {high:.4f} mm): its errors "
            f"there are those of one motion of many; --speeds can leave it out"
        )
    best = reduction.proposed
    if not best.within(reduction.tolerance_mm) or not best.ms:
        return [*lines, f"no model is within {reduction.tolerance_mm:g} mm: the full one is needed"]
    speedups = ", ".join(f"{path} {reduction.full_ms[path] / ms:.2f}" for path, ms in best.ms.items())
    lines.append(f"proposed: {best.smaller.scene.name} ({best.smaller.done}), within {reduction.tolerance_mm:g} mm")
    lines.append(f"times as fast as the full model: {speedups}")
    omitted = [*(f"{n} (never closes)" for n in best.model.open), *(f"{n} (never opens)" for n in best.model.closed)]
    return [*lines, f"left out and watched: {', '.join(omitted)}"] if omitted else lines


def _candidate(smaller: SmallerModel, idle, cam: Lift, speeds, truth: list[Settled], workers: int) -> Candidate:
    model = leave_out(smaller.scene, *idle)
    train, cam_speed = build_train(model.scene), model.scene.cam_speed(max(speeds))
    # a step costs (2n)^2 multiplications for the propagator and two per element
    operations = first_steps(train, cam_speed) * ((2 * len(train.mass)) ** 2 + 2 * len(train.a))
    try:
        pairs = list(zip(_settled(model, cam, speeds, workers), truth, strict=True))
        ms = path_times(model, train, cam, cam_speed)
    except MotionRefused as refusal:
        return Candidate(smaller, model, dict.fromkeys((*COMPARED, "lift_mm"), np.nan), str(refusal), operations, {})
    metrics = [(motion.metrics(cam), reference.metrics(cam)) for motion, reference in pairs]
    error = {name: float(np.max([abs(a.worst(name) - b.worst(name)) for a, b in metrics])) for name in COMPARED}
    error["lift_mm"] = max(float(np.abs(_lift(motion) - _lift(reference)).max()) for motion, reference in pairs) / MM
    return Candidate(smaller, model, error, "", operations, ms)


def _settled(model: LeftOut, cam: Lift, speeds: Sequence[float], workers: int) -> list[Settled]:
    """The settled motion of a model at each speed [r/min], in threads with a train each: event-exact, or
    Runge-Kutta-Gill at the step of the verifier's sweeps under nonlinear laws."""

    def at(speed: float) -> Settled:
        train, cam_speed = build_train(model.scene), model.scene.cam_speed(speed)
        method, steps = (engine, ()) if train.straight else (rkg, (REFINEMENT * first_steps(train, cam_speed),))
        return settle(model.prepare(method.prepare, train, cam, cam_speed, *steps), state_at_rest(train))

    with ThreadPoolExecutor(workers) as pool:
        return list(pool.map(at, speeds))


def _lift(settled: Settled) -> np.ndarray:
    """The valve's distance from its seat on `GRID` [m]."""
    response = settled.response
    velocity = response.v[:, response.train.valve] / response.cam_speed
    return np.maximum(0.0, Hermite(response.angle, response.seat_separation(), velocity)(GRID))


def path_times(model: LeftOut, train: Train, cam: Lift, cam_speed: float) -> dict[str, float]:
    """Processor time [ms] of the first sampled revolution from rest, for each path that supports the scene's laws."""
    steps, rest = first_steps(train, cam_speed), state_at_rest(train)
    paths: dict[str, Revolve] = {"rkg": model.prepare(rkg.prepare, train, cam, cam_speed, steps)}
    if train.straight:
        paths = {"event": model.prepare(engine.prepare, train, cam, cam_speed)} | paths
        paths["tmm"] = model.prepare(tmm.prepare, train, cam, cam_speed, steps)
    return {name: milliseconds(lambda r=revolve: r(rest)) for name, revolve in paths.items()}


def milliseconds(run: Callable, repeats: int = REPEATS) -> float:
    """Least processor time of a call in this thread [ms], after one call that compiles and builds tables."""
    # where processor time is limited, the clock of the whole process ticks too coarsely for one revolution
    return 1e3 * float(fastest(run, repeats, time.thread_time)[0])
