"""What is usual in an engine's valve train, by key of a scene: outside it a number is noted, not refused.

The ranges hold what is built, from a model engine to a lorry, and a margin. They are wide on purpose: they are to catch
slips of units and of decimals, which are far off.
"""

from dataclasses import dataclass
from math import pi

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
