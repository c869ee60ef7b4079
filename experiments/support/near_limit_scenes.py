"""Ten random valve trains for `near_limit`: ordinary architectures, few masses, a narrow band around the speed of their
limits.

They are bucket (one mass below the cam), finger (two) and pushrod trains (three), with valve springs of lumped coils.
Numbers vary by 20 % about ordinary values; the first surge mode of the lightly damped springs has a damping ratio of
0.05 %.
"""

import numpy as np
import tomli_w

from camopt.scene import Scene, parse_scene

LIGHT = 5e-4
"""Damping ratio of the first surge mode of a lightly damped spring."""
SPREAD = 0.2
BAND_RPM = 200, 300
"""Range of the width of the band of speeds."""
CROSSING = 0.2, 0.6
"""For lightly damped springs: distance of the speed at which a harmonic of the cam coincides with the first surge mode
from the upper end of the band, as a share of its width."""
KINDS = (
    {"name": "bucket-light-coils", "masses": 1, "coils": (2,), "ratio": LIGHT, "faster": 1.04},
    {"name": "finger-light-coils", "masses": 2, "coils": (2,), "ratio": LIGHT},
    {"name": "pushrod-light-coils", "masses": 3, "coils": (2,), "ratio": 10 * LIGHT, "faster": 0.84},
    {"name": "pushrod-elastic", "masses": 3, "coils": (1,), "softer": 0.5, "faster": 0.63},
    {"name": "bucket-unequal-ramps", "masses": 1, "coils": (1,), "ramps": True, "faster": 1.03},
    {"name": "finger-unequal-ramps", "masses": 2, "coils": (), "ramps": True},
    {"name": "bucket-nested-springs", "masses": 1, "coils": (2, 1), "ratio": LIGHT, "faster": 0.85},
    {"name": "finger-nested-springs", "masses": 2, "coils": (1, 1)},
    {"name": "bucket-heavy", "masses": 1, "coils": (2,), "heavier": 1.8},
    {"name": "finger-light", "masses": 2, "coils": (1,), "heavier": 0.55, "faster": 1.15},
)
"""Kinds of trains: number of masses from cam to valve, lumped masses of each spring's chain of coils, and special
features. Where a train reaches its limits far above or below the speed up to which its spring keeps contact, the band
is moved there ("faster").
"""
MASSES_KG = {1: (0.12,), 2: (0.05, 0.085), 3: (0.055, 0.04, 0.125)}
NAMES = {1: ("valve",), 2: ("follower", "valve"), 3: ("lifter", "rocker", "valve")}
STIFFNESS_N_PER_M = {1: (9e7,), 2: (8e7, 9e7), 3: (4e7, 2e7, 8e7)}
SPRING = {"stiffness": 4.5e4, "preload": 260.0, "mass": 0.045}
"""Stiffness [N/m], preload [N] and mass [kg] of all chains together."""
SHARE = (0.68, 0.32)
"""Share of the outer and the inner of two nested springs."""
DESIGN = {
    "duration_deg": 144.0,
    "max_lift_mm": 9.4,
    "ramp_height_mm": 0.265,
    "ramp_velocity_mm_per_deg": 0.011,
    "ramp_foot_deg": 10.0,
    "acceleration_max_mm_per_deg2": 0.015,
    "acceleration_min_mm_per_deg2": -0.008,
    "jerk_max_mm_per_deg3": 0.003,
    "bounce_max_mm": 0.05,
    "jump_max_mm": 0.05,
    "seating_velocity_max_m_per_s": 0.8,
}
CLOSING_RAMP = {"closing_ramp_height_mm": 0.32, "closing_ramp_velocity_mm_per_deg": 0.009}
NOSE_M_PER_RAD2 = 0.0215
"""Deceleration at the nose [m/rad^2], 4/5 of the design's limit, that the spring just balances at the top speed."""


