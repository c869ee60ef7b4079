"""Numbers, units and names of the run folder's keys as a reader is shown them."""

import math

from camopt.scene.quantities import label_and_unit

VERDICTS = {
    "confirmed": ("good", "✓", "The methods agree within their error estimates and every limit holds at the upper end "
                  "of its range."),
    "rejected": ("bad", "✗", "The methods agree within their error estimates, and a limit is broken."),
    "sensitive": ("doubt", "±", "The range over neighbouring initial states, speeds (±0.1 %) and lifts (±0.1 µm) "
                  "straddles a limit."),
    "not converged": ("doubt", "?", "The methods do not agree within their error estimates: no figure below is "
                      "settled."),
    "failed": ("bad", "✗", "This family has no cam for this train under these limits."),
}  # fmt: skip
"""Verdict: its class in the page, its mark, its meaning."""
NEAR = 0.9
"""Share of a limit from which a cell says that it is near."""
NO_VERDICT = ("doubt", "?", "This cam has not been verified: nothing below is more than the optimiser's own opinion.")


def heading(key: str) -> str:
    """A column's heading: label and unit."""
    label, unit = label_and_unit(key)
    return f"{label} [{unit}]" if unit else label


def kind(verdict: object) -> str:
    """A verdict's class in the page; empty for what is no verdict."""
    return VERDICTS[verdict][0] if isinstance(verdict, str) and verdict in VERDICTS else ""


def state(held: bool | None) -> tuple[str, str]:
    """Whether a limit holds: its class in the page, and in words."""
    return {True: ("good", "✓ held"), False: ("bad", "✗ broken"), None: ("doubt", "? not known")}[held]


def share_kind(share: float | None) -> str:
    """The class in the page of a used share of a limit."""
    return "unknown" if share is None else "bad" if share > 1 + 1e-6 else "near" if share >= NEAR else "calm"


def used(share: float | None, bad: bool = False) -> str:
    """A used share of a limit in words, crossed out where it is too much; infinite where no motion counts."""
    words = "?" if share is None else f"{100 * share:.0f} %" if share < 10 else f"{share:.0f} times"
    if share is not None and math.isinf(share):
        words = "no motion that counts"
    return ("✗ " if bad else "") + words


def as_number(text: str) -> float | None:
    """Number of a table cell; None where it is empty or no finite number."""
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def shown(value, digits: int = 4) -> str:
    """A value for a table cell: numbers to `digits` significant digits, a dash for nothing."""
    if value is None or value == "":
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, list):
        return " to ".join(shown(v, digits) for v in value) if len(value) == 2 else ", ".join(map(shown, value))
    if not isinstance(value, int | float):
        return str(value)
    if math.isfinite(value) and abs(value) >= 10**digits:
        return f"{value:.0f}".replace("-", "−")
    return f"{value + 0.0:.{digits}g}".replace("-", "−")  # no sign before a zero


def in_words(values: list) -> str:
    """`5000, 6000 and 7000`."""
    words = [shown(v) for v in values]
    return " and ".join([", ".join(words[:-1]), words[-1]]) if len(words) > 1 else "".join(words)


def cell(text: str) -> str:
    """A table file's cell: as a rounded number where it is one, else as it stands."""
    value = as_number(text)
    return shown(value if value is not None else text)
