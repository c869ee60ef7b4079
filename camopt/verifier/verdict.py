"""The verdict on a cam in a scene: whether independent methods agree, and whether every limit of the scene holds.

This is the only file of the package that imports the event-exact method, and only when it is used.
"""

from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module

from camopt.cam.lift import Lift
from camopt.measure.limits import broken_by_shape, limited_metrics, motion_limits
from camopt.measure.resonance import resonances
from camopt.measure.rounded import rounding_sentence
from camopt.measure.sweep import (
    SEARCH_STEP_RPM,
    STARTS,
    STARTS_MM,
    Band,
    SettledMany,
    SpeedCache,
    first_exceeding,
    sweep,
)
from camopt.scene.errors import InputError
from camopt.scene.response import Revolve
from camopt.scene.schema import Scene
from camopt.scene.train import Train, build_train
from camopt.verifier import display
from camopt.verifier.at_speed import Case, SpeedVerdict, judge_speed
from camopt.verifier.convergence import WANDERING_REVOLUTIONS, Prepare, Tolerances, first_steps
from camopt.verifier.methods import INDEPENDENT, verdict_methods
from camopt.verifier.record import VerificationRecord, accuracy_record, band_record, outside_sentence
from camopt.verifier.spot_checks import (
    Verdicts,
    can_spot_check,
    early_rejection,
    event_alone,
    judge_all,
    spot_checked,
)

METHODS = ("event", "rkg", "tmm", "houbolt")
"""Methods for a train whose laws are piecewise linear; event-exact is the first."""
NONLINEAR_METHODS = ("event", "rkg", "dop853")
"""Methods for a train with curved laws of contacts or progressive springs, which event-exact replaces by chords."""
ROUNDS = 2
"""Rounds in which the worst speeds of a band are judged: judged metrics of erratic motions differ from the sweep's."""
TOLERANCES = Tolerances()
ORDER = ("confirmed", "sensitive", "not converged", "rejected")
"""Verdicts from best to worst. The verdict on the cam is the worst verdict of all judged speeds."""


@dataclass(frozen=True, repr=False)
class Verdict:
    """The verdict on a cam in a scene; `as_dict` gives the content of verification.json."""

    verdict: str
    broken: tuple[str, ...]
    speeds: tuple[SpeedVerdict, ...]
    band: Band | None  # the sweep, with the first method's metrics at the judged speeds
    worst_in_band: tuple[SpeedVerdict, ...]  # all methods at the worst speeds of the band
    first_jump_rpm: float | None
    first_bounce_rpm: float | None
    tolerance_um: float
    asked: str | float | None = None  # the requested accuracy, by name or in micrometres
    scene: Scene | None = None  # the judged scene, for the text and the figure
    cam: str = "cam"  # the cam's family, for the figure
    shape_says: str = ""  # how exactly a rounded table determines the shape; empty for other cams
    outside: tuple[dict, ...] = ()  # entries of outside.json at the listed speeds, if another engine was run

    @property
    def accuracy(self) -> dict:
        """The requested and the delivered accuracy: verification.json's "accuracy"."""
        return self.as_dict()["accuracy"]

    @property
    def reason(self) -> str:
        """Why the cam is not confirmed, as a sentence; empty for a confirmed one."""
        if not all(entry["agrees"] for entry in self.outside):
            return outside_sentence(self.outside)
        if self.verdict == "confirmed":
            return ""
        if self.verdict == "rejected":
            return f"The cam breaks {', '.join(self.broken)}."
        decisive = [s for s in (*self.speeds, *self.worst_in_band) if s.verdict == self.verdict]
        if self.verdict == "not converged":
            at = ", ".join(dict.fromkeys(f"{s.speed_rpm:g}" for s in decisive))
            return f"The methods do not agree, or have not converged, at {at} r/min."
        limits = ", ".join(dict.fromkeys(limit for s in decisive for limit in s.straddled))
        return f"At some neighbouring speeds, lifts or states the cam keeps and at others it breaks {limits}."

    def plot(self):
        """Bounce and jump against speed, with the scene's limits, as a matplotlib Figure."""
        assert self.scene is not None, "`verdict_on` gives it"
        return display.figure(self.as_dict(), self.scene, self.cam)

    def __repr__(self) -> str:
        speeds = ", ".join(f"{s.speed_rpm:g}" for s in self.speeds[:6]) + ", ..." * (len(self.speeds) > 6)
        return f"Verdict({self.verdict}, at {speeds} r/min{', and the band' * (self.band is not None)})"

    def __str__(self) -> str:
        return display.text(self.as_dict(), self.scene)

    def _repr_html_(self) -> str:
        return display.html(self.as_dict())

    def as_dict(self) -> VerificationRecord:
        """The content of verification.json: NaN becomes null; `band` is null if no band was swept."""
        speeds, worst = ([s.as_dict() for s in verdicts] for verdicts in (self.speeds, self.worst_in_band))
        requested_um = self.tolerance_um if self.asked is None or isinstance(self.asked, str) else float(self.asked)
        record = VerificationRecord(
            verdict=self.verdict,
            broken=list(self.broken),
            reason=self.reason,
            speeds=speeds,
            worst_in_band=worst,
            band=None if self.band is None else band_record(self.band),
            limits={key: getattr(self, key) for key in STARTS},
            accuracy=accuracy_record([*speeds, *worst], requested_um, self.asked),
            **({"shape_says": self.shape_says} if self.shape_says else {}),
        )
        return record.with_outside(self.outside)


