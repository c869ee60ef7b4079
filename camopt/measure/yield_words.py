"""Sentences on the yield of a cam over drawn trains, the same for the terminal, the report and a notebook.

They are made from a record, the content of "yield" in verification.json or of yield.json. It may come from an untrusted
file: a value that is missing or not a number is left out.
"""

from collections.abc import Mapping
from typing import Any

from camopt.scene.quantities import is_number

CONFIDENCE = 0.95
"""Confidence level of the interval of a share."""
ADVISED = 0.95
"""Share of trains that is advised if no yield was requested."""
IDEAL = "ideal"
"""Folder within a run folder that holds the largest cam for the train as designed."""
HELD, MISSED, ENOUGH, NOT_ASKED = "held", "missed", "enough", "not asked"
"""A share compared with the requested yield: reached or missed; without a request: the advised share reached or not."""
LEAST_BLAME = 0.005
"""Smallest share of the scatter that is printed; a smaller one would appear as 0 %."""


def standing(record: Mapping[str, Any]) -> str:
    """One of HELD, MISSED, ENOUGH and NOT_ASKED; empty for a record without a share."""
    if not all(is_number(record.get(key)) for key in ("share", "low", "high", "trains")):
        return ""
    if is_number(record.get("wanted")):
        return HELD if record.get("confirmed") is True else MISSED
    return ENOUGH if record["low"] >= ADVISED else NOT_ASKED


def share_sentence(record: Mapping[str, Any]) -> str:
    """How many trains hold at which speeds, and the share with its interval; empty for a record without a share."""
    if not standing(record):
        return ""
    speeds = [s for s in _as_list(record.get("speeds_rpm")) if is_number(s)]
    if len(speeds) > 1:
        at = f" at {len(speeds)} speeds from {speeds[0]:g} to {speeds[-1]:g} r/min"
    else:
        at = f" at {speeds[0]:g} r/min" if speeds else ""
    good = round(record["share"] * record["trains"])
    share, low, high = (f"{100 * record[key]:.1f}" for key in ("share", "low", "high"))
    return (
        f"{good} of {record['trains']:g} trains hold every limit on the motion{at}: {share} % "
        f"({100 * CONFIDENCE:g} % interval {low} to {high} %)"
    )


def asked_sentence(record: Mapping[str, Any]) -> str:
    """The requested yield and whether it is confirmed, with the reasons if not; empty for a record without a share."""
    stands = standing(record)
    if stands == NOT_ASKED:
        return "no yield was requested"
    if stands == ENOUGH:
        return f"no yield was requested, and {100 * ADVISED:g} % hold in any case"
    if not stands:
        return ""
    requested, reasons = f"yield of {100 * record['wanted']:g} %", list(map(str, _as_list(record.get("reasons"))))
    if stands == HELD:
        return f"{requested}: confirmed"
    return f"{requested}: not confirmed{', because ' if reasons else ''}{' and '.join(reasons)}"


def spoiling_sentences(record: Mapping[str, Any]) -> list[str]:
    """Which limit breaks first in how many trains, and which tolerances explain the scatter."""
    sentences = []
    for limit, entry in _as_mapping(record.get("first_broken")).items():
        trains, by_speed = _as_mapping(entry).get("trains"), _as_mapping(_as_mapping(entry).get("speeds_rpm"))
        counts = {speed: count for speed, count in by_speed.items() if is_number(count)}
        if is_number(trains) and counts:
            often = max(counts, key=lambda speed: counts[speed])
            sentences.append(f"breaks first: {limit} in {counted_trains(trains)}, most often at {often} r/min")
    to_blame = {label: share for label, share in _as_mapping(record.get("blame")).items() if is_number(share)}
    if any(to_blame.values()):
        shares = [f"{label} {100 * share:.0f} %" for label, share in to_blame.items() if share >= LEAST_BLAME]
        rest = record.get("unexplained")
        words = f"causes (squared rank correlations with the largest use of a limit): {', '.join(shares)}"
        sentences.append(words + (f"; {100 * rest:.0f} % unexplained" if is_number(rest) else ""))
    return sentences


def ideal_sentence(record: Mapping[str, Any]) -> str:
    """Area ratio and yield of the largest cam for the train as designed; empty if the record has no such cam."""
    ideal = _as_mapping(record.get("ideal"))
    if not all(is_number(ideal.get(key)) for key in ("area_ratio", "share", "trains")):
        return ""
    held = f"{100 * ideal['share']:.3g} % of {ideal['trains']:g} trains"
    return (
        f"the largest cam for the train as designed has an area ratio of {ideal['area_ratio']:.5f} by the search's own "
        f"judge and holds in {held}: it lies in ideal/"
    )


def advised_sentence(record: Mapping[str, Any]) -> str:
    """Estimated area ratio of a cam for trains as built if no yield was requested; empty without an estimate."""
    advised = _as_mapping(record.get("advised"))
    if not all(is_number(advised.get(key)) for key in ("share", "area_ratio")):
        return ""
    return (
        f"for a cam that {100 * advised['share']:g} % of the trains hold, the first program of its search estimates an "
        f"area ratio of {advised['area_ratio']:.3f}"
    )


def estimated_words(record: Mapping[str, Any]) -> str:
    """The estimate of `advised_sentence` in brackets; empty without an estimate."""
    area_ratio = _as_mapping(record.get("advised")).get("area_ratio")
    return f" (estimated area ratio {area_ratio:.3f})" if is_number(area_ratio) else ""


def counted_trains(trains: float) -> str:
    """A number with its noun: "1 train", "12 trains"."""
    return f"{trains:g} train{'' if trains == 1 else 's'}"


def _as_mapping(value: Any) -> Mapping:
    return value if isinstance(value, Mapping) else {}


def _as_list(value: Any) -> list:
    return value if isinstance(value, list) else []
