"""Notes on a scene that runs but is unusual: what, where, the usual range, and the unit that was probably meant.

The ranges hold what is built, from a model engine to a lorry, and a margin: they are to catch slips of units and of
decimals, which are far off.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from math import pi

import numpy as np

from camopt.scene.element import Element
from camopt.scene.laws import CONTACT_LAWS
from camopt.scene.parts import own_number
from camopt.scene.rest import static_forces
from camopt.scene.schema import Scene
from camopt.scene.table import Table
from camopt.scene.train import build_train
from camopt.scene.units import MM, UM

INCH = 25.4
"""Millimetres in an inch."""
POUND = 0.45359237
"""Kilograms in a pound."""
LOAD_PER_INCH = 175.12684
"""N/m in a pound-force per inch."""


@dataclass(frozen=True)
class Usual:
    """Range of the size of a number in its key's unit, zero left out, with what makes its ends.

    `slips`: unit that may have been meant -> factor from a number in that unit to the key's unit.
    """

    low: float
    high: float
    reason: str
    slips: dict[str, float]


_LENGTH = {"m": 1e3, "inch": INCH, "um": 1e-3}
_STIFFNESS = {"N/mm": 1e3, "lbf/inch": LOAD_PER_INCH, "kN/mm": 1e6}
_SPEED = Usual(
    100, 20_000, "from cranking to a racing engine, crankshaft r/min", {"1/s": 60, "rad/s": 30 / pi, "1000 r/min": 1e3}
)
_MODULUS = Usual(40, 700, "from light metal to hard metal", {"MPa": 1e-3, "Pa": 1e-9})
_RAMP_HEIGHT = Usual(0.02, 1, "what covers a lash and its growth", _LENGTH)
_RAMP_VELOCITY = Usual(1e-3, 0.1, "what keeps the seat whole", {"mm/rad": pi / 180, "um/deg": 1e-3})
_BY_ANGLE = {"m/rad^2": 1e3 * (pi / 180) ** 2, "mm/rad^2": (pi / 180) ** 2}

USUAL = {
    "mass.mass_kg": Usual(1e-4, 3, "from a coil of a spring to a lorry's reduced train", {"g": 1e-3, "lb": POUND}),
    "mass.damping_N_s_per_m": Usual(0, 1e4, "up to a damper", {}),
    "mass.force_N": Usual(0, 5e3, "up to the gas force on an exhaust valve", {"mN": 1e-3}),
    "element.stiffness_N_per_m": Usual(500, 1e10, "from a lifter's plunger spring to a solid steel part", _STIFFNESS),
    "element.damping_N_s_per_m": Usual(0, 1e5, "up to a stiff contact damped by half of what is critical", {}),
    "element.dissipation_s_per_m": Usual(0.05, 1.5, "0.12 to 0.48 of steel, and a margin", {"s/mm": 1e3}),
    "element.preload_N": Usual(0, 2e4, "up to the springs of a racing engine, and a margin", {"mN": 1e-3}),
    "element.installed_mm": Usual(0.5, 60, "compression of a closed valve's spring", _LENGTH),
    "element.force_table": Usual(1, 100, "mm of compression over the rows of a spring", _LENGTH),
    "element.gap_mm": Usual(1e-3, 50, "from a clearance that can be set to a spring's whole travel", _LENGTH),
    "element.leak_N_s_per_m": Usual(1e4, 1e9, "from a worn adjuster to a tight one", {"N s/mm": 1e3}),
    "element.spring_N_per_m": Usual(100, 1e5, "of plunger springs", _STIFFNESS),
    "element.stroke_mm": Usual(0.5, 15, "of a plunger", _LENGTH),
    "element.check_travel_mm": Usual(1e-3, 1, "of a check valve's ball", _LENGTH),
    "element.slip_N": Usual(0.1, 500, "from a valve's stem seal to a damper spring's rubbing coils", {"mN": 1e-3}),
    "operation.speeds_rpm": _SPEED,
    "operation.band_rpm": _SPEED,
    "operation.cam_per_crank": Usual(0.5, 1, "0.5 of a four-stroke engine, 1 where speeds are the camshaft's", {}),
    "design.duration_deg": Usual(70, 180, "cam degrees between the ramp tops", {"crank degrees": 0.5, "rad": 180 / pi}),
    "design.max_lift_mm": Usual(1, 30, "from a model engine to a large gas engine", _LENGTH),
    "design.ramp_height_mm": _RAMP_HEIGHT,
    "design.closing_ramp_height_mm": _RAMP_HEIGHT,
    "design.ramp_velocity_mm_per_deg": _RAMP_VELOCITY,
    "design.closing_ramp_velocity_mm_per_deg": _RAMP_VELOCITY,
    "design.acceleration_max_mm_per_deg2": Usual(1e-3, 0.2, "of cams that are ground", _BY_ANGLE | {"um/deg^2": 1e-3}),
    "design.acceleration_min_mm_per_deg2": Usual(1e-4, 0.1, "of cams that are ground", _BY_ANGLE | {"um/deg^2": 1e-3}),
    "design.jerk_max_mm_per_deg3": Usual(1e-5, 0.2, "of cams that are ground", {"um/deg^3": 1e-3}),
    "design.snap_max_mm_per_deg4": Usual(1e-6, 0.1, "of cams that are ground", {"um/deg^4": 1e-3}),
    "design.nose_radius_min_mm": Usual(0.5, 200, "of noses that are ground", _LENGTH),
    "design.concave_radius_min_mm": Usual(5, 2000, "of grinding wheels", _LENGTH),
    "design.entrainment_min_m_per_s": Usual(0.01, 20, "of flat followers", {"mm/s": 1e-3}),
    "design.bounce_max_mm": Usual(1e-4, 1, "from what can be measured to what breaks a seat", _LENGTH),
    "design.jump_max_mm": Usual(1e-4, 1, "from what can be measured to what breaks a follower", _LENGTH),
    "design.jump_max_deg": Usual(
        0.01, 90, "from what an encoder resolves to a follower that hardly touches", {"rad": 180 / pi}
    ),
    "design.seating_velocity_max_m_per_s": Usual(0.02, 5, "from a car at idle to a racing engine", {"mm/s": 1e-3}),
    "design.contact_force_max_N": Usual(50, 1e5, "from a model engine to a large gas engine", {"kN": 1e3}),
    "design.contact_force_min_N": Usual(0.1, 1e4, "from a model engine to a large gas engine", {"kN": 1e3}),
    "geometry.base_radius_mm": Usual(3, 150, "from a model engine to a large gas engine", _LENGTH),
    "geometry.face_width_mm": Usual(2, 150, "from a model engine to a large gas engine", _LENGTH),
    "geometry.roller_radius_mm": Usual(2, 150, "from a model engine to a large gas engine", _LENGTH),
    "geometry.pad_radius_mm": Usual(2, 1000, "from a model engine to a nearly flat pad", _LENGTH),
    "geometry.pivot_mm": Usual(0.5, 500, "from a model engine to a large gas engine", _LENGTH),
    "geometry.arm_mm": Usual(4, 500, "from a model engine to a large gas engine", _LENGTH),
    "geometry.valve_arm_mm": Usual(4, 500, "from a model engine to a large gas engine", _LENGTH),
    "geometry.contact_width_mm": Usual(1, 150, "from a model engine to a large gas engine", _LENGTH),
    "geometry.rocker_ratio": Usual(0.4, 3, "valve lift over follower lift", {}),
    "geometry.cam_modulus_GPa": _MODULUS,
    "geometry.follower_modulus_GPa": _MODULUS,
    "geometry.hertz_max_MPa": Usual(200, 3000, "from cast iron to hard coatings", {"Pa": 1e-6, "GPa": 1e3}),
    "geometry.oil_viscosity_mPa_s": Usual(1, 200, "of engine oils from hot to cold", {"Pa s": 1e3}),
    "geometry.oil_pressure_viscosity_per_GPa": Usual(5, 40, "of oils", {"1/Pa": 1e9}),
    "geometry.roughness_um": Usual(0.02, 3, "from polished to coarsely ground", {"mm": 1e3, "m": 1e6}),
    "grinding.error_um": Usual(0.05, 50, "from a finely ground master cam to a worn grinder", {"mm": 1e3, "m": 1e6}),
}
"""Table.key of a scene -> what is usual there."""

STIFF = Usual(1e6, 1e10, "from a slender pushrod's to solid steel", _STIFFNESS)
"""Stiffness of the contact that the cam drives and of the seat, N/m: those of springs are no tenth of it."""
CONTACT_AT_UM = 10.0
"""Compression [um] at which the tangent of a law of contacts is held against `STIFF`."""


MEANT = "if it is meant, nothing needs doing"
LEAST_SEAT_N = 5.0
"""Force on a closed valve's seat [N] below what the spring of a model engine has."""
SAME_SEAT_FORCE = 0.2
"""Share by which the seat's own preload may differ from what presses on it at rest: a hydraulic adjuster takes off a
tenth."""


def scene_notes(scene: Scene) -> tuple[str, ...]:
    """A sentence on a duration that camopt chose, one per key with an unusual number, in the order of `USUAL`, one on a
    lash above the ramps, and one on a closed valve that nothing presses on its seat, or not with the force that the
    seat states."""
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