def verdict_on(
    scene: Scene,
    lift: Lift,
    speeds_rpm: tuple[float, ...] | None = None,
    methods: tuple[str, ...] | None = None,
    band_step_rpm: float | None = 20.0,
    tolerances: Tolerances = TOLERANCES,
    to_the_end: bool = True,
    progress: bool = False,
) -> Verdict:
    """Judge a cam at `speeds_rpm` (crankshaft; the scene's by default) and over the scene's band.

    `methods` are "event" or names of INDEPENDENT, by default the first two for the scene's laws. The metrics and the
    neighbourhood are those of the first method. Agreement needs two methods: a single one ends as "not converged".

    The band is swept with event-exact in steps of `band_step_rpm` and at resonances between them; then all methods
    judge the worst speed of every limited metric, and the speeds inside the band at which bounce or jump starts to
    exceed the scene's limit (0.05 mm if it sets none). With None there are no band and no starting speeds.

    `tolerances` state when a method has converged and which speeds all methods judge; the limited metrics are the
    scene's. Without `to_the_end` a rejection ends the work early: all methods judge only that speed of `speeds_rpm`
    where a limit is exceeded most, and the band is swept in steps of at least SEARCH_STEP_RPM with at most
    WANDERING_REVOLUTIONS to settle. With `progress`, progress bars count the judged speeds. Raises InputError for a
    scene without valve, seat or operation, and for an unknown method.
    """
    if scene.operation is None or scene.seat is None:
        raise InputError(f"scene {scene.name!r}: a verdict needs valve, seat and [operation]")
    methods = _valid_methods(scene, methods)
    tolerances = replace(tolerances, limited=limited_metrics(scene.design))
    many = _settled_metrics() if methods[0] == "event" and build_train(scene).straight else None
    case = Case(scene, lift, {name: method_named(name) for name in methods}, tolerances, many, progress)
    spot_check = can_spot_check(case) and tolerances.spot_checks
    listed = [float(s) for s in (scene.operation.speeds_rpm if speeds_rpm is None else speeds_rpm)]
    at_speeds = _judged(case, listed, spot_check, to_the_end)
    band, worst, first = None, (), {"bounce_mm": None, "jump_mm": None}
    if band_step_rpm is not None:
        refined = to_the_end or all(s.verdict != "rejected" for s in at_speeds)
        step_rpm = band_step_rpm if refined else max(band_step_rpm, SEARCH_STEP_RPM)
        swept, first, suspects = _swept_band(scene, lift, step_rpm, refined, coarsely=spot_check)
        band, worst = _judged_band(case, swept, suspects if refined else [], at_speeds, spot_check)
    if spot_check:
        checked = spot_checked(case, (*at_speeds, *worst))
        at_speeds, worst = (tuple(checked.get(s.speed_rpm, s) for s in verdicts) for verdicts in (at_speeds, worst))
    shape = broken_by_shape(lift, scene.design)
    all_speeds = (*at_speeds, *worst)
    broken = dict.fromkeys([*shape, *(name for s in all_speeds for name in s.broken)])
    overall = max([*(s.verdict for s in all_speeds), "rejected" if shape else "confirmed"], key=ORDER.index)
    return Verdict(
        overall,
        tuple(broken),
        at_speeds,
        band,
        worst,
        first["jump_mm"],
        first["bounce_mm"],
        tolerances.tolerance_um,
        scene=scene,
        cam=lift.family,
        shape_says=rounding_sentence(lift),
    )


def _judged(case: Case, speeds_rpm: list[float], spot_check: bool, to_the_end: bool) -> Verdicts:
    """The verdicts at the listed crankshaft speeds [r/min]; with `spot_check`, by event-exact alone."""
    if (to_the_end and not spot_check) or not can_spot_check(case):
        return judge_all(judge_speed, case, speeds_rpm)
    alone = judge_all(event_alone, case, speeds_rpm)
    stopped = None if to_the_end else early_rejection(case, alone)
    return stopped or (alone if spot_check else judge_all(judge_speed, case, speeds_rpm))


