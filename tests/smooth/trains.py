"""Small trains whose motion is known in closed form, and the valve train of the gradient tests."""

from functools import cache
from pathlib import Path

import numpy as np

from camopt.cam.design_file import read_design
from camopt.cam.families.kurz import kurz
from camopt.cam.families.polydyne import polydyne
from camopt.scene import Train, build_train, load_scene


def collision(m1: float, m2: float, stiffness: float, damping: float = 0.0) -> Train:
    """Two free masses on a line; the first pushes the second towards +x when they meet."""
    return _train([m1, m2], a=[0], b=[1], stiffness=stiffness, damping=damping)


def ball(mass: float, stiffness: float, damping: float, gap: float = 0.0) -> Train:
    """One mass above the ground, pushed up when it touches (at x = -gap)."""
    return _train([mass], a=[-1], b=[0], stiffness=stiffness, damping=damping, gap=gap)


def _train(masses, a, b, stiffness, damping, gap=0.0) -> Train:
    n = len(masses)
    one = np.ones(1)
    return Train(
        mass=np.array(masses),
        mass_damping=np.zeros(n),
        mass_force=np.zeros(n),
        a=np.array(a),
        b=np.array(b),
        contact=np.array([True]),
        cam_driven=np.array([False]),
        stiffness=stiffness * one,
        damping=damping * one,
        preload=0.0 * one,
        gap=gap * one,
        valve=-1,
        seat=-1,
        cam_side=(),
        mass_names=tuple(f"m{i}" for i in range(n)),
        element_names=("contact",),
    )


@cache
def kodama(exponents: tuple[int, ...] = (2, 10, 18, 26, 34), design_speed_rpm: float = 7000):
    """Scene, train and a Polydyne of the built-in valve train."""
    scene = load_scene("kodama")
    return scene, build_train(scene), polydyne(scene, exponents=exponents, design_speed_rpm=design_speed_rpm)


@cache
def motori():
    """Scene, train and the largest Kurz-type cam of the train of one mass; its search takes three seconds."""
    scene = load_scene("motori-1")
    return scene, build_train(scene), kurz(scene)


@cache
def delivered():
    """Scene, train and the cam that `camopt optimize kodama` delivered."""
    scene = load_scene("kodama")
    return scene, build_train(scene), read_design(Path(__file__).parents[1] / "data" / "kodama-design.json", scene)
