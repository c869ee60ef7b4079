"""Notes on unusual numbers of a scene that runs: value, key, usual range, and the unit that was probably meant.

The ranges cover what is built, from a model engine to a lorry, with a margin. They are meant to catch mistakes of units
and of decimal places, which lie far outside.
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
    """Usual range of the magnitude of a nonzero number in its key's unit, with the reason for both ends.

    `slips`: unit that may have been meant -> factor from a number in that unit to the key's unit.
    """

    low: float
    high: float
    reason: str
    slips: dict[str, float]


KEYS = tomllib.loads(Path(__file__).with_name("keys.toml").read_text(encoding="utf-8"))
"""Meaning of each key of a scene, by table: a sentence, or a record with `meaning` and the usual range."""
SLIPS = KEYS.pop("slips")
"""Sets of units that may have been meant, by the names under which several keys refer to them."""


def _usual_range(entry: dict) -> Usual:
    slips = entry.get("slips", {})
    return Usual(entry["low"], entry["high"], entry["reason"], SLIPS[slips] if isinstance(slips, str) else slips)


USUAL = {
    f"{table}.{key}": _usual_range(said)
    for table, keys in KEYS.items()
    for key, said in keys.items()
    if not isinstance(said, str)
}
"""Table.key of a scene -> its usual range."""

STIFF = Usual(1e6, 1e10, "from a slender pushrod's to solid steel", SLIPS["stiffness"])
"""Usual stiffness of the seat and of the contact that the cam drives, N/m; springs have less than a tenth of it."""
CONTACT_AT_UM = 10.0
"""Compression [um] at which the tangent stiffness of a contact law is compared with `STIFF`."""


MEANT = "if this is intended, ignore the note"
LEAST_SEAT_N = 5.0
"""Force on a closed valve's seat [N] that even the spring of a model engine exceeds."""
SAME_SEAT_FORCE = 0.2
"""Largest relative difference between the seat's preload and the force on it at rest; an adjuster takes off a tenth."""


def scene_notes(scene: Scene) -> tuple[str, ...]:
    """Notes on a duration that camopt chose, on numbers outside their usual range, on a lash that exceeds a ramp, and
    on a closed valve that is hardly pressed on its seat, or with a force other than the seat's preload."""
    notes = []
    for path, usual in USUAL.items():
        table, key = path.split(".")
        notes += _note_of(path, usual, list(_numbers_under(scene, table, key)))
    notes += _note_of("element.stiffness_N_per_m", STIFF, list(_stiff_contacts(scene)))
    return tuple(_duration_note(scene) + notes + _lash_note(scene) + _seat_note(scene))


def speed_notes(option: str, speeds_rpm: Iterable[float]) -> list[str]:
    """Notes on crankshaft speeds [r/min] given elsewhere than in a scene; `option` is where."""
    return _note_of(option, USUAL["operation.speeds_rpm"], [("", speed) for speed in speeds_rpm])


def _numbers_under(scene: Scene, table: str, key: str) -> Iterable[tuple[str, float]]:
    """Names of the rows and their numbers under a key; nothing if the table or key is left out."""
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


def _stiff_contacts(scene: Scene) -> Iterable[tuple[str, float]]:
    """Names and stiffnesses [N/m] to compare with `STIFF`; for a contact law, the tangent at `CONTACT_AT_UM`."""
    for element in scene.element:
        stiffness = element.stiffness_N_per_m
        if element.law in CONTACT_LAWS and stiffness is not None:
            law = CONTACT_LAWS[element.law].law(stiffness, own_number(element))
            yield element.name, law.slope(CONTACT_AT_UM * UM)
        elif element.form == "linear" and stiffness is not None and _is_stiff(scene, element):
            yield element.name, stiffness


def _note_of(where: str, usual: Usual, numbers: list[tuple[str, float]]) -> list[str]:
    """The note on the number under one key that is farthest outside its usual range, if any is."""
    ratios = [(max(usual.low / abs(v), abs(v) / usual.high), name, v) for name, v in numbers if v != 0]
    far = [ratio for ratio in ratios if ratio[0] > 1]
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
    """The note on a duration that camopt chose because the scene leaves it to its duration_at."""
    design = scene.design
    if design is None or not design.duration_chosen:
        return []
    durations = ", ".join(f"{least:g} deg at {height:g} mm" for height, least, _ in design.duration_at if least)
    return [
        f"design.duration_deg: {design.duration_deg:g} cam deg between the ramp tops were chosen, a fiftieth more than "
        f"the fewest with which a cam within the limits on its shape is open for {durations}"
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


def _why_unpressed(scene: Scene, seat_N: float) -> str:
    """What is probably missing in a scene whose closed valve no spring presses; `seat_N` is the seat's preload."""
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
    """The note on a force on the closed valve's seat that is too small or differs from the seat's preload."""
    if scene.seat is None:
        return []
    train = build_train(scene)
    force, stated = float(static_forces(train, np.zeros(1))[0, train.seat]), float(train.preload[train.seat])
    if force < LEAST_SEAT_N:
        weak = [e for e in scene.element if e.name != scene.seat and 0 < e.preload_N < LEAST_SEAT_N]
        cause = [f"{e.preload_N:g} of {e.name!r} looks like kN, which would be {1e3 * e.preload_N:g}" for e in weak]
        why = f"; {cause[0]} here" if cause else _why_unpressed(scene, stated)
        return [f"element.preload_N: at rest the valve is pressed on its seat with only {force:.2g} N{why}; {MEANT}"]
    if stated and abs(force - stated) > SAME_SEAT_FORCE * max(force, stated):
        return [
            f"element.preload_N: at rest the springs press the valve on its seat with {force:.3g} N, and the preload "
            f"of the seat {scene.seat!r} is {stated:g} N: both should be the same force; {MEANT}"
        ]
    return []
