"""Array shapes are checked in the tests; that the package imports no checker is tested in tests/test_layers.py."""

import jaxtyping
import numpy as np
import pytest

from camopt.measure.hermite import Hermite
from camopt.scene import build_train, load_scene
from camopt.smooth.rest import balance
from camopt.smooth.system import build_system
from tests.checked_shapes import MODULES


def test_a_wrong_shape_is_refused():
    angle = np.linspace(0.0, 1.0, 5)
    Hermite(angle, angle, angle)
    with pytest.raises(jaxtyping.TypeCheckError):
        Hermite(angle, angle, angle[:-1])


def test_a_wrong_shape_is_refused_on_the_smooth_path():
    system = build_system(build_train(load_scene("kodama")))
    with pytest.raises(jaxtyping.TypeCheckError):
        balance(system, np.zeros((2, len(system.mass))))


def test_the_checked_modules_exist():
    for name in MODULES:
        __import__(name)
