"""What a judge from outside says of a cam, speed by speed, beside a verdict that it does not decide.

It confirms nothing. But where it disagrees beyond the stated errors, somebody is wrong: the verdict is "not converged".
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields


@dataclass(frozen=True)
class OutsideSpeed:
    """How far the valve's motion from rest is from the judge's at one speed."""

    speed_rpm: float
    engine: str  # with its version
    revolutions: int  # that were compared
    difference_nm: float  # largest over them
    stated_nm: float  # up to which it counts as agreement

    @property
    def agrees(self) -> bool:
        """Whether the difference is within the stated errors."""
        return self.difference_nm <= self.stated_nm

    def as_dict(self) -> dict:
        """An entry of outside.json."""
        return {**asdict(self), "agrees": self.agrees}


def outside_sentence(found: Sequence[Mapping]) -> str:
    """What the judge says in the entries of outside.json, as one sentence; empty where nobody asked it."""
    if not found:
        return ""
    engine, apart = found[0]["engine"], [one for one in found if not one["agrees"]]
    if apart:
        worst = max(apart, key=lambda one: one["difference_nm"] / one["stated_nm"])
        at = ", ".join(f"{one['speed_rpm']:g}" for one in apart)
        return (
            f"{engine} disagrees at {at} r/min: the valve from rest is {worst['difference_nm']:.3g} nm apart at "
            f"{worst['speed_rpm']:g} r/min, where the stated errors explain {worst['stated_nm']:.3g} nm."
        )
    largest = max(one["difference_nm"] for one in found)
    speeds = f"{len(found)} speed{'s' * (len(found) != 1)}"
    return f"{engine} agrees within {largest:.2g} nm at {speeds}, by the valve's motion from rest."


def with_outside(record: dict, found: Sequence[Mapping]) -> dict:
    """The content of verification.json with the judge's entries, each at its speed as `outside`.

    Where one of them disagrees, the verdict is "not converged" and the reason says so.
    """
    by_speed = {one["speed_rpm"]: one for one in found}
    speeds = [
        entry | ({"outside": dict(by_speed[entry["speed_rpm"]])} if entry.get("speed_rpm") in by_speed else {})
        for entry in record.get("speeds") or []
    ]
    apart = not all(one["agrees"] for one in found)
    said = {"verdict": "not converged", "reason": outside_sentence(found)} if apart else {}
    return record | ({"speeds": speeds} if found else {}) | said


def outside_entries(text: str) -> list[dict]:
    """The entries of the text of an outside.json, which is untrusted. Raises ValueError for anything else."""
    data, keys = json.loads(text), {field.name for field in fields(OutsideSpeed)}
    if not isinstance(data, list) or not all(isinstance(one, dict) and keys <= set(one) for one in data):
        raise ValueError(f"expected a list of objects with {', '.join(sorted(keys))}")
    if not all(isinstance(one[key], (int, float)) for one in data for key in keys - {"engine"}):
        raise ValueError("expected numbers beside the engine")
    return [OutsideSpeed(**{key: one[key] for key in keys}).as_dict() for one in data]
