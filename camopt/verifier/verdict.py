"""The verdict on a cam in a scene: do independent methods agree, and does every limit of the scene hold.

The only file of this package that reaches for the event-exact method, and only when it is asked for.
"""

from collections.abc import Callable, Collection
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from importlib import import_module

import numpy as np

from camopt.cam.lift import Lift
from camopt.measure.limits import broken_by_shape, limited_metrics, motion_limits
from camopt.measure.resonance import resonances
from camopt.measure.settling import SETTLED_POSITION
from camopt.measure.sweep import STARTS_MM, Band, SettledMany, Swept, first_exceeding, sweep
from camopt.scene.errors import InputError, MotionRefused
from camopt.scene.response import Revolve
from camopt.scene.rest import state_at_rest
from camopt.scene.schema import Scene
from camopt.scene.train import Train, build_train
from camopt.verifier.accuracy_statement import stated
from camopt.verifier.convergence import MARGIN, RELATIVE, Converged, Prepare, converge, first_steps, tolerances
from camopt.verifier.methods import INDEPENDENT, rkg
from camopt.verifier.neighbourhood import against_limits, neighbours
from camopt.verifier.record import speed_record, verification

METHODS = ("event", "rkg", "tmm", "houbolt")
"""Methods for a train whose laws are linear."""
NONLINEAR_METHODS = ("dop853", "rkg")
"""Methods for a train with other laws; DOP853 carries linear ones too."""
ROUNDS = 2
"""How often the worst speeds of a band are judged: where a motion is erratic the judged figure is not the sweep's, and
another speed is the worst then."""
SWEEP_REFINEMENT = 4
"""Runge-Kutta-Gill's steps in a sweep, as a multiple of the first ones: where its bounce is right to some um."""
ORDER = ("confirmed", "sensitive", "not converged", "rejected")
"""From best to worst: one speed at which a limit is surely broken rejects the cam, whatever the others say."""


@dataclass(frozen=True, repr=False)
class SpeedVerdict:
    """What the methods found at one speed, and what follows. Figures are the first method's."""

    speed_rpm: float
    verdict: str
    broken: tuple[str, ...]
    straddled: tuple[str, ...]  # limits that some of the neighbourhood keeps and some breaks
    ranges: dict[str, tuple[float, float]]  # of every metric, over measured revolutions and neighbours
    methods: dict[str, Converged]

    @property
    def bounce_range_mm(self) -> tuple[float, float]:
        """Smallest and largest bounce over measured revolutions and neighbours."""
        return self.ranges["bounce_mm"]

    def __repr__(self) -> str:
        return f"SpeedVerdict({self.speed_rpm:g} r/min: {self.verdict}, by {', '.join(self.methods)})"

    def as_dict(self) -> dict:
        """One record of `speeds` in verification.json."""
        return speed_record(self)


@dataclass(frozen=True, repr=False)
class Verdict:
    """The verdict on a cam in a scene; `as_dict` is the contract's verification.json."""

    verdict: str
    broken: tuple[str, ...]
    speeds: tuple[SpeedVerdict, ...]
    band: Band | None  # the sweep, with the first method's figures at the judged speeds
    worst_in_band: tuple[SpeedVerdict, ...]  # all methods at the worst speeds of the band
    first_jump_rpm: float | None
    first_bounce_rpm: float | None
    tolerance_um: float
    asked: str | float | None = None  # the accuracy by name or in micrometres, where there was one
    scene: Scene | None = None  # what was judged, and which cam: for the figure alone
    cam: str = "cam"

    @property
    def accuracy(self) -> dict:
        """What was asked and what was delivered: verification.json's "accuracy"."""
        return stated((*self.speeds, *self.worst_in_band), self.tolerance_um, self.asked)

    def plot(self):
        """Bounce and jump against speed, with the scene's limits, as a matplotlib Figure."""
        from camopt.verifier.display import figure

        return figure(self)

    def __repr__(self) -> str:
        speeds = ", ".join(f"{s.speed_rpm:g}" for s in self.speeds[:6]) + ", ..." * (len(self.speeds) > 6)
        return f"Verdict({self.verdict}, at {speeds} r/min{', and the band' * (self.band is not None)})"

    def __str__(self) -> str:
        from camopt.verifier.display import text

        return text(self)

    def _repr_html_(self) -> str:
        from camopt.verifier.display import html

        return html(self)

    def as_dict(self) -> dict:
        """verification.json: NaN becomes null; `band` is null where no band was swept."""
        return verification(self)


