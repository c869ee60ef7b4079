"""Numbers, units and labels of the run folder's keys as the report shows them."""

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
"""By verdict: its class in the page, its mark and its meaning."""
NEAR = 0.9
"""Used share from which a cell is marked as near its limit."""
NO_VERDICT = ("doubt", "?", "This cam has not been verified: the values below are the optimiser's own.")


def heading(key: str) -> str:
    """Heading of a column: label and unit of a key."""
    label, unit = label_and_unit(key)
    return f"{label} [{unit}]" if unit else label


def kind(verdict: object) -> str:
    """Class of a verdict in the page; empty where the value is not a verdict."""
    return VERDICTS[verdict][0] if isinstance(verdict, str) and verdict in VERDICTS else ""


def state(held: bool | None) -> tuple[str, str]:
    """Class in the page and words for whether a limit holds (None: not known)."""
    return {True: ("good", "✓ held"), False: ("bad", "✗ broken"), None: ("doubt", "? not known")}[held]


def share_kind(share: float | None) -> str:
    """Class in the page for the used share of a limit."""
    return "unknown" if share is None else "bad" if share > 1 + 1e-6 else "near" if share >= NEAR else "calm"


def used(share: float | None, bad: bool = False) -> str:
    """The used share of a limit in words, with a cross before it where it is `bad`; an infinite share stands for a
    motion that does not settle or seat."""
    words = "?" if share is None else f"{100 * share:.0f} %" if share < 10 else f"{share:.0f} times"
    if share is not None and math.isinf(share):
        words = "no settled motion that seats"
    return ("✗ " if bad else "") + words


def as_number(text: str) -> float | None:
    """Number in a table cell; None where the cell is empty or holds no finite number."""
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def shown(value, digits: int = 4) -> str:
    """A value as a table cell: numbers to `digits` significant digits, a dash for None and for an empty text."""
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
    """A list in words, such as `5000, 6000 and 7000`."""
    words = [shown(v) for v in values]
    return " and ".join([", ".join(words[:-1]), words[-1]]) if len(words) > 1 else "".join(words)


def cell(text: str) -> str:
    """A cell of a table file: a number is rounded, any other text is unchanged."""
    value = as_number(text)
    return shown(value if value is not None else text)
