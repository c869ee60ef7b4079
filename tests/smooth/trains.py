"""A ball whose motion is known in closed form, and the valve trains of the gradient tests."""

from functools import cache
from pathlib import Path

from camopt.cam.design_file import read_design
from camopt.cam.families.kurz import kurz
from camopt.cam.families.polydyne import polydyne
from camopt.scene import Train, build_train, load_scene
from tests.exact.small_trains import contact, one_mass


def ball(mass: float, stiffness: float, damping: float) -> Train:
    """One mass above the ground, pushed up when it touches at zero."""
    return one_mass(contact(stiffness, damping), mass_kg=mass)


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
