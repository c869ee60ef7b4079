"""Types of the command line's arguments: each converts a text, or raises an error that states what was expected."""

import argparse
import math
from collections.abc import Callable

from camopt.scene.errors import did_you_mean
from camopt.scene.table import LARGEST, SMALLEST
from camopt.scene.text_file import excerpt
from camopt.verifier import ACCURACY_NAMES

PHASES = ("opening", "closing", "tdc-lift")
"""The ways to state a cam's phase on the crank, beside the angle of its centre."""
MOST_SPEEDS = 10_000
MOST_DEG = 720


def speeds(text: str) -> tuple[float, ...]:
    """Crankshaft speeds [r/min], ascending, from `5000,6000` or `first:last:step` (last included if a step hits it)."""
    parts = text.split(":")
    if len(parts) == 1:
        listed = sorted({positive(part) for part in text.split(",")})
    elif len(parts) == 3:
        first, last, step = (positive(part) for part in parts)
        if last < first:
            raise argparse.ArgumentTypeError(f"{excerpt(text)}: the last speed lies below the first")
        steps = min((last - first) / step, MOST_SPEEDS)  # limited first: infinity cannot become an integer
        listed = [first + i * step for i in range(math.floor(steps + 1e-9) + 1)]
    else:
        raise argparse.ArgumentTypeError(f"{excerpt(text)}: expected 5000,6000 or first:last:step, as in 300:8000:100")
    if len(listed) > MOST_SPEEDS:
        raise argparse.ArgumentTypeError(f"{excerpt(text)}: more than {MOST_SPEEDS} speeds")
    return tuple(listed)


def number(text: str) -> float:
    """The number in a text; NaN where there is none."""
    try:
        return float(text)
    except ValueError:
        return math.nan


def positive(text: str) -> float:
    """A positive number within the range that a scene's numbers may have."""
    value = number(text)
    if not (math.isfinite(value) and value > 0):
        raise argparse.ArgumentTypeError(f"{excerpt(text)}: expected a number above 0")
    if not SMALLEST <= value <= LARGEST:
        raise argparse.ArgumentTypeError(f"{excerpt(text)}: expected a number from {SMALLEST:g} to {LARGEST:g}")
    return value


def columns(text: str) -> tuple[str, str]:
    """Two columns of a table, by number or name, as in 1,3."""
    angle, comma, lift = text.partition(",")
    if not (angle.strip() and comma and lift.strip()) or "," in lift:
        raise argparse.ArgumentTypeError(f"{excerpt(text)}: expected two columns by number or name, as in 1,3")
    return angle.strip(), lift.strip()


def probe(text: str) -> float:
    """Radius [mm] of a probe's ball, infinite for the word "flat"."""
    return math.inf if text == "flat" else positive(text)


def angle(text: str) -> float:
    """An angle [deg] of at most two turns in either direction."""
    value = number(text)
    if not -MOST_DEG <= value <= MOST_DEG:
        raise argparse.ArgumentTypeError(f"{excerpt(text)}: expected an angle from -{MOST_DEG} to {MOST_DEG} degrees")
    return value


def crank_phase(text: str) -> tuple[str, float]:
    """The phase of a cam on the crank: the angle of its centre, or opening=DEG, closing=DEG or tdc-lift=MM."""
    phase, equals, value = text.rpartition("=")
    if equals and phase not in PHASES:
        expected = "expected an angle, or opening=-22, closing=40 or tdc-lift=2.1"
        raise argparse.ArgumentTypeError(f"{excerpt(text)}: {expected}")
    return (phase, positive(value) if phase == "tdc-lift" else angle(value)) if equals else ("centre", angle(text))


def list_of(item: Callable[[str], float]) -> Callable[[str], tuple[float, ...]]:
    """The type of a comma-separated list whose items have the type `item`."""
    return lambda text: tuple(item(word) for word in text.split(","))


lifts, angles = list_of(positive), list_of(angle)
"""Lifts [mm], as in 0.1,1,1.27, and angles [deg], as in 0,90,180,270."""


def named_range(text: str) -> tuple[str, tuple[float, float]]:
    """NAME=LOW:HIGH as the name and its two numbers."""
    name, _, ends = text.rpartition("=")
    low, colon, high = ends.partition(":")
    low, high = number(low), number(high)
    if not name or not colon or not all(math.isfinite(end) and abs(end) <= LARGEST for end in (low, high)):
        raise argparse.ArgumentTypeError(
            f"{excerpt(text)}: expected NAME=LOW:HIGH with two numbers, such as spring.preload_N=200:320"
        )
    return name, (low, high)


def change(text: str) -> tuple[str, tuple[bool, float]]:
    """NAME=VALUE or NAME=*FACTOR as the name, whether the number is a factor, and the number."""
    name, _, number_text = text.rpartition("=")
    value = number(number_text.strip().removeprefix("*"))
    if not name or not (math.isfinite(value) and abs(value) <= LARGEST):
        raise argparse.ArgumentTypeError(
            f"{excerpt(text)}: expected NAME.KEY=VALUE, or NAME.KEY=*FACTOR such as spring.stiffness_N_per_m=*1.1"
        )
    return name.strip(), (number_text.strip().startswith("*"), value)


def picture_file(text: str) -> str:
    if not text.lower().endswith((".png", ".svg")):
        raise argparse.ArgumentTypeError(f"{text!r}: expected a file that ends in .png or .svg")
    return text


def accuracy(text: str) -> str | float:
    if text in ACCURACY_NAMES:
        return text
    try:
        return positive(text)
    except argparse.ArgumentTypeError:
        raise argparse.ArgumentTypeError(
            f"{excerpt(text)}: expected {', '.join(ACCURACY_NAMES)} or a number of micrometres"
            f"{did_you_mean(text, ACCURACY_NAMES)}"
        ) from None


def integer(low: int, high: int) -> Callable[[str], int]:
    """The type of an integer in a range, both ends included."""

    def whole(text: str) -> int:
        usable = text.isascii() and text.isdigit() and len(text) <= 20  # Python refuses to convert some thousand digits
        if not usable or not low <= int(text) <= high:
            largest = "2^32 - 1" if high == 2**32 - 1 else high
            raise argparse.ArgumentTypeError(f"{excerpt(text)}: expected an integer from {low} to {largest}")
        return int(text)

    return whole


line_number, count, trains = integer(1, 10_000_000), integer(1, 1000), integer(1, 1_000_000)
digits, port, seed = integer(0, 12), integer(0, 65_535), integer(0, 2**32 - 1)
