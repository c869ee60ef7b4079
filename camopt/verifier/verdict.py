"""The verdict on a cam in a scene: do independent methods agree, and does every limit of the scene hold.

The only file of this package that reaches for the event-exact method, and only when it is asked for.
"""

from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module

from camopt.cam.lift import Lift
from camopt.measure.limits import broken_by_shape, limited_metrics, motion_limits
from camopt.measure.reserve import STARTS
from camopt.measure.resonance import resonances
from camopt.measure.rounded import rounding_sentence
from camopt.measure.sweep import SEARCH_STEP_RPM, STARTS_MM, Band, SettledMany, Swept, first_exceeding, sweep
from camopt.scene.errors import InputError
from camopt.scene.response import Revolve
from camopt.scene.schema import Scene
from camopt.scene.train import Train, build_train
from camopt.verifier.accuracy_statement import stated, who_looked
from camopt.verifier.at_speed import Case, SpeedVerdict, judge_speed
from camopt.verifier.convergence import WANDERING_REVOLUTIONS, Demand, Prepare, first_steps
from camopt.verifier.methods import INDEPENDENT, verdict_methods
from camopt.verifier.outside_speeds import OutsideSpeed
from camopt.verifier.record import verification, why_not_confirmed
from camopt.verifier.spot_checks import WORKERS, Verdicts, allows, at_every, event_alone, spot_checked, until_broken

METHODS = ("event", "rkg", "tmm", "houbolt")
"""Methods for a train whose laws are straight lines in pieces; of which event-exact is the first."""
NONLINEAR_METHODS = ("event", "rkg", "dop853")
"""Methods for a train with Hertz or progressive laws, in whose place event-exact has chords."""
ROUNDS = 2
"""How often the worst speeds of a band are judged: where a motion is erratic the judged figure is not the sweep's, and
another speed is the worst then."""
DEMAND = Demand()
"""What a verdict asks of every method, where nothing else is said."""
ORDER = ("confirmed", "sensitive", "not converged", "rejected")
"""From best to worst: one speed at which a limit is surely broken rejects the cam, whatever the others say."""


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
    shape_says: str = ""  # how exactly a rounded table tells the shape; empty for other cams
    outside: tuple[OutsideSpeed, ...] = ()  # what a judge from outside says at the listed speeds, where it was asked

    @property
    def accuracy(self) -> dict:
        """What was asked and what was delivered: verification.json's "accuracy"."""
        every = *self.speeds, *self.worst_in_band
        asked_um = self.tolerance_um if self.asked is None or isinstance(self.asked, str) else float(self.asked)
        found = stated(every, asked_um, self.asked)
        return found | {"statement": found["statement"] + who_looked(every)}

    @property
    def reason(self) -> str:
        """Why the cam is not confirmed, as a sentence; empty for a confirmed one."""
        return why_not_confirmed(self)

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
    demand: Demand = DEMAND,
    to_the_end: bool = True,
    progress: bool = False,
) -> Verdict:
    """Judge a cam at `speeds_rpm` (crankshaft; the scene's by default) and over the scene's band.

    `methods` are "event" or names of INDEPENDENT, by default the first two for the scene's laws; the first one's
    figures are reported and its neighbourhood is searched; two at least are needed for an agreement, so a single
    method ends as "not converged". `band_step_rpm` None leaves the band and the starting speeds out; they are swept
    with event-exact, also where a lightly damped mode resonates between its steps, and all methods look at the worst
    speed of every limited metric and at the starting speeds inside the band. Bounce and jump "start" where they exceed
    the scene's limit, or 0.05 mm where it sets none. `demand` says how far every method is asked to go, and whether
    all of them look at every speed; its limited metrics are the scene's. Without `to_the_end` a cam is rejected as
    soon as the answer stands: all methods look at the one speed of `speeds_rpm` where it is broken far beyond a limit,
    and the band is swept in steps of at least SEARCH_STEP_RPM, with WANDERING_REVOLUTIONS at most to settle. With
    `progress` bars count the speeds that have been judged. Raises InputError for a scene without valve or operation, or
    an unknown method.
    """
    if scene.operation is None or scene.seat is None:
        raise InputError(f"scene {scene.name!r}: a verdict needs valve, seat and [operation]")
    methods = _known_methods(scene, methods)
    demand = replace(demand, limited=limited_metrics(scene.design))
    many = _settled_metrics() if methods[0] == "event" and build_train(scene).straight else None
    case = Case(scene, lift, {name: method_named(name) for name in methods}, demand, many, progress)
    few = allows(case) and not demand.everywhere
    listed = [float(s) for s in (scene.operation.speeds_rpm if speeds_rpm is None else speeds_rpm)]
    at_speeds = _judged(case, listed, few, to_the_end)
    band, worst, first = None, (), {"bounce_mm": None, "jump_mm": None}
    if band_step_rpm is not None:
        refined = to_the_end or all(s.verdict != "rejected" for s in at_speeds)
        step_rpm = band_step_rpm if refined else max(band_step_rpm, SEARCH_STEP_RPM)
        swept, first, suspects = _swept_band(scene, lift, step_rpm, refined, coarsely=few)
        band, worst = _judged_band(case, swept, suspects if refined else [], at_speeds, few)
    if few:
        checked = spot_checked(case, (*at_speeds, *worst))
        at_speeds, worst = (tuple(checked.get(s.speed_rpm, s) for s in some) for some in (at_speeds, worst))
    shape = broken_by_shape(lift, scene.design)
    every = (*at_speeds, *worst)
    broken = dict.fromkeys([*shape, *(name for s in every for name in s.broken)])
    overall = max([*(s.verdict for s in every), "rejected" if shape else "confirmed"], key=ORDER.index)
    starts = first["jump_mm"], first["bounce_mm"]
    tolerance_um = demand.tolerance_um
    return Verdict(
        overall,
        tuple(broken),
        at_speeds,
        band,
        worst,
        *starts,
        tolerance_um,
        scene=scene,
        cam=lift.family,
        shape_says=rounding_sentence(lift),
    )


