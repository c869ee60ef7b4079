"""The worst verified figure of every metric, and where verification.json states it: what every text states is this.

It is the figure that a limit judges: the bad end of the range over the measured revolutions and the neighbouring
speeds, lifts and states, at the listed speeds, the band's worst ones and over the swept band.
"""

from collections.abc import Iterator
from dataclasses import dataclass

from camopt.scene.quantities import LESS_IS_WORSE, is_number

JUDGED = ("speeds", "worst_in_band")
"""Lists of verification.json that hold a verdict per speed: at the listed speeds, and at the band's worst ones."""

TEN_THOUSAND = 1e4
"""From here on four digits would round a speed to tens."""


@dataclass(frozen=True)
class Worst:
    """A figure of verification.json: its value (None where there is none), its speed [r/min] and its place there."""

    value: float | None
    speed_rpm: float | None
    source: str

    @property
    def where(self) -> str:
        if not is_number(self.speed_rpm):
            return "at – r/min"
        return f"at {self.speed_rpm:{'.0f' if self.speed_rpm >= TEN_THOUSAND else '.4g'}} r/min"


def worst_in(verification: dict, name: str) -> Worst | None:
    """The worst figure of a metric in the content of verification.json.

    Its value is None where one of them has no figure, so that nothing can be said; None where nothing was verified.
    """
    found = list(_stated(verification, name))
    if not found:
        return None
    sign = -1.0 if name in LESS_IS_WORSE else 1.0
    unknown = next((w for w in found if w.value is None), None)
    return unknown or max(found, key=lambda w: sign * (w.value or 0.0))


def _stated(verification: dict, name: str) -> Iterator[Worst]:
    """Every figure of a metric in verification.json that a statement about the cam must take into account."""
    band = verification.get("band") or {}
    if band:
        entry = (band.get("worst") or {}).get(name) or {}
        value, speed = entry.get("value"), entry.get("speed_rpm")
        yield Worst(value if is_number(value) else None, speed, f"band.worst.{name}.value")
    for key in reversed(JUDGED):
        for i, speed in enumerate(verification.get(key) or []):
            value, part = upper_end(speed, name)
            yield Worst(value, speed.get("speed_rpm"), f"{key}[{i}].{part}")


def upper_end(speed: dict, name: str) -> tuple[float | None, str]:
    """The figure that a limit judges, and its key: the bad end of the range, the value plus its error, or the value."""
    value, ranges = speed.get(name), speed.get("ranges")
    key = f"ranges.{name}"
    spread = ranges.get(name) if isinstance(ranges, dict) else None
    if spread is None and name == "bounce_mm":
        key, spread = "bounce_range_mm", speed.get("bounce_range_mm")
    if isinstance(spread, list) and spread and all(map(is_number, spread)):
        end = min(spread) if name in LESS_IS_WORSE else max(spread)
        return end, f"{key}[{spread.index(end)}]"
    error = speed.get("bounce_error_mm")
    if name == "bounce_mm" and is_number(value) and is_number(error):
        return value + error, "bounce_mm + bounce_error_mm"
    return (value if is_number(value) else None), name
