"""Notes on a scene that runs but is unusual: what, where, the usual range, and the unit that was probably meant.

The ranges hold what is built, from a model engine to a lorry, and a margin: they are to catch slips of units and of
decimals, which are far off.
"""

import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from camopt.scene.element import Element
from camopt.scene.laws import CONTACT_LAWS
from camopt.scene.parts import own_number
from camopt.scene.rest import static_forces
from camopt.scene.schema import Scene
from camopt.scene.table import Table
from camopt.scene.train import build_train
from camopt.scene.units import MM, UM


@dataclass(frozen=True)
class Usual:
    """Range of the size of a number in its key's unit, zero left out, with what makes its ends.

    `slips`: unit that may have been meant -> factor from a number in that unit to the key's unit.
    """

    low: float
    high: float
    reason: str
    slips: dict[str, float]


KEYS = tomllib.loads(Path(__file__).with_name("keys.toml").read_text(encoding="utf-8"))
"""By table and key of a scene what it is: a sentence, or that as `meaning` beside what is usual."""
SLIPS = KEYS.pop("slips")
"""Units that may have been meant, by what several keys call them."""


def _usual(said: dict) -> Usual:
    slips = said.get("slips", {})
    return Usual(said["low"], said["high"], said["reason"], SLIPS[slips] if isinstance(slips, str) else slips)


USUAL = {
    f"{table}.{key}": _usual(said)
    for table, keys in KEYS.items()
    for key, said in keys.items()
    if not isinstance(said, str)
}
"""Table.key of a scene -> what is usual there."""

STIFF = Usual(1e6, 1e10, "from a slender pushrod's to solid steel", SLIPS["stiffness"])
"""Stiffness of the contact that the cam drives and of the seat, N/m: those of springs are no tenth of it."""
CONTACT_AT_UM = 10.0
"""Compression [um] at which the tangent of a law of contacts is held against `STIFF`."""


MEANT = "if it is meant, nothing needs doing"
LEAST_SEAT_N = 5.0
"""Force on a closed valve's seat [N] below what the spring of a model engine has."""
SAME_SEAT_FORCE = 0.2
"""Share by which the seat's preload may differ from what presses on it at rest; an adjuster takes off a tenth."""


def scene_notes(scene: Scene) -> tuple[str, ...]:
    """Sentences on a duration that camopt chose, on keys with an unusual number, on a lash above the ramps, and on a
    closed valve that nothing presses on its seat, or not with the force that the seat states."""
    notes = []
    for path, usual in USUAL.items():
        table, key = path.split(".")
        notes += _note_of(path, usual, list(_given(scene, table, key)))
    notes += _note_of("element.stiffness_N_per_m", STIFF, list(_stiff(scene)))
    return tuple(_duration_note(scene) + notes + _lash_note(scene) + _seat_note(scene))


def speed_notes(option: str, speeds_rpm: Iterable[float]) -> list[str]:
    """The same on crankshaft speeds [r/min] from elsewhere; `option` says from where."""
    return _note_of(option, USUAL["operation.speeds_rpm"], [("", speed) for speed in speeds_rpm])


def _given(scene: Scene, table: str, key: str) -> Iterable[tuple[str, float]]:
    """Names of the rows and their numbers under a key; nothing where a table or key is left out."""
    content = getattr(scene, table)
    rows: tuple[Table, ...] = content if isinstance(content, tuple) else () if content is None else (content,)
    for row in rows:
        if isinstance(row, Element) and key == "stiffness_N_per_m":
            values = [stiffness for _, stiffness in row.stiffness_table or ()]
            if row.form == "linear" and not _is_stiff(scene, row):
                values = [row.stiffness_N_per_m]
        elif isinstance(row, Element) and key == "force_table":
            rows_of_it = row.force_table if row.kind == "spring" else None
            values = [rows_of_it[-1][0] - rows_of_it[0][0]] if rows_of_it else []
        else:
            value = getattr(row, key)
            values = value if isinstance(value, tuple) else [value]
        for value in values:
            if value is not None:
                yield getattr(row, "name", ""), value


def _is_stiff(scene: Scene, element: Element) -> bool:
    return element.kind == "contact" and (element.cam_driven or element.name == scene.seat)


