"""The built-in pushrod train is that of the Cam Design Handbook, whose printed numbers `experiments.handbook` tells."""

import numpy as np
import pytest

from camopt.scene import build_train, load_scene, rest_position
from camopt.scene.rest import static_matrices
from experiments.handbook import POUND, POUND_PER_INCH, RATIO


def test_built_in_scene_is_that_train_on_the_valve_axis():
    """Frequencies do not depend on the axis: the five masses without contact at the cam, the spring's lumps following,
    are the two masses; the stem, rigid in the book, lowers the second."""
    train = build_train(load_scene("pushrod-5mass"))
    mass = dict(zip(train.mass_names, train.mass, strict=True))
    stiffness = dict(zip(train.element_names, train.stiffness, strict=True))
    assert mass["lifter"] * RATIO**2 / POUND == pytest.approx(0.327, rel=1e-4)
    spring = mass["spring_1"] * (4 + 1) / 9  # lumps at two thirds and one third of the valve's motion
    moving = (mass["rocker"] + mass["valve"] + spring) * RATIO**2 / POUND
    assert moving == pytest.approx(1.102, rel=0.01)  # 19/54 of the spring in place of a third
    assert stiffness["coil_1"] / 3 * RATIO**2 / POUND_PER_INCH == pytest.approx(660, rel=1e-4)
    assert stiffness["pushrod"] * RATIO**2 / POUND_PER_INCH == pytest.approx(3.0e5, rel=1e-4)
    assert stiffness["rocker_valve"] / POUND_PER_INCH == pytest.approx(4.7e5, rel=1e-4)
    acting = np.array([name not in ("cam_lifter", "seat") for name in train.element_names])
    matrix, _ = static_matrices(train, acting)
    squares = np.linalg.eigvals(matrix / train.mass[:, None]).real
    frequency = np.sort(np.sqrt(squares)) / (2 * np.pi)
    assert frequency[0] == pytest.approx(67.2, rel=0.01)
    assert 0.8 * 3411 < frequency[3] < 3411


def test_the_train_rests_on_the_cam_with_its_lash_at_the_valve():
    train = build_train(load_scene("pushrod-5mass"))
    x = rest_position(train)
    force = dict(zip(train.element_names, train.preload + train.stiffness * train.compression(x, 0.0), strict=True))
    assert force["cam_lifter"] == pytest.approx(20.0) and force["pushrod"] == pytest.approx(20.0)
    assert force["rocker_valve"] < 0 and force["seat"] == pytest.approx(350.0, rel=0.01)
    assert [train.element_names[e] for e in train.cam_side] == ["cam_lifter", "pushrod", "rocker_valve"]
    assert train.lash == pytest.approx(0.2e-3)
