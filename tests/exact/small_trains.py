"""Trains of one or two masses for the tests of single elements, and a cam that stands still."""

import numpy as np

from camopt.cam.lift import Lift
from camopt.scene import build_train, parse_scene
from camopt.scene.train import Train

HEAD = """
format = 1
name = "small"
[operation]
speeds_rpm = [60]
band_rpm = [50, 60]
cam_per_crank = 1.0
"""
DROP = """
format = 1
name = "drop"
valve = "ball"
seat = "floor"
[operation]
speeds_rpm = [60]
band_rpm = [50, 60]
cam_per_crank = 1.0
[[mass]]
name = "ball"
mass_kg = 1.0
force_N = -10.0
[[element]]
name = "cam"
kind = "contact"
between = ["ground", "ball"]
stiffness_N_per_m = 1.0e6
gap_mm = 5.0
cam_driven = true
[[element]]
name = "floor"
kind = "contact"
between = ["ground", "ball"]
stiffness_N_per_m = {stiffness}
damping_N_s_per_m = {damping}
"""
GRAVITY = 10.0
STILL = Lift(np.array([-np.pi, np.pi]), np.zeros((1, 2)), 1.0)
ONCE_A_SECOND = 2.0 * np.pi


def one_mass(*elements: str, mass_kg: float = 1.0, force_N: float = 0.0, more: str = "") -> Train:
    """A mass "m" with elements, each given as its lines but the first, and more tables."""
    mass = f'[[mass]]\nname = "m"\nmass_kg = {mass_kg}\nforce_N = {force_N}\n'
    tables = (f'[[element]]\nname = "e{i}"\n{lines}\n' for i, lines in enumerate(elements))
    return build_train(parse_scene(HEAD + mass + "".join(tables) + more, "small"))


def ball(stiffness: float, damping: float, more: str = "") -> Train:
    """A mass of 1 kg that falls with `GRAVITY` onto a floor, its seat, and elements beside it."""
    return build_train(parse_scene(DROP.format(stiffness=stiffness, damping=damping) + more, "drop"))


def collision(m1: float, m2: float, stiffness: float) -> Train:
    """Two masses on a line, on soft springs; the first pushes the second towards +x where they meet."""
    masses = (f'[[mass]]\nname = "{name}"\nmass_kg = {m}\n' for name, m in (("left", m1), ("right", m2)))
    held = (f'[[element]]\nname = "on_{m}"\n{spring(1e-6, m)}\n' for m in ("left", "right"))
    touch = f'[[element]]\nname = "touch"\n{contact(stiffness, between=("left", "right"))}\n'
    return build_train(parse_scene(HEAD + "".join([*masses, touch, *held]), "collision"))


def contact(stiffness: float, damping: float = 0.0, between: tuple[str, str] = ("ground", "m")) -> str:
    return f'kind = "contact"\nbetween = {[*between]}\nstiffness_N_per_m = {stiffness}\ndamping_N_s_per_m = {damping}'


def spring(stiffness: float, mass: str = "m") -> str:
    return f'kind = "spring"\nbetween = ["ground", "{mass}"]\nstiffness_N_per_m = {stiffness}'


def friction(stiffness: float, slip: float) -> str:
    return f'kind = "friction"\nbetween = ["ground", "m"]\nstiffness_N_per_m = {stiffness}\nslip_N = {slip}'
