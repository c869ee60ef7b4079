"""One method at one speed: the step halved until the answer stands, with an error estimate for every figure."""

from collections.abc import Callable, Collection
from dataclasses import dataclass

import numpy as np

from camopt.cam.lift import Lift
from camopt.measure.settling import (
    PLAIN_REVOLUTIONS,
    SETTLED_POSITION,
    Figures,
    decay_per_revolution,
    first_revolution,
    settle,
)
from camopt.scene.errors import MotionRefused
from camopt.scene.quantities import QUANTITIES
from camopt.scene.response import Revolve, end_state
from camopt.scene.train import Train
from camopt.scene.vibration import highest_rate

Prepare = Callable[[Train, Lift, float, int], Revolve]
"""A method: train, lift, cam speed [rad/s] and steps per revolution to one revolution of a state."""

COARSEST_PHASE = 0.6
"""Highest frequency times the first step [rad]: well inside the stability limits of the explicit methods."""
FEWEST_STEPS = 1440
FINEST_STEPS = 120_000
"""Steps per revolution beyond which a step is not halved again: memory, and minutes. A train that would begin beyond a
quarter of it (very stiff, very slow) begins there, and nothing counts as converged before its fastest rate is resolved:
Houbolt's method, stable at every step, would damp it out and stand at a wrong force."""
RELATIVE = 0.01
"""A figure stands when a halved step moves it less than its absolute tolerance plus this share of itself."""
ABSOLUTE = {
    "seating_velocity_m_per_s": 0.005,
    "contact_force_max_N": 5.0,
    "dynamic_area_mm_deg": 0.1,
}
"""Tolerances beside those of the lengths (bounce and jump), which the caller chooses. The figures not listed hang on
contacts that barely open; they are reported with their error."""
MARGIN, COARSER = 2.0, 3
"""An estimated error is MARGIN times the largest distance to the last COARSER answers. No method that steps across
contacts has an order there that would allow less: it is late by a share of its step that is as good as drawn anew at
every step. Where that share is uniform, the error passes the largest distance to two coarser answers once in six times,
twice that distance once in 24, and twice the distance to three of them once in 250."""
WHERE_LIMITED = {"jump_deg": 0.5, "contact_force_min_N": 5.0}
"""Tolerances of the figures that decide only where the scene limits them. Impact velocity and excess lift never are."""


FINEST = {
    q.name: {"mm": 1e-5, "deg": 1e-3, "N": 1e-2, "m/s": 1e-5, "mm deg": 1e-3}[q.unit] for q in QUANTITIES.values()
}
"""Least error that is stated: what settling to a micrometre, reading extremes from cubics and rounding leave of a
figure, whatever halved steps move (some thousandths of a micrometre of bounce on drawn scenes)."""


@dataclass(frozen=True, repr=False)
class Converged:
    """A method's answer at one speed: figures of the finest step, how they spread and how far the last halvings moved
    them. NaN throughout where the method refused every step."""

    steps_per_revolution: int
    converged: bool
    worst: dict[str, float]
    range: dict[str, tuple[float, float]]
    error: dict[str, float]
    revolutions: int  # from rest until settled
    periodic: bool
    state: np.ndarray | None  # settled state (2n) at -pi

    def __repr__(self) -> str:
        found = "converged" if self.converged else "not converged"
        return (
            f"Converged({found}, bounce {self.worst['bounce_mm']:.4g} mm +- {self.error['bounce_mm']:.2g}, "
            f"jump {self.worst['jump_mm']:.4g} mm, {self.steps_per_revolution} steps a revolution)"
        )


def tolerances(tolerance_um: float, limited: Collection[str] = ()) -> dict[str, float]:
    """Absolute tolerance of every deciding figure, in the unit of its name; `limited`: metrics with a limit."""
    also = {name: value for name, value in WHERE_LIMITED.items() if name in limited}
    return {"bounce_mm": tolerance_um * 1e-3, "jump_mm": tolerance_um * 1e-3, **ABSOLUTE, **also}


def first_steps(train: Train, cam_speed: float) -> int:
    """Steps per revolution to begin with, from the fastest rate of the train with every element acting [rad/s]."""
    return max(FEWEST_STEPS, int(np.ceil(2 * np.pi * highest_rate(train) / cam_speed / COARSEST_PHASE)))


