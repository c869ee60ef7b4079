"""The record of a verification, verification.json: the single source of every number stated about a verdict.

The terminal, the report, the designer and the figures read a `VerificationRecord`, from a verdict or from a file.
"""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from camopt.measure.sweep import Band
from camopt.scene.quantities import LESS_IS_WORSE, QUANTITIES, is_number
from camopt.scene.units import MM, UM
from camopt.verifier.convergence import FINEST, Converged

HALVED, ONE_STEP, ALONE = "halving", "one step", "event-exact alone"
"""How a speed was decided: by halving the methods' steps until they converged or could not be halved further, by the
second method at its first step, or by event-exact without another method."""
JUDGED = ("speeds", "worst_in_band")
"""Lists of verification.json that hold one verdict per speed: the listed speeds, and the worst speeds of the band."""
REPORTED = tuple(name for name in QUANTITIES if name != "excess_lift_mm")
"""Metrics of verification.json."""
OUTSIDE = ("speed_rpm", "engine", "revolutions", "difference_nm", "stated_nm", "agrees")
"""Keys of an entry of outside.json, which compares the valve's motion from rest with that of another engine at one
speed: the largest difference over some revolutions, and the difference that the stated errors allow."""


@dataclass(frozen=True)
class Worst:
    """A metric of verification.json: its value (None if it has none), its speed [r/min], and its key in the file."""

    value: float | None
    speed_rpm: float | None
    source: str

    @property
    def where(self) -> str:
        if not is_number(self.speed_rpm):
            return "at – r/min"
        digits = ".0f" if self.speed_rpm >= 1e4 else ".4g"  # four digits would round it to tens
        return f"at {self.speed_rpm:{digits}} r/min"


class VerificationRecord(dict[str, Any]):
    """The content of verification.json (design.md section 7), made from a verdict or read from a file.

    A file is untrusted. NaN is stored as null. Without a swept band `band` is null and `worst_in_band` is empty.
    """

    @property
    def judged(self) -> list[dict]:
        """The records of all judged speeds, the listed ones first."""
        return [speed for key in JUDGED for speed in self.get(key) or []]

    @property
    def by_speed(self) -> list[dict]:
        """The records of all judged speeds, each speed once, ascending."""
        once = {speed.get("speed_rpm"): speed for key in reversed(JUDGED) for speed in self.get(key) or []}
        return sorted(once.values(), key=lambda s: s["speed_rpm"] if is_number(s.get("speed_rpm")) else 0.0)

    @property
    def outside(self) -> list[dict]:
        """The entries of outside.json at the listed speeds; empty if no other engine was run."""
        return [speed["outside"] for speed in self.get("speeds") or [] if "outside" in speed]

    def worst(self, name: str) -> Worst | None:
        """The worst verified value of a metric: the worst of its range ends at the judged speeds and over the band.

        Its value is None if the metric has none at one of these speeds. Returns None if nothing was verified.
        """
        values = list(self._values(name))
        if not values:
            return None
        sign = -1.0 if name in LESS_IS_WORSE else 1.0
        unknown = next((entry for entry in values if entry.value is None), None)
        return unknown or max(values, key=lambda entry: sign * (entry.value or 0.0))

    def _values(self, name: str) -> Iterator[Worst]:
        band = self.get("band") or {}
        if band:
            entry = (band.get("worst") or {}).get(name) or {}
            value, speed = entry.get("value"), entry.get("speed_rpm")
            yield Worst(value if is_number(value) else None, speed, f"band.worst.{name}.value")
        for key in reversed(JUDGED):
            for i, speed in enumerate(self.get(key) or []):
                value, place = worst_case_value(speed, name)
                yield Worst(value, speed.get("speed_rpm"), f"{key}[{i}].{place}")

    def with_outside(self, entries: Sequence[Mapping]) -> "VerificationRecord":
        """This record with every entry of outside.json added to the record of its speed under the key `outside`.

        If one of them disagrees, the verdict becomes "not converged" and the reason names the disagreement.
        """
        if not entries:
            return self
        at = {comparison["speed_rpm"]: dict(comparison) for comparison in entries}
        speeds = [
            entry | ({"outside": at[entry["speed_rpm"]]} if entry.get("speed_rpm") in at else {})
            for entry in self.get("speeds") or []
        ]
        apart = not all(comparison["agrees"] for comparison in entries)
        outcome = {"verdict": "not converged", "reason": outside_sentence(entries)} if apart else {}
        return VerificationRecord(self | {"speeds": speeds} | outcome)


