"""The limits by speed: how much of each limit on the motion is used at each judged speed, and over the band."""

from camopt.report.folder import RunFolder
from camopt.report.limits import share_of
from camopt.report.wording import shown
from camopt.scene.quantities import LESS_IS_WORSE, QUANTITIES, is_number
from camopt.verifier.record import worst_case_value

NEAR = 0.9
"""Share of a limit from which a cell says that it is near."""
NO_PRICE = "–"


def matrix(run: RunFolder, limits: list[dict]) -> dict:
    """`speeds`, and `rows` with label, demand, price and `cells`: words, class, and whether it is the row's worst.

    A limit on the motion has a cell for each speed and one for the band. One on the cam's shape holds at every speed:
    its row has one cell, which spans them all. The price is what one per cent more of the limit buys.
    """
    judged = run.verification.by_speed
    design, worth = run.scene.get("design"), run.design.get("limit_worth")
    design, worth = (part if isinstance(part, dict) else {} for part in (design, worth))
    worst = (run.verification.get("band") or {}).get("worst") or {}
    of_motion = {quantity.limit for quantity in QUANTITIES.values()}
    shape = [
        {**_named(row["label"], row["limit"], row["unit"], worth.get(row["key"])), "shape": _of_shape(row)}
        for row in limits
        if row["key"] not in of_motion
    ]
    rows = []
    for quantity in QUANTITIES.values():
        limit = design.get(quantity.limit or "")
        if not is_number(limit):
            continue
        least = quantity.name in LESS_IS_WORSE
        values = [worst_case_value(speed, quantity.name)[0] for speed in judged]
        values += [_number((worst.get(quantity.name) or {}).get("value"))] if worst else []
        shares = [share_of(limit, least, value) for value in values]
        known = [share for share in shares if share is not None]
        first = shares.index(max(known)) if known and max(known) > 0 else None
        cells = [_cell(share, i == first) for i, share in enumerate(shares)]
        demand = f"at {'least' if least else 'most'} {shown(limit)}"
        rows.append({**_named(quantity.label, demand, quantity.unit, None), "cells": cells, "shape": None})
    speeds = [shown(speed.get("speed_rpm")) for speed in judged]
    rows += shape
    priced = any(row["price"] != NO_PRICE for row in rows)
    return {"speeds": speeds + ["band"] * bool(worst), "rows": rows, "priced": priced}


def _number(value) -> float | None:
    return value if is_number(value) else None


def _named(label: str, demand: str, unit: str, price) -> dict:
    return {
        "label": label,
        "demand": f"{demand} {unit}".strip(),
        "price": shown(price, 2) if is_number(price) else NO_PRICE,
    }


def _of_shape(row: dict) -> dict:
    """The cell of a limit on the shape; where no share can be told, whether it holds."""
    kind = {True: "calm", False: "bad", None: "unknown"}[row["held"]]
    cell = _cell(row["share"]) if row["share"] is not None else {"words": row["state"], "worst": False}
    return cell | {"kind": kind}


def _cell(share: float | None, worst: bool = False) -> dict:
    if share is None:
        return {"words": "?", "kind": "unknown", "worst": False}
    words = f"{100 * share:.0f} %" if share < 10 else f"{share:.0f} times"
    kind = "bad" if share > 1 + 1e-6 else "near" if share >= NEAR else "calm"
    return {"words": ("✗ " if kind == "bad" else "") + words, "kind": kind, "worst": worst}
