"""What drawn trains say of a cam, in sentences: the same for the terminal, the report and a notebook.

They are made of a record, the content of verification.json's "yield" or of yield.json, which may come from an untrusted
file: what is not there or is no number is left out.
"""

from collections.abc import Mapping
from typing import Any

from camopt.scene.quantities import is_number

CONFIDENCE = 0.95
"""How often the interval of a share holds the true one."""
ADVISED = 0.95
"""The share of trains that is advised where none was asked for."""
IDEAL = "ideal"
"""The folder inside a run's of the largest cam for the train as designed."""
HELD, MISSED, ENOUGH, NOT_ASKED = "held", "missed", "enough", "not asked"
"""How the share stands to what was asked: where nothing was, whether the advised share is held in any case."""
LEAST_BLAME = 0.005
"""A smaller part of the scatter would print as 0 %."""


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
    speeds = [s for s in _listed(record.get("speeds_rpm")) if is_number(s)]
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
    """What was asked and whether that is confirmed, with the reasons where it is not; empty as above."""
    stands = standing(record)
    if stands == NOT_ASKED:
        return "no yield was asked for"
    if stands == ENOUGH:
        return f"no yield was asked for, and {100 * ADVISED:g} % hold in any case"
    if not stands:
        return ""
    asked, reasons = f"yield of {100 * record['wanted']:g} %", list(map(str, _listed(record.get("reasons"))))
    if stands == HELD:
        return f"{asked}: confirmed"
    return f"{asked}: not confirmed{', because ' if reasons else ''}{' and '.join(reasons)}"


def spoiling_sentences(record: Mapping[str, Any]) -> list[str]:
    """Which limit breaks first in how many trains, and which tolerances are to blame."""
    sentences = []
    for limit, entry in _mapped(record.get("first_broken")).items():
        trains, by_speed = _mapped(entry).get("trains"), _mapped(_mapped(entry).get("speeds_rpm"))
        counts = {speed: count for speed, count in by_speed.items() if is_number(count)}
        if is_number(trains) and counts:
            often = max(counts, key=lambda speed: counts[speed])
            sentences.append(f"breaks first: {limit} in {counted_trains(trains)}, most often at {often} r/min")
    to_blame = {label: part for label, part in _mapped(record.get("blame")).items() if is_number(part)}
    if any(to_blame.values()):
        parts = [f"{label} {100 * part:.0f} %" for label, part in to_blame.items() if part >= LEAST_BLAME]
        rest = record.get("unexplained")
        words = f"to blame (squared rank correlations with the worst used limit): {', '.join(parts)}"
        sentences.append(words + (f"; {100 * rest:.0f} % unexplained" if is_number(rest) else ""))
    return sentences


def ideal_sentence(record: Mapping[str, Any]) -> str:
    """What the largest cam for the train as designed would have, and in what share it holds; empty where none stands
    beside the cam."""
    ideal = _mapped(record.get("ideal"))
    if not all(is_number(ideal.get(key)) for key in ("area_ratio", "share", "trains")):
        return ""
    held = f"{100 * ideal['share']:.3g} % of {ideal['trains']:g} trains"
    return (
        f"the largest cam for the train as designed has an area ratio of {ideal['area_ratio']:.5f} by the search's own "
        f"judge and holds in {held}: it lies in ideal/"
    )


def advised_sentence(record: Mapping[str, Any]) -> str:
    """What a cam for trains as built would have, where none was asked for; empty where that was not estimated."""
    advised = _mapped(record.get("advised"))
    if not all(is_number(advised.get(key)) for key in ("share", "area_ratio")):
        return ""
    return (
        f"for a cam that {100 * advised['share']:g} % of the trains hold, the first program of its search estimates an "
        f"area ratio of {advised['area_ratio']:.3f}"
    )


def estimated_words(record: Mapping[str, Any]) -> str:
    """The estimate of `advised_sentence` in brackets; empty where there is none."""
    area_ratio = _mapped(record.get("advised")).get("area_ratio")
    return f" (estimated area ratio {area_ratio:.3f})" if is_number(area_ratio) else ""


def counted_trains(trains: float) -> str:
    """`1 train`, `12 trains`."""
    return f"{trains:g} train{'' if trains == 1 else 's'}"


def _mapped(value: Any) -> Mapping:
    return value if isinstance(value, Mapping) else {}


def _listed(value: Any) -> list:
    return value if isinstance(value, list) else []