def _judged(case: Case, speeds_rpm: list[float], few: bool, to_the_end: bool) -> Verdicts:
    """The verdicts at the crankshaft speeds [r/min] that are asked for; with `few`, of event-exact alone."""
    if (to_the_end and not few) or not allows(case):
        return at_every(judge_speed, case, speeds_rpm)
    alone = at_every(event_alone, case, speeds_rpm)
    stopped = None if to_the_end else until_broken(case, alone)
    return stopped or (alone if few else at_every(judge_speed, case, speeds_rpm))


def _judged_band(
    case: Case, swept: Band, suspects: list[float], at_speeds: Verdicts, few: bool
) -> tuple[Band, Verdicts]:
    """The band with the first method's figures at all judged speeds, and the verdicts at its worst speeds [r/min].

    All methods look at the `suspects` of the sweep, and again at what is then the worst speed of a limited metric;
    event-exact alone with `few`. Without suspects they look at none.
    """
    worst, method = (), next(iter(case.methods))
    band = swept.with_judged(method, {s.speed_rpm: s.methods[method].worst for s in at_speeds})
    for _ in range(ROUNDS if suspects else 0):
        new = [s for s in suspects if s not in [w.speed_rpm for w in worst]]
        worst += at_every(event_alone if few else judge_speed, case, new)
        judged = {s.speed_rpm: s.methods[method].worst for s in (*at_speeds, *worst)}
        band = swept.with_judged(method, judged)
        suspects = [band.worst(name)[0] for name in case.demand.limited]
    return band, tuple(sorted(worst, key=lambda s: s.speed_rpm))


def _known_methods(scene: Scene, methods: tuple[str, ...] | None) -> tuple[str, ...]:
    """The methods that are asked for, by default the first two for the scene's laws; InputError for an unknown one."""
    asked = methods_for(build_train(scene))[:2] if methods is None else methods
    known = verdict_methods()
    if not asked or (unknown := [m for m in asked if m not in known]):
        raise InputError(f"methods {asked}: give names out of {', '.join(known)}" + f"; not {unknown}" * bool(asked))
    return asked


def _swept_band(
    scene: Scene, lift: Lift, step_rpm: float, refined: bool, *, coarsely: bool
) -> tuple[Band, dict[str, float | None], list[float]]:
    """The swept band, where bounce and jump start, and the speeds [r/min] that all methods must look at.

    These are the worst speed of every limited metric and a start that lies inside the band although the metric is
    limited: what a search of its own has found may not be left out.
    """
    many = _settled_metrics() if refined else partial(_settled_metrics(), most=WANDERING_REVOLUTIONS)
    swept = Swept(_at_first_steps, scene, lift, WORKERS, "event", many)
    limited = limited_metrics(scene.design)
    found, left_out = resonances(scene, lift, step_rpm)
    sweep(swept, step_rpm, limited if refined else (), found, coarsely=coarsely)
    first = first_exceeding(swept, _starts(scene), max(SEARCH_STEP_RPM, step_rpm))
    band = replace(swept.band(step_rpm), resonances=tuple(found), resonances_left_out=left_out, refined=refined)
    suspects = {band.worst(name)[0] for name in limited}
    for metric, speed in first.items():
        if metric in limited and speed is not None and band.from_rpm <= speed <= band.to_rpm:
            suspects.add(speed)
    return band, first, sorted(suspects)


def methods_for(train: Train) -> tuple[str, ...]:
    """Names of all methods that judge a train, the most accurate first."""
    return METHODS if train.straight else NONLINEAR_METHODS


def method_named(name: str) -> Prepare:
    """The `prepare` of one of `verdict_methods`; event-exact is imported on demand."""
    return event_exact if name == "event" else import_module(INDEPENDENT[name]).prepare


def event_exact(train: Train, lift: Lift, cam_speed: float, steps_per_revolution: int) -> Revolve:
    """Event-exact as a verdict asks it: where laws are curved, chords grow with the root of the steps.

    The error of their force falls with the square of their number, so that halving the step halves it, and the error
    estimate includes it.
    """
    from camopt.exact import engine
    from camopt.exact.affine.lines import with_chords

    if not train.straight:
        train = with_chords(train, chords_at(train, cam_speed, steps_per_revolution))
    return engine.prepare(train, lift, cam_speed, steps_per_revolution)


def chords_at(train: Train, cam_speed: float, steps_per_revolution: int) -> int:
    """Number of chords that event-exact has in place of a curved law at so many steps."""
    from camopt.exact.affine.lines import CHORDS

    return round(CHORDS * max(1.0, steps_per_revolution / first_steps(train, cam_speed)) ** 0.5)


def _at_first_steps(train: Train, lift: Lift, cam_speed: float) -> Revolve:
    return event_exact(train, lift, cam_speed, first_steps(train, cam_speed))


def _settled_metrics() -> SettledMany:
    """What measures many of event-exact's motions together; a curved law has its default chords there."""
    from camopt.exact.settled import settled_metrics

    return settled_metrics


def _starts(scene: Scene) -> dict[str, float]:
    given = {limit.metric: limit.value for limit in motion_limits(scene.design).values()}
    return {metric: given.get(metric, STARTS_MM) for metric in STARTS.values()}
