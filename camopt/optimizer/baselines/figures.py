"""The figures of a run folder, from its cams and their verdicts as verification.json has them."""

import json
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import chain
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from camopt.cam.design_file import read_design
from camopt.cam.lift import Lift, lift_table
from camopt.exact.engine import prepare
from camopt.exact.settled import settled_metrics
from camopt.measure.settling import Settled, first_revolution
from camopt.measure.sweep import SEARCH_STEP_RPM, START_RPM, STARTS, SpeedCache, at_speeds, sweep
from camopt.measure.yield_words import IDEAL
from camopt.plots import (
    DrawnMotion,
    Sweep,
    bounce_against_speed,
    convergence,
    last_revolution,
    profiles,
    save,
    valve_motion,
)
from camopt.plots.style import DESIGN, family_of
from camopt.scene.errors import MotionRefused
from camopt.scene.rest import state_at_rest
from camopt.scene.schema import Scene
from camopt.scene.train import Train, build_train
from camopt.verifier.convergence import WANDERING_REVOLUTIONS, StepRefinement, Tolerances, at_once

FIGURE_SPEEDS = 60
"""Number of steps of the figure's own sweep over a band that the verdict did not cover."""
BEYOND_BAND = 0.1
"""Least range outside the band that the figure shows on each side, relative to the band's width."""
FURTHEST_BEYOND = 0.5
"""Largest range above the band that it shows, so that the speeds at which jump and bounce begin are visible."""
TABLE_STEP_DEG = 0.1
DRAWN = ("bounce_mm", "jump_mm")
HALVINGS = 6
"""Permitted halvings of event-exact's step until the motion settles, as many as a verdict allows by default."""
AS_DESIGNED = "for the train as designed"
"""Label of the profile of the cam for the train as designed, beside one for trains as built."""
UNLAWFUL = " (breaks limits on the cam)"
"""Suffix of a name in the figures: this cam breaks limits on its shape."""


def draw(
    folder: Path,
    scene: Scene,
    cams: dict[str, Lift],
    verdicts: dict[str, dict],
    speeds_rpm: Sequence[float],
) -> dict[str, Figure]:
    """Draws the figures of a run folder, writes them into its folder `figures` and returns them by name; the valve's
    motion is drawn at `speeds_rpm`. `verdicts` holds one for every cam."""
    design, operation = scene.required_design, scene.required_operation
    figures = folder / "figures"
    figures.mkdir(exist_ok=True)
    # an entry of `broken` that names no speed is a limit on the cam's shape; one with a speed is a limit on the motion
    lawful = {name: all(" at " in word for word in verdicts[name].get("broken", [])) for name in cams}
    named = {name: name if lawful[name] else name + UNLAWFUL for name in cams}
    tables = [(named[name], lift_table(lift, TABLE_STEP_DEG)) for name, lift in cams.items()]
    if (ideal := folder / IDEAL / "design.json").exists():
        tables.append((AS_DESIGNED, lift_table(read_design(ideal, scene), TABLE_STEP_DEG)))
    drawn = {"profiles": profiles(tables, design)}
    each = (settled_motions(scene, named[name], lift, verdicts[name], speeds_rpm) for name, lift in cams.items())
    if motions := list(chain.from_iterable(each)):
        drawn["valve_motion"] = valve_motion(motions, design)
    top = _top_speed(scene, verdicts.get(DESIGN, {}))
    curves = [curve(scene, named[name], lift, verdicts[name], top) for name, lift in cams.items()]
    drawn["bounce_against_speed"] = bounce_against_speed(curves, design, operation.band_rpm, operation.speeds_rpm)
    if (folder / "history.jsonl").exists() and (folder / "design.json").exists():
        record = json.loads((folder / "design.json").read_text(encoding="utf-8"))
        bound, no_jump = record["area_ratio_bound"], record["area_ratio_no_jump"]
        delivered = (record["area_ratio"], verdicts[DESIGN]["verdict"]) if DESIGN in verdicts else None
        steps = [json.loads(line) for line in (folder / "history.jsonl").read_text(encoding="utf-8").splitlines()]
        drawn["convergence"] = convergence(steps, bound, no_jump, design.bounce_max_mm, delivered)
    for name, figure in drawn.items():
        save(figure, figures, name)
    return drawn


def settled_motions(scene: Scene, name: str, lift: Lift, verdict: dict, rpm: Sequence[float]) -> list[DrawnMotion]:
    """A settled revolution at each speed [r/min]; speeds at which the motion is refused are left out."""
    train, stated = build_train(scene), stated_periodic(verdict)
    motions = []
    for speed in rpm:
        try:
            response = settled_motion(train, lift, scene.cam_speed(speed), stated.get(speed)).response
        except MotionRefused:
            continue
        motions.append(last_revolution(name, speed, response))
    return motions


