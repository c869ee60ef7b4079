"""Random scenes, cams and speeds near the built-in ones."""

from collections.abc import Iterator
from functools import cache
from typing import NamedTuple

import numpy as np

from camopt.cam.families.free import free_cam
from camopt.cam.lift import Lift
from camopt.cam.read import read_cam
from camopt.optimizer.program.kinematic import kinematic_optimum
from camopt.scene import InputError, Scene, build_train, load_scene, parse_scene
from camopt.scene.text_file import scene_toml

SCENES = ("kodama", "motori-1", "motori-2", "pushrod-5mass")
SPREAD = {"mass_kg": 1.25, "stiffness_N_per_m": 1.4, "damping_N_s_per_m": 2.0, "gap_mm": 1.3}
"""Largest factor by which each number of a scene is multiplied or divided."""
PRELOAD = 1.3
"""Largest factor of the preloads, common to a scene, so that spring and seat stay in balance."""
SPEED = (0.4, 1.05)
"""Lowest and highest speed as shares of the scene's top speed."""


class DrawnCase(NamedTuple):
    """One random case."""

    scene: Scene
    cam_name: str
    lift: Lift
    speed_rpm: float


def drawn_cases(seed: int, count: int) -> Iterator[DrawnCase]:
    """`count` random cases; scenes without a state of rest, and impossible cams, are drawn again."""
    rng = np.random.default_rng(seed)
    while count:
        base = SCENES[rng.integers(len(SCENES))]
        try:
            scene = varied(load_scene(base), rng)
            build_train(scene)
            name, lift = drawn_cam(base, rng)
        except InputError:
            continue
        count -= 1
        yield DrawnCase(scene, name, lift, float(rng.uniform(*SPEED) * scene.required_operation.band_rpm[1]))


def varied(scene: Scene, rng: np.random.Generator) -> Scene:
    """The scene with every mass, stiffness, damping and gap times its own random factor, and all preloads times one.

    Raises InputError where the result cannot be loaded.
    """
    preload = PRELOAD ** rng.uniform(-1, 1)

    def changed(item):
        values = {k: f ** rng.uniform(-1, 1) * getattr(item, k) for k, f in SPREAD.items() if getattr(item, k, None)}
        if getattr(item, "preload_N", 0.0):
            values["preload_N"] = preload * item.preload_N
        return item.model_copy(update=values)

    update = {"mass": tuple(map(changed, scene.mass)), "element": tuple(map(changed, scene.element))}
    return parse_scene(scene_toml(scene.model_copy(update=update)), scene.name)


def drawn_cam(base: str, rng: np.random.Generator) -> tuple[str, Lift]:
    """A Polydyne (half of the cases), a plain member of a family, or a free cam. Raises InputError if impossible."""
    kind = rng.integers(4)
    if kind < 2:
        powers = np.cumsum([2, *(2 * rng.integers(2, 5, 4))])
        speed = int(rng.uniform(0.6, 1.1) * load_scene(base).operation.band_rpm[1])
        name = f"polydyne:exponents={'/'.join(map(str, powers))},speed_rpm={speed}"
    else:
        name = str(rng.choice(("multi-pol", "new-design", "kurz") if kind == 2 else ("free:4", "free:3")))
    return name, cam_named(base, name)


@cache
def cam_named(base: str, name: str) -> Lift:
    """A family's cam on a built-in scene, or `free:<knots in deg>`: the free cam of largest area."""
    scene = load_scene(base)
    if name.startswith("free:"):
        return kinematic_optimum(design := scene.required_design, free_cam(design, float(name[5:]))).lift
    return read_cam(name, scene)
