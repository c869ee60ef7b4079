"""The laws of the second reading that are not linear, written from docs/model.md and the scene file alone.

A law of the compression is a function of it; oil and friction have a memory z and three phases each. What makes them
change is told as (phase that follows, what is watched, direction, level): watched are the slack d - z and the rate d'.
"""

import numpy as np
from scipy.optimize import brentq

BETWEEN, SEATED, REFILL = "ball between", "ball on its seat", "refill"
STICK, FORWARD, BACK = "stick", "slides forward", "slides back"
SLACK, RATE = 2, 3
"""Where the watched quantities stand behind compression beyond the touch (0) and force (1)."""


def law_of(element):
    """(elastic force [N] as a function of the compression [m], compression at its touch) of an element of a scene."""
    if element.kind == "friction":
        return lambda d: np.zeros_like(d), 0.0
    if element.kind == "adjuster":
        rows = plunger(element)
    elif element.law == "table":
        rows = np.array(element.force_table) * (1e-3, 1.0)
    else:
        rows = np.array(element.stiffness_table) * (1e-3, 1.0)
        force = lambda d: element.preload_N + progressive(rows, d)  # noqa: E731
        return force, brentq(force, -0.1, 0.1, xtol=1e-15)
    force = lambda d: on_lines(rows, d)  # noqa: E731
    return force, brentq(force, -0.1, 0.1, xtol=1e-15)


def plunger(element) -> np.ndarray:
    """The plunger spring of an adjuster: between stops half a stroke to either side that are as stiff as the oil."""
    half, stop = 0.5e-3 * element.stroke_mm, element.stiffness_N_per_m
    low, high = (element.preload_N + sign * half * element.spring_N_per_m for sign in (-1.0, 1.0))
    return np.array([[-half - low / stop, 0.0], [-half, low], [half, high], [half + 1e-3, high + stop * 1e-3]])


def on_lines(rows: np.ndarray, d) -> np.ndarray:
    """Straight lines through rows (q, 2), of which the outer two go on."""
    place, value = rows.T
    slope = np.diff(value) / np.diff(place)
    below, above = np.minimum(d - place[0], 0.0), np.maximum(d - place[-1], 0.0)
    return np.interp(d, place, value) + slope[0] * below + slope[-1] * above


def progressive(rows: np.ndarray, d) -> np.ndarray:
    """Integral from 0 to d of a stiffness in straight lines through rows (q, 2), constant beyond the outer two."""
    place, k = rows.T

    def from_first(d):
        inside = np.clip(d, place[0], place[-1])
        whole = np.concatenate([[0.0], np.cumsum(0.5 * (k[1:] + k[:-1]) * np.diff(place))])
        i = np.clip(np.searchsorted(place, inside, "right") - 1, 0, len(place) - 2)
        u = inside - place[i]
        bend = 0.5 * (k[i + 1] - k[i]) / (place[i + 1] - place[i]) * u**2
        return (
            whole[i] + k[i] * u + bend + k[0] * np.minimum(d - place[0], 0.0) + k[-1] * np.maximum(d - place[-1], 0.0)
        )

    return from_first(np.asarray(d)) - from_first(np.zeros(()))


def first_phase(element, slack: float, rate: float) -> str:
    """The phase of an element with a memory in an arbitrary state."""
    if element.kind == "adjuster":
        travel = 1e-3 * (element.check_travel_mm or 0.0)
        return SEATED if slack > travel else BETWEEN if slack > 0.0 or rate >= 0.0 else REFILL
    pull = element.stiffness_N_per_m * slack
    return STICK if abs(pull) < element.slip_N else FORWARD if pull > 0.0 else BACK


def remembered(element, phase: str, slack, rate):
    """(force [N], rate of the memory [m/s]) of oil or friction in a phase."""
    k = element.stiffness_N_per_m
    if element.kind == "adjuster":
        oil = k * (slack - 1e-3 * (element.check_travel_mm or 0.0))
        nothing = np.zeros_like(slack)
        return {BETWEEN: (nothing, nothing), SEATED: (oil, oil / (element.leak_N_s_per_m or 1.0)),
                REFILL: (nothing, rate)}[phase]  # fmt: skip
    slip = np.full_like(slack, element.slip_N)
    return {STICK: (k * slack, np.zeros_like(slack)), FORWARD: (slip, rate), BACK: (-slip, rate)}[phase]


def changes_of(element, phase: str) -> list[tuple[str, int, float, float]]:
    """What an element with a memory may change to."""
    if element.kind == "adjuster":
        travel = 1e-3 * (element.check_travel_mm or 0.0)
        return {
            BETWEEN: [(SEATED, SLACK, 1.0, travel), (REFILL, SLACK, -1.0, 0.0)],
            SEATED: [(BETWEEN, SLACK, -1.0, travel)],
            REFILL: [(BETWEEN, RATE, 1.0, 0.0)],
        }[phase]
    give = element.slip_N / element.stiffness_N_per_m
    return {
        STICK: [(FORWARD, SLACK, 1.0, give), (BACK, SLACK, -1.0, -give)],
        FORWARD: [(STICK, RATE, -1.0, 0.0)],
        BACK: [(STICK, RATE, 1.0, 0.0)],
    }[phase]
