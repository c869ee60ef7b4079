"""Scenes drawn across the extremes: built-in trains with every number moved, and chains of one to six masses.

Log-uniform over the ranges of the extremes: masses 0.1 g to 1 kg, contacts and stems 1e6 to 1e10 N/m, damping ratios
1e-4 to 3 or none, gaps 1 um to 1 mm or none, preloads 20 to 2000 N, 300 to 15 000 r/min. What the verifier could not
begin with LARGEST steps per revolution is drawn again: from twice that on no method counts as converged anyhow.
"""

import numpy as np
import tomli_w

from camopt.scene import InputError, Scene, build_train, load_scene, parse_scene
from camopt.verifier.convergence import FINEST_STEPS, first_steps

BASES = ("kodama", "motori-1", "motori-2", "pushrod-5mass")
REAL_BASES = ("exhaust-gas", "finger-hydraulic", "pushrod-hydraulic", "race-nested")
"""Trains with springs by tables, adjusters, friction and forces by the cam angle."""
MASS_KG = 1e-4, 1.0
STIFF_N_PER_M = 1e6, 1e10
SPRING_N_PER_M = 1e4, 1e6
DAMPING_RATIO = 1e-4, 3.0
GAP_MM = 1e-3, 1.0
PRELOAD_N = 20.0, 2000.0
SPEED_RPM = 300.0, 15_000.0
FACTOR = 1e-2, 1e2
"""By what a number of a built-in train is multiplied."""
LARGEST = FINEST_STEPS // 8
UNDAMPED = 0.15
NO_GAP = 0.2


def drawn(rng: np.random.Generator, real: bool = False) -> tuple[Scene, float]:
    """A scene that loads, and a crankshaft speed [r/min]; draws that nothing holds at rest are drawn again.

    A `real` one is one of REAL_BASES moved.
    """
    while True:
        data = moved(rng, REAL_BASES) if real else moved(rng) if rng.random() < 0.4 else chain(rng)
        try:
            scene, speed = parse_scene(tomli_w.dumps(data), data["name"]), between(rng, SPEED_RPM)
        except InputError:
            continue
        if first_steps(build_train(scene), scene.cam_speed(speed)) <= LARGEST:
            return scene, speed


def between(rng: np.random.Generator, ends: tuple[float, float]) -> float:
    """Log-uniform."""
    return float(np.exp(rng.uniform(*np.log(ends))))


def damper(rng: np.random.Generator, stiffness: float, mass: float) -> float:
    """Damping [N s/m] of a drawn ratio, or none."""
    return 0.0 if rng.random() < UNDAMPED else 2 * between(rng, DAMPING_RATIO) * float(np.sqrt(stiffness * mass))


def moved(rng: np.random.Generator, bases: tuple[str, ...] = BASES) -> dict:
    """A built-in train with masses, stiffnesses, dampings, gaps and preloads multiplied by drawn factors, and with them
    leakage, slip, and the forces of tables and by the cam angle."""
    scene = load_scene(str(rng.choice(bases)))
    data = scene.model_dump(exclude_none=True, mode="json")
    preload = between(rng, (0.2, 5.0))
    for mass in data["mass"]:
        mass["mass_kg"] = float(np.clip(mass["mass_kg"] * between(rng, FACTOR), *MASS_KG))
    lightest = min(mass["mass_kg"] for mass in data["mass"])
    for element in data["element"]:
        if element["law"] != "linear" or element["kind"] in ("adjuster", "friction"):
            law_moved(element, rng, preload)
            continue
        stiff = element["stiffness_N_per_m"] > SPRING_N_PER_M[1]
        ends = STIFF_N_PER_M if stiff else SPRING_N_PER_M
        element["stiffness_N_per_m"] = float(np.clip(element["stiffness_N_per_m"] * between(rng, FACTOR), *ends))
        element["damping_N_s_per_m"] = damper(rng, element["stiffness_N_per_m"], lightest)
        element["preload_N"] *= preload
        if element["cam_driven"] or element["gap_mm"] == 0.0:
            continue
        element["gap_mm"] = 0.0 if rng.random() < NO_GAP else between(rng, GAP_MM)
    for force in data["force"]:
        push = between(rng, (0.2, 2.0))
        force["table"] = [(angle, push * value) for angle, value in force["table"]]
    return {**data, "name": f"{scene.name}-moved"}


def law_moved(element: dict, rng: np.random.Generator, preload: float) -> None:
    """Multiplies the numbers of an element whose law is not linear; forces under preload all by the same `preload`."""
    for key, ends in (("stiffness_N_per_m", FACTOR), ("leak_N_s_per_m", FACTOR), ("slip_N", (0.1, 2.0))):
        if element.get(key) is not None:
            element[key] *= between(rng, ends)
    if element["law"] != "linear":
        element["preload_N"] *= preload
        element["damping_N_s_per_m"] *= between(rng, (0.1, 10.0))
    for key, factor in (("stiffness_table", between(rng, (0.3, 3.0))), ("force_table", preload)):
        if element.get(key) is not None:
            element[key] = [(at, factor * value) for at, value in element[key]]


def chain(rng: np.random.Generator) -> dict:
    """Cam, one to six masses joined by springs or contacts, valve spring and seat."""
    n = int(rng.integers(1, 7))
    masses = [{"name": f"m{i}", "mass_kg": between(rng, MASS_KG)} for i in range(n)]
    preload = between(rng, PRELOAD_N)

    def element(name, kind, ends, stiffness, mass, **more) -> dict:
        damping = damper(rng, stiffness, mass)
        return {"name": name, "kind": kind, "between": ends, "stiffness_N_per_m": stiffness,
                "damping_N_s_per_m": damping, **more}  # fmt: skip

    ends, kinds = ["ground", *(m["name"] for m in masses)], ["contact"]
    kinds += [str(rng.choice(["spring", "contact"])) for _ in range(n - 1)]
    gaps = [i for i, kind in enumerate(kinds) if kind == "contact"]
    with_gap = int(rng.choice(gaps))
    elements = []
    for i, kind in enumerate(kinds):
        more = {"cam_driven": i == 0}
        if i == with_gap and rng.random() > NO_GAP:
            more["gap_mm"] = between(rng, GAP_MM)
        if kind == "contact" and i > 0:
            masses[i - 1]["force_N"] = -between(rng, (1.0, preload / 4))
        elements.append(
            element(f"e{i}", kind, ends[i : i + 2], between(rng, STIFF_N_PER_M), masses[i]["mass_kg"], **more)
        )
    valve, mass = ends[-1], masses[-1]["mass_kg"]
    spring = element("spring", "spring", [valve, "ground"], between(rng, SPRING_N_PER_M), mass, preload_N=preload)
    seat = element("seat", "contact", ["ground", valve], between(rng, STIFF_N_PER_M), mass, preload_N=preload)
    operation = {"speeds_rpm": [5000], "band_rpm": [3000, 5000]}
    return {"format": 1, "name": f"chain-{n}", "valve": valve, "seat": "seat", "operation": operation,
            "mass": masses, "element": [*elements, spring, seat]}  # fmt: skip