def stated_periodic(verdict: dict) -> dict[float, bool]:
    """By speed [r/min], whether the motion has settled according to the verdict."""
    speeds = verdict.get("speeds") or []
    return {s["speed_rpm"]: bool(s["periodic"]) for s in speeds if {"speed_rpm", "periodic"} <= {*s}}


def settled_motion(
    train: Train, lift: Lift, cam_speed: float, stated: bool | None = None, samples: int | None = None
) -> Settled:
    """Two revolutions of the settled event-exact motion at `cam_speed` [rad/s], or of one that does not settle.

    `stated` is whether the verdict found the motion periodic, None if there is no verdict. A verdict that halves its
    step may settle after more revolutions than are run here: its step refinement is then repeated. A motion that never
    settles is shown after WANDERING_REVOLUTIONS. `samples` is their number per revolution, event-exact's own where
    None. Raises MotionRefused.
    """
    many = partial(settled_metrics, most=WANDERING_REVOLUTIONS) if stated is False else settled_metrics
    once = at_once(many, train, lift, cam_speed, state_at_rest(train))
    assert once.state is not None, "else it is refused"
    state, periodic = once.state, once.periodic if stated is None else stated
    if periodic and not once.periodic:
        rest = state_at_rest(train)
        search = StepRefinement(prepare, train, lift, cam_speed, rest, Tolerances(halvings=HALVINGS))
        while not (search.periodic or search.ended):
            search.refine()
        answer = search.answer(0)
        state = state if answer.state is None else answer.state
    steps = () if samples is None else (samples,)
    return replace(first_revolution(prepare(train, lift, cam_speed, *steps), state), periodic=periodic)


def _top_speed(scene: Scene, verdict: dict) -> float:
    """Highest speed drawn [r/min]: above the band and, if they are near, above the starts of jump and bounce."""
    low, high = scene.required_operation.band_rpm
    more, most = (share * (high - low) for share in (BEYOND_BAND, FURTHEST_BEYOND))
    starts = [s for s in _starts(verdict).values() if s is not None and s + more <= high + most]
    return max([high, *starts]) + more


def _speeds_beside_the_band(scene: Scene, verdict: dict, top_rpm: float) -> np.ndarray:
    """Speeds [r/min] that are drawn beside those of the verdict's curve: outside the band, and where jump or bounce
    starts. They are those of the verdict's own search for these starts, so that the curve agrees with it."""
    low, high = scene.required_operation.band_rpm
    bottom = low - BEYOND_BAND * (high - low)
    step = max(SEARCH_STEP_RPM, (verdict.get("band") or {}).get("step_rpm", 0.0))
    grid = np.array([bottom, *np.arange(0.5 * low, 1.5 * high, step), top_rpm])
    begins = np.array([s for s in _starts(verdict).values() if s is not None])
    speeds = np.concatenate([grid[(grid < low) | (grid > high)], begins - START_RPM, begins])
    return np.unique(speeds[(speeds >= bottom) & (speeds <= top_rpm)])


def _starts(verdict: dict) -> dict[str, float | None]:
    limits = verdict.get("limits") or {}
    return {metric: limits.get(key) for key, metric in STARTS.items()}


def curve(scene: Scene, name: str, lift: Lift, verdict: dict, top_rpm: float) -> Sweep:
    """Bounce and jump against speed. Over the band it is the verdict's own curve or, without one, event-exact's sweep,
    refined around the largest bounce and jump; outside the band, up to `top_rpm`, it is event-exact's."""
    band = verdict.get("band")
    if band:
        speeds = np.array(band["curves"]["speed_rpm"], dtype=float)
        inside = {key: np.array(band["curves"][key], dtype=float) for key in DRAWN}
        worst = {key: (band["worst"][key]["speed_rpm"], band["worst"][key]["value"]) for key in DRAWN}
        starts = _starts(verdict)
    else:
        step = np.ptp(scene.required_operation.band_rpm) / FIGURE_SPEEDS
        swept = sweep(SpeedCache(settled_metrics, scene, lift), float(step), DRAWN)
        speeds, inside, worst, starts = swept.speeds_rpm, swept.figures, {}, None
    beside = np.setdiff1d(_speeds_beside_the_band(scene, verdict, top_rpm), speeds)
    briefly = band is not None and band.get("refined") is False  # as in the verdict's own sweep
    many = partial(settled_metrics, most=WANDERING_REVOLUTIONS) if briefly else settled_metrics
    rows = at_speeds(many, scene, lift, beside)
    values = {key: np.concatenate([inside[key], [row[key] for row in rows]]) for key in DRAWN}
    every = np.concatenate([speeds, beside])
    order = np.argsort(every)
    marked = worst if family_of(name) == DESIGN else {}
    return Sweep(name, every[order], *(values[key][order] for key in DRAWN), starts_rpm=starts, worst=marked)