def _judged_band(
    case: Case, swept: Band, suspects: list[float], at_speeds: Verdicts, spot_check: bool
) -> tuple[Band, Verdicts]:
    """The band with the first method's metrics at all judged speeds, and the verdicts at its worst speeds [r/min].

    All methods, or event-exact alone with `spot_check`, judge the `suspects` of the sweep and then the speeds that have
    become the worst ones of a limited metric. Without suspects no speed is judged, and no speed is judged twice.
    """
    by_speed, worst = {s.speed_rpm: s for s in at_speeds}, set()
    band = swept.with_judged(case.first, {rpm: s.first.worst for rpm, s in by_speed.items()})
    for _ in range(ROUNDS if suspects else 0):
        worst |= {*suspects}
        judged = judge_all(event_alone if spot_check else judge_speed, case, sorted(worst - by_speed.keys()))
        by_speed |= {s.speed_rpm: s for s in judged}
        band = swept.with_judged(case.first, {rpm: s.first.worst for rpm, s in by_speed.items()})
        suspects = [band.worst(name)[0] for name in case.tolerances.limited]
    return band, tuple(by_speed[rpm] for rpm in sorted(worst))


def _valid_methods(scene: Scene, methods: tuple[str, ...] | None) -> tuple[str, ...]:
    """The methods of a verdict, by default the first two for the scene's laws. Raises InputError for an unknown one."""
    names = methods_for(build_train(scene))[:2] if methods is None else methods
    valid = verdict_methods()
    if not names or (unknown := [m for m in names if m not in valid]):
        raise InputError(f"methods {names}: give names out of {', '.join(valid)}" + f"; not {unknown}" * bool(names))
    return names


def _swept_band(
    scene: Scene, lift: Lift, step_rpm: float, refined: bool, *, coarsely: bool
) -> tuple[Band, dict[str, float | None], list[float]]:
    """The swept band, the speeds at which bounce and jump start, and the speeds [r/min] that all methods must judge.

    The latter are the worst speed of every limited metric, and any start of a limited metric inside the band: the
    search for the starts may find a worse speed than the sweep.
    """
    many = _settled_metrics() if refined else partial(_settled_metrics(), most=WANDERING_REVOLUTIONS)
    swept, limited = SpeedCache(many, scene, lift), limited_metrics(scene.design)
    missed, left_out = resonances(scene, lift, step_rpm)
    sweep(swept, step_rpm, limited if refined else (), missed, coarsely=coarsely)
    limits = {limit.metric: limit.value for limit in motion_limits(scene.design).values()}
    starts = {metric: limits.get(metric, STARTS_MM) for metric in STARTS.values()}
    first = first_exceeding(swept, starts, max(SEARCH_STEP_RPM, step_rpm))
    band = replace(swept.band(step_rpm), resonances=tuple(missed), resonances_left_out=left_out, refined=refined)
    suspects = {band.worst(name)[0] for name in limited}
    for metric, speed in first.items():
        if metric in limited and speed is not None and band.from_rpm <= speed <= band.to_rpm:
            suspects.add(speed)
    return band, first, sorted(suspects)


def methods_for(train: Train) -> tuple[str, ...]:
    """Names of all methods that judge a train, the most accurate first."""
    return METHODS if train.straight else NONLINEAR_METHODS


def method_named(name: str) -> Prepare:
    """The `prepare` of one of `verdict_methods`; its module is imported only here."""
    return event_exact if name == "event" else import_module(INDEPENDENT[name]).prepare


def event_exact(train: Train, lift: Lift, cam_speed: float, steps_per_revolution: int) -> Revolve:
    """Event-exact as a verdict uses it: for curved laws, the number of chords grows with the square root of the steps.

    The force error of the chords falls with the square of their number. Halving the step therefore halves it, and the
    error estimate from halving includes it.
    """
    from camopt.exact import engine
    from camopt.exact.affine.lines import with_chords

    if not train.straight:
        train = with_chords(train, chords_at(train, cam_speed, steps_per_revolution))
    return engine.prepare(train, lift, cam_speed, steps_per_revolution)


def chords_at(train: Train, cam_speed: float, steps_per_revolution: int) -> int:
    """Number of chords by which event-exact replaces a curved law at some steps per revolution."""
    from camopt.exact.affine.lines import CHORDS

    return round(CHORDS * max(1.0, steps_per_revolution / first_steps(train, cam_speed)) ** 0.5)


def _settled_metrics() -> SettledMany:
    """The function that measures many of event-exact's motions together; curved laws have the default chords there."""
    from camopt.exact.settled import settled_metrics

    return settled_metrics
