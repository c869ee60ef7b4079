"""Scenes whose motion decides; one of them has a valve spring of two halves and a lightly damped coil between them."""

from pathlib import Path

import numpy as np

from camopt.cam.families.polydyne import polydyne
from camopt.scene import Scene, build_train, load_scene
from camopt.scene.rest import state_at_rest
from camopt.scene.schema import Element, Mass

SHAPE = ("acceleration_max_mm_per_deg2", "acceleration_min_mm_per_deg2", "jerk_max_mm_per_deg3", "nose_deg")
HALF_N_PER_M = 76_400.0
COIL_KG = 0.03
FREQUENCY_HZ = float(np.sqrt(2 * HALF_N_PER_M / COIL_KG) / (2 * np.pi))
"""Of the coil, 359 Hz."""


REAL = load_scene(Path(__file__).parents[1] / "scene/real.toml")
"""A scene with every element of real trains."""


def from_rest(scene: Scene | str, speed_rpm: float, family=polydyne) -> tuple[tuple, np.ndarray]:
    """(train, cam, cam speed [rad/s]) of a scene at a speed of the crankshaft, as methods take them, and its rest."""
    scene = load_scene(scene) if isinstance(scene, str) else scene
    train = build_train(scene)
    return (train, family(scene), scene.cam_speed(speed_rpm)), state_at_rest(train)


def moving(name: str, band_rpm: tuple[float, float] | None = None, **limits) -> Scene:
    """A built-in scene without limits on the shape, with other limits and another band."""
    base = load_scene(name)
    design = base.design.model_copy(update={**dict.fromkeys(SHAPE), **limits})
    operation = base.operation.model_copy(update={"band_rpm": band_rpm} if band_rpm else {})
    return base.model_copy(update={"design": design, "operation": operation})


def with_elements(scene: Scene, **changes: dict) -> Scene:
    """The scene with other numbers of elements, by the elements' names."""
    elements = tuple(e.model_copy(update=changes.get(e.name, {})) for e in scene.element)
    return scene.model_copy(update={"element": elements})


def coil_scene(band_rpm=(6065.0, 6245.0), damping_ratio=5e-4, preload_N=1200.0, **limits) -> Scene:
    """The scene without limits on the shape. With a polydyne and 1200 N its contacts hold by some 300 N but for two
    windows about 5387 and 6157 r/min, where the cam's harmonics 8 and 7 shake the coil; no listed speed is in them."""
    base = moving("motori-1", band_rpm, **limits)
    damping = damping_ratio * np.sqrt(2 * HALF_N_PER_M * COIL_KG)  # of each half, twice of which damps the coil
    half = {"kind": "spring", "stiffness_N_per_m": HALF_N_PER_M, "damping_N_s_per_m": damping, "preload_N": preload_N}
    halves = (
        Element(name="spring_upper", between=("valve", "coil"), **half),
        Element(name="spring_lower", between=("coil", "ground"), **half),
    )
    kept = tuple(e for e in base.element if e.name != "spring")
    coil = Mass(name="coil", mass_kg=COIL_KG)
    return base.model_copy(update={"mass": (*base.mass, coil), "element": (*kept, *halves)})