def verdict_on(
    scene: Scene,
    lift: Lift,
    speeds_rpm: tuple[float, ...] | None = None,
    methods: tuple[str, ...] | None = None,
    band_step_rpm: float | None = 20.0,
    tolerance_um: float = 2.0,
    halvings: int = 6,
    workers: int = 2,
    settled: float = SETTLED_POSITION,
) -> Verdict:
    """Judge a cam at `speeds_rpm` (crankshaft; the scene's by default) and over the scene's band.

    `methods` are "event" or names of INDEPENDENT, by default the first two for the scene's laws; the first one's
    figures are reported and its neighbourhood is searched; two at least are needed for an agreement, so a single
    method ends as "not converged". `band_step_rpm` None leaves the band and the starting speeds out; they are swept
    with event-exact (Runge-Kutta-Gill for nonlinear laws), also where a lightly damped mode resonates between its
    steps, and all methods look at the worst speed of every limited metric and at the starting speeds inside the band.
    Bounce and jump "start" where they exceed the scene's
    limit, or 0.05 mm where it sets none. `tolerance_um` [um]: by how much halving the step may still move bounce and
    jump. `settled` [m]: largest change of a position over a revolution of a settled motion. Raises InputError for a
    scene without valve or operation, or an unknown method.
    """
    if scene.operation is None or scene.seat is None:
        raise InputError(f"scene {scene.name!r}: a verdict needs valve, seat and [operation]")
    train = build_train(scene)
    methods = methods_for(train)[:2] if methods is None else methods
    known = ("event", *INDEPENDENT)
    if not methods or (unknown := [m for m in methods if m not in known]):
        raise InputError(
            f"methods {methods}: give names out of {', '.join(known)}" + f"; not {unknown}" * bool(methods)
        )

    def judge(speeds) -> tuple[SpeedVerdict, ...]:
        with ThreadPoolExecutor(workers) as pool:
            jobs = [
                pool.submit(_judge_speed, scene, lift, float(s), methods, tolerance_um, halvings, settled)
                for s in speeds
            ]
            return tuple(job.result() for job in jobs)

    at_speeds = judge(scene.operation.speeds_rpm if speeds_rpm is None else speeds_rpm)
    band, worst, first = None, (), {"bounce_mm": None, "jump_mm": None}
    if band_step_rpm is not None:
        band, first, suspects = _swept_band(scene, lift, train, band_step_rpm, workers)
        swept = band
        for _ in range(ROUNDS):
            worst += judge(s for s in suspects if s not in [w.speed_rpm for w in worst])
            judged = {s.speed_rpm: s.methods[methods[0]].worst for s in (*at_speeds, *worst)}
            band = swept.with_judged(methods[0], judged)
            suspects = [band.worst(name)[0] for name in limited_metrics(scene.design)]
        worst = tuple(sorted(worst, key=lambda s: s.speed_rpm))
    shape = broken_by_shape(lift, scene.design)
    every = (*at_speeds, *worst)
    broken = dict.fromkeys([*shape, *(name for s in every for name in s.broken)])
    overall = max([*(s.verdict for s in every), "rejected" if shape else "confirmed"], key=ORDER.index)
    starts = first["jump_mm"], first["bounce_mm"]
    return Verdict(overall, tuple(broken), at_speeds, band, worst, *starts, tolerance_um, scene=scene, cam=lift.family)


def _swept_band(
    scene: Scene, lift: Lift, train: Train, step_rpm: float, workers: int
) -> tuple[Band, dict[str, float | None], list[float]]:
    """The swept band, where bounce and jump start, and the speeds [r/min] that all methods must look at.

    These are the worst speed of every limited metric and a start that lies inside the band although the metric is
    limited: what a search of its own has found may not be left out.
    """
    swept = Swept(_sweeping(train), scene, lift, workers, *_at_once(train))
    limited = limited_metrics(scene.design)
    found, left_out = resonances(scene, lift, step_rpm)
    sweep(swept, step_rpm, limited, found)
    first = first_exceeding(swept, _starts(scene))
    band = replace(swept.band(step_rpm), resonances=tuple(found), resonances_left_out=left_out)
    suspects = {band.worst(name)[0] for name in limited}
    for metric, speed in first.items():
        if metric in limited and speed is not None and band.from_rpm <= speed <= band.to_rpm:
            suspects.add(speed)
    return band, first, sorted(suspects)


