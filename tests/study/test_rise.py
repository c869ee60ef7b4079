"""A rise between two dwells: program and bound meet the closed forms, through the command too, and its table."""

import csv
import json

import numpy as np
import pytest

from camopt.scene import InputError
from camopt.study.rise import least_acceleration, least_peak, rise
from tests.command_line import run

UNIT = ("rise", "--rise-mm", "1", "--over-deg", "1")


@pytest.mark.parametrize(
    ("least", "order", "peak"),
    [("acceleration", 2, 4.0), ("jerk", 3, 32.0), ("snap", 4, 384.0), ("crackle", 5, 6144.0)],
)
def test_the_least_peak_of_a_derivative(capsys, tmp_path, least, order, peak):
    found = least_peak(order)
    assert found.bound <= peak * (1 + 1e-9) and found.peak >= peak * (1 - 1e-9)
    turns = np.flatnonzero(np.diff(np.sign(found.derivative))) / len(found.derivative)
    assert turns == pytest.approx((1 - np.cos(np.arange(1, order) * np.pi / order)) / 2, abs=1e-3)
    file = tmp_path / "rise.json"
    code, out, _ = run(capsys, *UNIT, "--least", least, "--json", str(file))
    content = json.loads(file.read_text())
    assert code == 0 and content["least"] == least
    ends = [content[f"{least}_mm_per_deg{order}_{what}"] for what in ("peak", "bound")]
    assert ends == pytest.approx([peak, peak], rel=1e-6) and out.count(f"{peak:.6g} mm/deg^{order}") == 2


@pytest.mark.parametrize("jerk", [39.48, *(pytest.param(j, marks=pytest.mark.long) for j in (36.0, 60.0, 69.47))])
def test_the_least_peak_acceleration_under_a_jerk(jerk):
    least = jerk / 4 * (1 - np.sqrt(1 - 32 / jerk))
    found = least_acceleration(jerk)
    assert found.bound <= least * (1 + 1e-9) and found.peak >= least * (1 - 1e-9)
    assert [found.peak, found.bound] == pytest.approx([least, least], rel=1e-6)
    assert np.abs(np.diff(found.derivative)).max() * (len(found.derivative) - 1) <= jerk * (1 + 1e-6)


def test_too_little_of_either_is_refused():
    with pytest.raises(InputError, match="more than 32"):
        least_acceleration(32.0)
    with pytest.raises(InputError, match="2, which is the acceleration"):
        least_peak(1)


def test_the_table_is_the_motion_in_its_units(capsys, tmp_path):
    """Under a jerk: from rest to rest, with the closed form's acceleration and derivatives that belong together."""
    file, jerk = tmp_path / "rise.csv", 0.003
    words = ("rise", "--rise-mm", "10", "--over-deg", "60", "--jerk-max-mm-per-deg3", str(jerk), "--csv", str(file))
    code, _, _ = run(capsys, *words, "--step-deg", "0.05")
    with open(file, newline="") as text:
        rows = np.array([[float(cell) for cell in row] for row in list(csv.reader(text))[1:]])
    angle, lift, velocity, acceleration, given = rows.T
    assert code == 0 and len(rows) == 1201 and (angle[0], angle[-1]) == (0, 60)
    np.testing.assert_allclose(rows[[0, -1], 1:4], [[0, 0, 0], [10, 0, 0]], atol=1e-8)
    unit = jerk * 60**3 / 10
    least = unit / 4 * (1 - np.sqrt(1 - 32 / unit)) * 10 / 60**2
    assert np.abs(acceleration).max() == pytest.approx(least, rel=1e-5)
    assert np.abs(given).max() <= jerk * (1 + 1e-6)
    assert np.gradient(lift, angle)[1:-1] == pytest.approx(velocity[1:-1], abs=1e-5)
    assert np.gradient(velocity, angle)[1:-1] == pytest.approx(acceleration[1:-1], abs=1e-4)


def test_the_motion_of_least_snap_ends_at_rest():
    columns = rise(8.0, 50.0, 4).table(0.5)
    assert [*columns] == [
        "cam_angle_deg", "lift_mm", "velocity_mm_per_deg", "acceleration_mm_per_deg2", "jerk_mm_per_deg3",
    ]  # fmt: skip
    ends = np.array([columns[name][[0, -1]] for name in columns])
    np.testing.assert_allclose(ends, [[0, 50], [0, 8], [0, 0], [0, 0], [0, 0]], atol=1e-6)


@pytest.mark.parametrize(
    ("more", "says"),
    [
        (("--jerk-max-mm-per-deg3", "30"), "needs more than 32"),
        (("--jerk-max-mm-per-deg3", "40", "--least", "jerk"), "leave --least out"),
        (("--csv", "rise.csv", "--step-deg", "1e-7"), "at most 360000 rows"),
    ],
)
def test_refusals(capsys, tmp_path, monkeypatch, more, says):
    monkeypatch.chdir(tmp_path)
    code, out, err = run(capsys, *UNIT, *more)
    assert (code, out) == (2, "") and says in err