def drawn_scene(number: int) -> Scene:
    """The scene of a number from 0 to 9."""
    kind, rng = KINDS[number], np.random.default_rng([13, number])

    def around(value: float) -> float:
        return float(value * (1 + SPREAD * rng.uniform(-1, 1)))

    count, heavier, softer = kind["masses"], kind.get("heavier", 1.0), kind.get("softer", 1.0)
    masses = [
        {"name": name, "mass_kg": around(heavier * mass)}
        for name, mass in zip(NAMES[count], MASSES_KG[count], strict=True)
    ]
    for mass in masses[:-1]:  # held on the base circle, where they have no load because of the lash
        mass |= {"force_N": -around(15.0), "damping_N_s_per_m": around(15.0)}
    preload, gap_mm = around(SPRING["preload"]), around(0.15)
    elements, ends = [], ["ground", *NAMES[count]]
    for i, stiffness in enumerate(STIFFNESS_N_PER_M[count]):
        k = around(softer * stiffness)
        damping = 2 * around(0.05) * np.sqrt(k * masses[i]["mass_kg"])
        more = {"gap_mm": gap_mm if i == count - 1 else 0.0, "cam_driven": i == 0}
        elements.append(_element(f"contact_{i}", "contact", ends[i : i + 2], k, damping, **more))
    k = around(7.5e7)
    damping = 2 * around(0.2) * np.sqrt(k * masses[-1]["mass_kg"])
    elements.append(_element("seat", "contact", ["ground", "valve"], k, damping, preload_N=preload))
    chains = kind["coils"] or (0,)
    stiffness, coil_mass = around(SPRING["stiffness"]), around(SPRING["mass"])
    for c, coils in enumerate(chains):
        share = SHARE[c] if len(chains) > 1 else 1.0
        ratio = kind.get("ratio", around(0.01)) * (1 + 0.5 * c)
        more_masses, more_elements = _chain(c, coils, share * stiffness, share * preload, share * coil_mass, ratio)
        masses, elements = masses + more_masses, elements + more_elements
    inertia = sum(m["mass_kg"] for m in masses[:count]) + coil_mass / 3
    top = np.sqrt((preload + stiffness * 8.5e-3) / (inertia * NOSE_M_PER_RAD2)) * 60 / np.pi
    top *= around(0.95) * kind.get("faster", 1.0)
    width, inside = rng.uniform(*BAND_RPM), rng.uniform(*CROSSING)
    if "ratio" in kind:
        top = _crossing(masses, elements, top) + inside * width
    band = [float(round(top - width)), float(round(top))]
    operation = {"speeds_rpm": [band[1]], "band_rpm": band}
    design = DESIGN | (CLOSING_RAMP if kind.get("ramps") else {})
    data = {"format": 1, "name": kind["name"], "valve": "valve", "seat": "seat", "operation": operation,
            "design": design, "mass": masses, "element": elements}  # fmt: skip
    return parse_scene(tomli_w.dumps(data), kind["name"])


def _crossing(masses: list[dict], elements: list[dict], near_rpm: float) -> float:
    """The crankshaft speed nearest to `near_rpm` at which a cam harmonic excites the first chain's first surge mode."""
    coils = [m["mass_kg"] for m in masses if m["name"].startswith("coil_0")]
    k = next(e["stiffness_N_per_m"] for e in elements if e["name"] == "spring_0_0")
    surge_rpm = _surge(k, coils[0], len(coils)) * 60 / np.pi
    return surge_rpm / max(1, round(surge_rpm / near_rpm))


def _surge(k: float, mass: float, coils: int) -> float:
    """First surge frequency [rad/s] of a chain of equal coils between springs of stiffness k, held at both ends."""
    return float(2 * np.sqrt(k / mass) * np.sin(np.pi / (2 * (coils + 1))))


def _element(name, kind, ends, stiffness, damping, **more) -> dict:
    return {"name": name, "kind": kind, "between": ends, "stiffness_N_per_m": float(stiffness),
            "damping_N_s_per_m": float(damping), **more}  # fmt: skip


def _chain(number: int, coils: int, stiffness: float, preload: float, mass: float, ratio: float):
    """(masses, elements) of a spring as a chain of lumped coils between valve and ground, of a total stiffness.

    The dampers of the coils are chosen to give the first surge mode the damping ratio `ratio`.
    """
    names = [f"coil_{number}_{i}" for i in range(coils)]
    k, each = stiffness * (coils + 1), mass / max(coils, 1)
    surge = _surge(k, each, coils) if coils else float(np.sqrt(stiffness / 0.1))
    ends = ["valve", *names, "ground"]
    elements = [
        _element(f"spring_{number}_{i}", "spring", ends[i : i + 2], k, 2 * ratio * k / surge, preload_N=preload)
        for i in range(coils + 1)
    ]
    return [{"name": name, "mass_kg": float(each)} for name in names], elements