def worst_case_value(speed: dict, name: str) -> tuple[float | None, str]:
    """The value compared with a limit, and its key: worse end of the range, value plus error, or the value itself."""
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


def bounce_error_um(speed: dict) -> float | None:
    """The estimated error of the bounce at a speed [um], which for an aperiodic motion includes the width of its range.

    It is at least FINEST, and None if the valve does not seat or no second step was taken.
    """
    error = speed.get("bounce_error_mm")
    return max(error, FINEST["bounce_mm"]) * MM / UM if is_number(error) else None


def accuracy_record(speeds: Sequence[dict], requested_um: float, requested: str | float | None) -> dict:
    """The entry "accuracy" of verification.json, from the records of the judged speeds.

    `requested_um` is the tolerance [um]; `requested` is its name or number as the user gave it, or None. The accuracy
    is reached if the error of the bounce is within the tolerance at every speed.
    """
    by_speed = {s["speed_rpm"]: s for s in speeds}
    errors = {rpm: bounce_error_um(s) for rpm, s in by_speed.items()}
    delivered = max((np.inf if e is None else e for e in errors.values()), default=np.inf)
    words = f"requested accuracy: {requested_um:g} um" + (f" ({requested})" if isinstance(requested, str) else "")
    if delivered <= requested_um:
        finest = delivered <= FINEST["bounce_mm"] * MM / UM * (1 + 1e-9)
        words += f"; estimated error of bounce: {'at most ' if finest else ''}{delivered:.2g} um"
    else:
        none = [rpm for rpm, s in by_speed.items() if not all(map(is_number, s["bounce_range_mm"]))]
        short = [rpm for rpm, error in errors.items() if rpm not in none and (error is None or error > requested_um)]
        ranges = [_bounce_text(by_speed[rpm]) for rpm in short]
        words += f"; not reached: only a range of the bounce is known, {', '.join(ranges)}" if ranges else ""
        at = ", ".join(f"{rpm:g}" for rpm in none)
        words += f"; there is no bounce at {at} r/min, where the valve does not seat" if none else ""
    if alone := [rpm for rpm, speed in by_speed.items() if speed["decided_after"] == ALONE]:
        covered = ", ".join(f"{rpm:g}" for rpm in sorted(by_speed.keys() - set(alone)))
        others = f"{len(alone)} other speed{'s' * (len(alone) > 1)}"
        words += f"; all methods were run at {covered} r/min, event-exact alone at {others}"
    return {
        "asked": requested_um if requested is None else requested,
        "asked_um": requested_um,
        "delivered_um": delivered if np.isfinite(delivered) else None,
        "reached": bool(delivered <= requested_um),
        "statement": words,
    }


def _bounce_text(speed: dict) -> str:
    """The bounce at one speed as text: value and error for a periodic motion, the range for an aperiodic one."""
    (low, high), error = speed["bounce_range_mm"], bounce_error_um(speed) or np.inf
    value = f"{high:.4f} mm +- {error:.2g} um" if speed["periodic"] else f"{low:.4f} to {high:.4f} mm"
    return f"{value} at {speed['speed_rpm']:g} r/min"