def converge(
    prepare: Prepare,
    train: Train,
    lift: Lift,
    cam_speed: float,
    start: np.ndarray,
    tolerance_um: float,
    halvings: int,
    position: float = SETTLED_POSITION,
    *,
    settled: bool = True,
    steps: int | None = None,
    limited: Collection[str] = (),
    certain: bool = False,
) -> Converged:
    """Halve the step until every deciding figure stands twice in a row, at most `halvings` times and,
    after the second halving, to no more than FINEST_STEPS.

    `start` (2n) is the state at rest; a finer step continues from the coarser one's settled state. The error estimate
    is MARGIN times the largest distance to the coarser answers, COARSER of them at most, and never below FINEST. An
    aperiodic motion stands when it moves by no more than its own range. A halved step takes a step more: were its
    samples among the coarser one's, a contact that closes just before one of them would be as late at every step. With
    `settled` off every step measures the first revolution from `start` instead. Where `steps` per revolution to begin
    with are given, they count as resolving the train; else they follow it. A method may ask for more by an attribute
    `enough_steps` (train, cam_speed). `position` [m]: as of `settle`; `limited`: as of `tolerances`. Where the
    figures are to be stated, `certain` goes on until the error estimate of a settled bounce, too, is within
    `tolerance_um`, if `halvings` last. Nothing converges before the train's slowest mode had time to die out.
    """
    first = steps or first_steps(train, cam_speed)
    enough = max(first, getattr(prepare, "enough_steps", lambda *_: 0)(train, cam_speed))
    finest = steps = min(first, FINEST_STEPS // 4)
    allowed, decay = tolerances(tolerance_um, limited), decay_per_revolution(train, cam_speed)
    state, revolutions, most, faded = start, 0, None, False
    runs: list[Figures] = []
    stood: list[bool] = []
    done = None
    for halving in range(halvings + 1):
        if halving > 2 and steps << halving > FINEST_STEPS:
            break
        finest = (steps << halving) + halving
        try:
            revolve = prepare(train, lift, cam_speed, finest)
            if settled:
                done = settle(revolve, state, most, position=position, decay=decay)
            else:
                done = first_revolution(revolve, start)
        except MotionRefused:
            runs, stood, state, most, faded = [], [], start, None, False
            continue
        revolutions, faded = revolutions or done.revolutions, faded or done.faded
        most = None if done.periodic else PLAIN_REVOLUTIONS  # a motion that wandered after all had faded still does
        state = end_state(done.response)
        runs.append(done.metrics(lift))
        if len(runs) > 1:
            stood.append(_stands(runs[-2], runs[-1], allowed, done.periodic))
        insist = certain and done.periodic and _errors(runs)["bounce_mm"] > allowed["bounce_mm"]
        if finest >= enough and len(stood) > 1 and all(stood[-2:]) and not insist:
            break
    if done is None or not runs:
        nothing = dict.fromkeys(QUANTITIES, np.nan)
        return Converged(finest, False, nothing, dict.fromkeys(QUANTITIES, (np.nan, np.nan)), nothing, 0, False, None)
    worst = {name: runs[-1].worst(name) for name in QUANTITIES}
    spread = {name: runs[-1].range(name) for name in QUANTITIES}
    converged = faded and finest >= enough and len(stood) > 1 and all(stood[-2:])
    return Converged(finest, converged, worst, spread, _errors(runs), revolutions, done.periodic, state)


def _errors(runs: list[Figures]) -> dict[str, float]:
    """Error estimate of every metric of the last run; infinite where there is no other."""
    found = {}
    for name in QUANTITIES:
        moved = [apart(r.worst(name), runs[-1].worst(name)) for r in runs[-COARSER - 1 : -1]]
        found[name] = max(FINEST[name], MARGIN * max(moved, default=np.inf))
    return found


def apart(one: float, other: float) -> float:
    """Distance of two figures; not seating (NaN) in both is the same answer, in one of them another one."""
    if np.isnan(one) or np.isnan(other):
        return 0.0 if np.isnan(one) and np.isnan(other) else np.inf
    return abs(one - other)


def _stands(before: Figures, after: Figures, allowed: dict[str, float], periodic: bool) -> bool:
    """Whether halving the step left every deciding figure where it was; not seating twice is the same answer."""
    for name, absolute in allowed.items():
        old, new = before.worst(name), after.worst(name)
        low, high = after.range(name)
        width = 0.0 if periodic else high - low
        if apart(new, old) > absolute + RELATIVE * np.nan_to_num(abs(new)) + np.nan_to_num(width):
            return False
    return True