def methods_for(train: Train) -> tuple[str, ...]:
    """Names of all methods that judge a train, the most accurate first."""
    return METHODS if train.laws is None else NONLINEAR_METHODS


def _method(name: str) -> Prepare:
    """A method's `prepare`; event-exact is imported on demand."""
    if name == "event":
        from camopt.exact import engine

        return engine.prepare
    return import_module(INDEPENDENT[name]).prepare


def _at_once(train: Train) -> tuple[str, SettledMany | None]:
    """The name of the method of sweeps, and what measures many of its motions together, if anything does."""
    if train.laws is None:
        from camopt.exact.settled import settled_metrics

        return "event", settled_metrics
    return "rkg", None


def _sweeping(train: Train) -> Callable[[Train, Lift, float], Revolve]:
    """The method of sweeps: event-exact at its own step, the same at all speeds, unless laws are nonlinear."""
    if train.laws is None:
        from camopt.exact import engine

        return engine.prepare
    return lambda train, lift, cam_speed: rkg.prepare(
        train, lift, cam_speed, SWEEP_REFINEMENT * first_steps(train, cam_speed)
    )


def _starts(scene: Scene) -> dict[str, float]:
    given = {limit.metric: limit.value for limit in motion_limits(scene.design).values()}
    return {name: given.get(name, STARTS_MM) for name in ("bounce_mm", "jump_mm")}


def _judge_speed(scene, lift, speed_rpm, methods, tolerance_um, halvings, settled) -> SpeedVerdict:
    train, cam_speed = build_train(scene), scene.cam_speed(speed_rpm)
    rest = state_at_rest(train)
    limited = limited_metrics(scene.design)
    answers = {
        m: converge(
            _method(m),
            train,
            lift,
            cam_speed,
            rest,
            tolerance_um,
            halvings,
            settled,
            limited=limited,
            certain=m == methods[0],
        )
        for m in methods
    }
    first = answers[methods[0]]
    if first.state is None:
        return SpeedVerdict(speed_rpm, "not converged", (), (), first.range, answers)
    try:
        near = neighbours(_method(methods[0]), train, lift, cam_speed, first)
    except MotionRefused:
        return SpeedVerdict(speed_rpm, "not converged", (), (), first.range, answers)
    broken, straddled = against_limits(scene, speed_rpm, first, near)
    ranges = {}
    for name, own in first.range.items():
        every = np.array([own, *(f.range(name) for f in near)])
        ranges[name] = float(every.min()), float(every.max())
    if not agreement(list(answers.values()), tolerance_um, limited):
        return SpeedVerdict(speed_rpm, "not converged", (), straddled, ranges, answers)
    verdict = "rejected" if broken else "sensitive" if straddled else "confirmed"
    return SpeedVerdict(speed_rpm, verdict, broken, straddled, ranges, answers)


def agreement(answers: list[Converged], tolerance_um: float, limited: Collection[str] = ()) -> bool:
    """Whether two methods or more have converged and their deciding figures overlap within range and error estimate.

    Half of what a halved step was allowed to change is the least error of a figure: then two exact answers still agree
    when they differ by what either may move. Changes across contacts are erratic and can be small by chance.
    """
    if len(answers) < 2 or not all(a.converged for a in answers):
        return False
    for name, tolerance in tolerances(tolerance_um, limited).items():
        seated = [not np.isnan(a.worst[name]) for a in answers]
        if not any(seated):
            continue
        if not all(seated):
            return False
        least = [0.5 * (tolerance + RELATIVE * abs(a.worst[name])) for a in answers]
        errors = [max(a.error[name] / MARGIN, e) for a, e in zip(answers, least, strict=True)]  # what halving moved
        lows = [a.range[name][0] - error for a, error in zip(answers, errors, strict=True)]
        highs = [a.range[name][1] + error for a, error in zip(answers, errors, strict=True)]
        if max(lows) > min(highs):
            return False
    return True
