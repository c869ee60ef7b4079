"""Values on the command line: text to number, or a sentence of what was expected."""

import argparse
import math

ACCURACIES = ("draft", "standard", "fine")
MOST_SPEEDS = 10_000


def speeds(text: str) -> tuple[float, ...]:
    """Crankshaft speeds [r/min], ascending, from `5000,6000` or `first:last:step` (last included where it is met)."""
    parts = text.split(":")
    if len(parts) == 1:
        listed = sorted({positive(part) for part in text.split(",")})
    elif len(parts) == 3:
        first, last, step = (positive(part) for part in parts)
        if last < first:
            raise argparse.ArgumentTypeError(f"{text!r}: the last speed lies below the first")
        count = math.floor((last - first) / step + 1e-9) + 1
        listed = [first + i * step for i in range(min(count, MOST_SPEEDS + 1))]
    else:
        raise argparse.ArgumentTypeError(f"{text!r}: expected 5000,6000 or first:last:step, as in 300:8000:100")
    if len(listed) > MOST_SPEEDS:
        raise argparse.ArgumentTypeError(f"{text!r}: more than {MOST_SPEEDS} speeds")
    return tuple(listed)


def positive(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0):
        raise argparse.ArgumentTypeError(f"{text!r}: expected a number above 0")
    return value


def count(text: str) -> int:
    if not text.isascii() or not text.isdigit() or not 1 <= int(text) <= 1000:
        raise argparse.ArgumentTypeError(f"{text!r}: expected an integer from 1 to 1000")
    return int(text)


def digits(text: str) -> int:
    if not text.isascii() or not text.isdigit() or int(text) > 12:
        raise argparse.ArgumentTypeError(f"{text!r}: expected an integer from 0 to 12")
    return int(text)


def seed(text: str) -> int:
    if not text.isascii() or not text.isdigit() or int(text) >= 2**32:
        raise argparse.ArgumentTypeError(f"{text!r}: expected an integer from 0 to 2^32 - 1")
    return int(text)


def accuracy(text: str) -> str | float:
    if text in ACCURACIES:
        return text
    try:
        return positive(text)
    except argparse.ArgumentTypeError:
        raise argparse.ArgumentTypeError(
            f"{text!r}: expected {', '.join(ACCURACIES)} or a number of micrometres"
        ) from None
