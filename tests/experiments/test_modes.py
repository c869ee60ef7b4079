"""The eigen analysis beside the paper, and the surge of the divided spring against its closed form."""

import numpy as np
import pytest

from camopt.scene import load_scene
from experiments import modes


@pytest.fixture(scope="module")
def content(tmp_path_factory):
    return modes.main("small", tmp_path_factory.mktemp("modes"))


def test_every_mode_of_the_paper_is_met(content):
    for row in content["ohv_3dof"]:
        # the paper prints four to six figures
        assert row["frequency_Hz"] == pytest.approx(row["paper_Hz"], rel=1e-5)
        np.testing.assert_allclose(row["shape"], row["paper_shape"], atol=1e-4)


def test_surge_is_that_of_a_uniform_chain_between_fixed_ends():
    found = modes.surge_frequencies(load_scene("kodama"))
    # five masses between six springs: omega_n = 2 sqrt(k / m) sin(n pi / 12)
    expected = 2 * np.sqrt(152000.0 / 0.00833) * np.sin(np.arange(1, 6) * np.pi / 12) / (2 * np.pi)
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_a_massless_spring_has_no_surge():
    assert len(modes.surge_frequencies(load_scene("motori-1"))) == 0


def test_harmonics_that_meet_the_surge_lie_in_the_band(content):
    rows = content["surge"]["kodama"]["harmonics_in_band"]
    for row in rows:
        assert 5000 <= row["speed_rpm"] <= 7000
        assert row["order"] * row["speed_rpm"] / 120 == pytest.approx(row["frequency_Hz"], rel=1e-9)
    # 352 Hz is met by every order from 6.03 to 8.45
    assert [row["order"] for row in rows if row["mode"] == 1] == [7, 8]
