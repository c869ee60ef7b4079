"""motori-1 with a valve spring of two halves and a coil between them: a mode of 359 Hz, as lightly damped as asked."""

import numpy as np

from camopt.scene import Scene, load_scene
from camopt.scene.schema import Element, Mass

SHAPE = ("acceleration_max_mm_per_deg2", "acceleration_min_mm_per_deg2", "jerk_max_mm_per_deg3", "nose_deg")
HALF_N_PER_M = 76_400.0
COIL_KG = 0.03
FREQUENCY_HZ = float(np.sqrt(2 * HALF_N_PER_M / COIL_KG) / (2 * np.pi))


def coil_scene(band_rpm=(6065.0, 6245.0), damping_ratio=5e-4, preload_N=1200.0, **limits) -> Scene:
    """The scene without limits on the shape. With a polydyne and 1200 N its contacts hold by some 300 N but for two
    windows about 5387 and 6157 r/min, where the cam's harmonics 8 and 7 shake the coil; no listed speed is in them."""
    base = load_scene("motori-1")
    damping = damping_ratio * np.sqrt(2 * HALF_N_PER_M * COIL_KG)  # of each half, twice of which damps the coil
    half = {"kind": "spring", "stiffness_N_per_m": HALF_N_PER_M, "damping_N_s_per_m": damping, "preload_N": preload_N}
    halves = (
        Element(name="spring_upper", between=("valve", "coil"), **half),
        Element(name="spring_lower", between=("coil", "ground"), **half),
    )
    kept = tuple(e for e in base.element if e.name != "spring")
    return base.model_copy(
        update={
            "mass": (*base.mass, Mass(name="coil", mass_kg=COIL_KG)),
            "element": (*kept, *halves),
            "operation": base.operation.model_copy(update={"band_rpm": band_rpm}),
            "design": base.design.model_copy(update={**dict.fromkeys(SHAPE), **limits}),
        }
    )