def _stiff(scene: Scene) -> Iterable[tuple[str, float]]:
    """Stiffness [N/m] of the contacts that must be stiff; of a law of contacts the tangent at a usual compression."""
    for element in scene.element:
        stiffness = element.stiffness_N_per_m
        if element.law in CONTACT_LAWS and stiffness is not None:
            law = CONTACT_LAWS[element.law].law(stiffness, own_number(element))
            yield element.name, law.slope(CONTACT_AT_UM * UM)
        elif element.form == "linear" and stiffness is not None and _is_stiff(scene, element):
            yield element.name, stiffness


def _note_of(where: str, usual: Usual, given: list[tuple[str, float]]) -> list[str]:
    """The note on the number that is farthest off among those given under one key, if any is."""
    far = [(max(usual.low / abs(v), abs(v) / usual.high), name, v) for name, v in given if v != 0]
    far = [one for one in far if one[0] > 1]
    if not far:
        return []
    _, name, value = max(far)
    of = f" of {name!r}" if name else ""
    more = f", and {len(far) - 1} more," if len(far) > 1 else ""
    usual_range = f"the usual {usual.low:g} to {usual.high:g} ({usual.reason})"
    slips = {unit: value * factor for unit, factor in usual.slips.items()}
    likely = [
        f"{unit}, which would be {there:g}" for unit, there in slips.items() if usual.low <= abs(there) <= usual.high
    ]
    cause = f"; it looks like a number in {likely[0]} here" if likely else ""
    return [f"{where}: {value:g}{of}{more} is outside {usual_range}{cause}; {MEANT}"]


def _duration_note(scene: Scene) -> list[str]:
    """What duration camopt chose, where the scene leaves it to its duration_at."""
    design = scene.design
    if design is None or not design.duration_chosen:
        return []
    asked = ", ".join(f"{least:g} deg at {height:g} mm" for height, least, _ in design.duration_at if least)
    return [
        f"design.duration_deg: {design.duration_deg:g} cam deg between the ramp tops were chosen, a fiftieth more than "
        f"the fewest with which a cam within the limits on its shape is open for {asked}"
    ]


def _lash_note(scene: Scene) -> list[str]:
    if scene.design is None or scene.valve is None:
        return []
    lash = build_train(scene).lash / MM
    short = [f"{side} ramp's {height:g} mm" for height, _, side in scene.design.ramps() if lash >= height]
    if not short:
        return []
    return [
        f"element.gap_mm: the lash of {lash:g} mm between cam and valve is not below the {' and the '.join(short)}: "
        f"the cam meets the train on its flank, faster than the ramp would; lower the gaps or raise the ramp; {MEANT}"
    ]


def _why_slack(scene: Scene, seat_N: float) -> str:
    """What a scene lacks in which no spring presses on the closed valve; `seat_N` is what the seat states."""
    measured = [e for e in scene.element if e.kind == "spring" and e.force_table and not e.installed_mm]
    if not measured:
        return ": a valve spring has a preload_N, the force on the closed valve"
    at, force = np.array(measured[0].force_table).T
    closed = float(np.interp(seat_N, force, at)) if seat_N and force[0] < seat_N <= force[-1] else None
    example = (
        "" if closed is None else f"; with installed_mm = {closed:.4g} it is the {seat_N:g} N that the seat states"
    )
    return (
        f": the force_table of {measured[0].name!r} counts compression from the closed valve; where it was measured "
        f"from the free length, give installed_mm, the compression with the valve closed{example}"
    )


def _seat_note(scene: Scene) -> list[str]:
    """On the force that closes the valve: whether there is one, and whether the seat's preload says the same."""
    if scene.seat is None:
        return []
    train = build_train(scene)
    force, stated = float(static_forces(train, np.zeros(1))[0, train.seat]), float(train.preload[train.seat])
    if force < LEAST_SEAT_N:
        weak = [e for e in scene.element if e.name != scene.seat and 0 < e.preload_N < LEAST_SEAT_N]
        cause = [f"{e.preload_N:g} of {e.name!r} looks like kN, which would be {1e3 * e.preload_N:g}" for e in weak]
        why = f"; {cause[0]} here" if cause else _why_slack(scene, stated)
        return [f"element.preload_N: at rest the valve is pressed on its seat with only {force:.2g} N{why}; {MEANT}"]
    if stated and abs(force - stated) > SAME_SEAT_FORCE * max(force, stated):
        return [
            f"element.preload_N: at rest the springs press the valve on its seat with {force:.3g} N, and the preload "
            f"of the seat {scene.seat!r} is {stated:g} N: the two are one force; {MEANT}"
        ]
    return []