def outside_sentence(entries: Sequence[Mapping]) -> str:
    """Whether the other engine agrees, from the entries of outside.json, as one sentence; empty without entries."""
    if not entries:
        return ""
    engine, apart = entries[0]["engine"], [entry for entry in entries if not entry["agrees"]]
    if apart:
        worst = max(apart, key=lambda entry: entry["difference_nm"] / entry["stated_nm"])
        at = ", ".join(f"{entry['speed_rpm']:g}" for entry in apart)
        return (
            f"{engine} disagrees at {at} r/min: the valve from rest is {worst['difference_nm']:.3g} nm apart at "
            f"{worst['speed_rpm']:g} r/min, where the stated errors explain {worst['stated_nm']:.3g} nm."
        )
    largest = max(entry["difference_nm"] for entry in entries)
    speeds = f"{len(entries)} speed{'s' * (len(entries) != 1)}"
    return f"{engine} agrees within {largest:.2g} nm at {speeds}, by the valve's motion from rest."


def outside_entry(speed_rpm: float, engine: str, revolutions: int, difference_nm: float, stated_nm: float) -> dict:
    """An entry of outside.json. The engines agree if the difference is within the stated errors."""
    values = speed_rpm, engine, revolutions, difference_nm, stated_nm, difference_nm <= stated_nm
    return dict(zip(OUTSIDE, values, strict=True))


def outside_entries(text: str) -> list[dict]:
    """The entries of an outside.json, parsed from its untrusted text. Raises ValueError if they are malformed."""
    data, keys = json.loads(text), OUTSIDE[:-1]
    if not isinstance(data, list) or not all(isinstance(entry, dict) and set(keys) <= set(entry) for entry in data):
        raise ValueError(f"expected a list of objects with {', '.join(sorted(keys))}")
    if not all(isinstance(entry[key], (int, float)) for entry in data for key in keys if key != "engine"):
        raise ValueError("expected numbers beside the engine")
    return [outside_entry(*(entry[key] for key in keys)) for entry in data]


def method_record(answer: Converged) -> dict:
    """The record of one method's answer at one speed."""
    steps = {"steps_per_revolution": answer.steps_per_revolution, "converged": answer.converged}
    return metrics_record(answer, answer.range) | steps


def metrics_record(answer: Converged, ranges: Mapping[str, tuple[float, float]]) -> dict:
    """The metrics of a method's answer with their errors, whether its motion is periodic, and the `ranges`."""
    metrics = dict(zip(REPORTED, numbers(answer.worst[name] for name in REPORTED), strict=True))
    errors = dict(zip(REPORTED, numbers(answer.doubt(name) for name in REPORTED), strict=True))
    return {
        **metrics,
        "bounce_error_mm": errors["bounce_mm"],
        "errors": errors,
        "revolutions": answer.revolutions,
        "periodic": answer.periodic,
        "bounce_range_mm": numbers(ranges["bounce_mm"]),
        "ranges": {name: numbers(ranges[name]) for name in REPORTED},
    }


def band_record(band: Band) -> dict:
    """The record of a band: its ends and step, the worst value of every metric with its speed and method, and curves.

    The curves hold the sweep's metrics and, at the judged speeds, those of the first method.
    """
    worst = {}
    for name in REPORTED:
        speed, value = band.worst(name)
        worst[name] = {"value": numbers([value])[0], "speed_rpm": speed, "method": band.methods[speed]}
    of_resonance = "speed_rpm", "half_width_rpm", "harmonic", "frequency_Hz"
    return {
        "from_rpm": band.from_rpm,
        "to_rpm": band.to_rpm,
        "step_rpm": band.step_rpm,
        "refined": band.refined,
        "worst_bounce_mm": worst["bounce_mm"]["value"],
        "worst_speed_rpm": worst["bounce_mm"]["speed_rpm"],
        "worst": worst,
        "resonances": [{key: getattr(resonance, key) for key in of_resonance} for resonance in band.resonances],
        "resonances_left_out": band.resonances_left_out,
        "curves": {
            "speed_rpm": band.speeds_rpm.tolist(),
            **{name: numbers(band.figures[name]) for name in REPORTED},
        },
    }


def numbers(values: Iterable[float]) -> list[float | None]:
    """The values for JSON, which has no NaN: None, which becomes null, in place of a value that is not finite."""
    return [float(value) if np.isfinite(value) else None for value in values]
