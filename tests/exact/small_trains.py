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
STILL = Lift(np.array([-np.pi, np.pi]), np.zeros((1, 2)), 1.0)
ONCE_A_SECOND = 2.0 * np.pi


def one_mass(*elements: str, mass_kg: float = 1.0, force_N: float = 0.0, more: str = "") -> Train:
    """A mass "m" with elements, each given as its lines but the first, and more tables."""
    mass = f'[[mass]]\nname = "m"\nmass_kg = {mass_kg}\nforce_N = {force_N}\n'
    tables = (f'[[element]]\nname = "e{i}"\n{lines}\n' for i, lines in enumerate(elements))
    return build_train(parse_scene(HEAD + mass + "".join(tables) + more, "small"))


def spring(stiffness: float) -> str:
    return f'kind = "spring"\nbetween = ["ground", "m"]\nstiffness_N_per_m = {stiffness}'


def friction(stiffness: float, slip: float) -> str:
    return f'kind = "friction"\nbetween = ["ground", "m"]\nstiffness_N_per_m = {stiffness}\nslip_N = {slip}'
