"""Extreme and invalid values, and functions that put them into records and texts."""

from copy import deepcopy
from random import Random
from typing import Any

NUMBERS = (
    *(0, 0.0, -0.0, -1, 1, 2, 1e-9, -1e-9, 1e-300, 5e-324, -5e-324, 1e9, -1e9, 1e100, 1e308, -1e308),
    *(2**31, 2**63, -(2**63), 10**30, float("inf"), float("-inf"), float("nan"), True, False),
)
TEXTS = (
    "", " ", "0", "nan", "valve", "ground", "spring", "contact", "friction", "adjuster", "table", "hertz", "../../x",
    "<script>alert(1)</script>", "'; DROP TABLE row; --", "${HOME}", "{{ 7*7 }}", "%s%n", "\t\n", "\u202e", "ä" * 300,
    "a" * 20_000, "\x00", "\ufffe", "\\", '"', "$\\frac{",
)  # fmt: skip
FACTORS = (0.0, -1.0, 1e-12, 1e-6, 1e-3, 0.1, 0.5, 0.9, 1.1, 2.0, 10.0, 1e3, 1e6, 1e12)


def hostile(draw: Random) -> Any:
    """A number, a text, or a nested list or dictionary of them."""
    return draw.choice(
        (
            lambda: draw.choice(NUMBERS),
            lambda: draw.choice(TEXTS),
            lambda: [draw.choice(NUMBERS) for _ in range(draw.randrange(4))],
            lambda: {draw.choice(TEXTS[2:9]): draw.choice(NUMBERS)},
            lambda: [[draw.choice(NUMBERS), draw.choice(NUMBERS)] for _ in range(draw.randrange(5))],
        )
    )()


def places(record: Any, at: tuple = ()) -> list[tuple]:
    """The path of every value in nested dictionaries and lists."""
    items = record.items() if isinstance(record, dict) else enumerate(record) if isinstance(record, list) else ()
    inside = [path for key, value in items for path in places(value, (*at, key))]
    return [*([at] if at else []), *inside]


def spoiled(record: dict, draw: Random, most: int = 3) -> dict:
    """A copy of a record with one to `most` faults: a value replaced, scaled, removed, repeated or renamed."""
    record = deepcopy(record)
    for _ in range(draw.randint(1, most)):
        paths = places(record)
        if not paths:
            return record
        *above, key = draw.choice(paths)
        holder = record
        for step in above:
            holder = holder[step]
        _spoil(holder, key, draw)
    return record


def _spoil(holder: Any, key: Any, draw: Random) -> None:
    value = holder[key]
    kinds = ["replace", "remove", "double", "rename"]
    if isinstance(value, int | float) and not isinstance(value, bool):
        kinds += ["scale"] * 8 + ["extreme"] * 4
    kind = draw.choice(kinds)
    if kind == "replace":
        holder[key] = hostile(draw)
    elif kind == "extreme":
        holder[key] = draw.choice(NUMBERS)
    elif kind == "scale":
        holder[key] = value * draw.choice(FACTORS)
    elif kind == "remove":
        del holder[key]
    elif kind == "double" and isinstance(holder, list):
        holder.insert(draw.randrange(len(holder) + 1), deepcopy(value))
    elif isinstance(holder, dict):
        holder[draw.choice((*TEXTS[:9], f"{key}s", f"{key}".upper()))] = holder.pop(key)


def torn(text: str | bytes, draw: Random) -> bytes:
    """The bytes of a text, cut off, partly repeated, or with some bytes inserted or changed."""
    data = bytearray(text if isinstance(text, bytes) else text.encode())
    kind = draw.randrange(4)
    at = draw.randrange(len(data) + 1)
    if kind == 0:
        return bytes(data[:at])
    if kind == 1:
        return bytes(data[:at] + data)
    if kind == 2:
        return bytes(data[:at]) + draw.randbytes(draw.randrange(1, 40)) + bytes(data[at:])
    for _ in range(draw.randint(1, 8) if data else 0):
        data[draw.randrange(len(data))] = draw.randrange(256)
    return bytes(data)
