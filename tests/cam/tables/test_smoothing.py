"""Measured tables: noise found, acceleration within its stated error, glitches rejected, blind tables refused."""

import numpy as np
import pytest

from camopt.cam.ramps import scene_ramps
from camopt.cam.read import read_cam
from camopt.cam.tables.smoothing import smoothed
from camopt.cam.tables.smoothing_spline import basis, fitted
from camopt.scene import InputError
from camopt.scene.units import DEG, MM
from tests.cam.cams import KODAMA, MEASURED
from tests.cam.cams import POLYDYNE as TRUTH

RAMPS = scene_ramps(KODAMA.design)
EVENT = np.linspace(-102, 102, 2041)
ACCELERATION = TRUTH(EVENT * DEG, 2) / MM * DEG**2
PEAK = np.abs(ACCELERATION).max()


def table(noise_um=0.0, step=1.0, seed=0):
    degrees = np.arange(-180, 180 + step / 2, step)
    lift = TRUTH(degrees * DEG) / MM + np.random.default_rng(seed).normal(0, 1e-3 * noise_um, len(degrees))
    lift[-1] = lift[0]
    return degrees, lift


def law(degrees, lift):
    return smoothed("table", degrees, lift, list(range(1, len(lift) + 1)), RAMPS)


def smooth_pieces(found):
    assert found[0] is not None
    return found[0]


def acceleration_error(found):
    return np.sqrt(np.mean((smooth_pieces(found)(np.mod(EVENT, 360), 2) - ACCELERATION) ** 2)) / PEAK


@pytest.mark.parametrize("step", [0.25, 2.0])
@pytest.mark.parametrize("noise_um", [0.5, 10.0])
def test_noise_is_what_is_stated(step, noise_um):
    found = [law(*table(noise_um, step, seed)) for seed in range(3)]
    # 100 rows give the noise to 7 %, less the freedom of the spline
    assert np.mean([f[1]["noise_um"] for f in found]) == pytest.approx(noise_um, rel=0.15)
    assert max(acceleration_error(f) for f in found) < 0.06  # half of what a table is refused for, and a little more


def test_base_circle_is_zero_lift_non_negative_and_four_times_smooth():
    found = law(*table(5.0))
    pieces = smooth_pieces(found)
    fine = np.linspace(0, 360, 7201)
    assert pieces(fine).min() >= 0
    assert np.all(pieces(np.linspace(125, 235, 500)) == 0)
    widths = np.diff(pieces.x)[:-1]
    for order in range(5):
        left = np.array([np.polyval(np.polyder(c, order) if order else c, w)
                         for c, w in zip(pieces.c.T[:-1], widths, strict=True)])  # fmt: skip
        right = pieces(pieces.x[1:-1], order)
        np.testing.assert_allclose(left, right, atol=1e-9 * np.abs(right).max())


def test_glitches_are_found_and_leave_no_trace():
    degrees, lift = table(1.0)
    spoilt = lift.copy()
    spoilt[[120, 180, 215]] += [0.03, -0.05, 0.2]
    spoilt[20] = 0.4  # on the base circle
    found = law(degrees, spoilt)
    assert found[1]["outlier_lines"] == [21, 121, 181, 216]
    assert law(degrees, lift)[1]["outliers"] == 0
    assert acceleration_error(found) < 1.3 * acceleration_error(law(degrees, lift))


def test_largest_shift_is_the_farthest_row():
    degrees, lift = table(3.0)
    found = law(degrees, lift)
    shifts = np.abs(smooth_pieces(found)(np.mod(degrees, 360)) - lift)
    assert found[1]["largest_shift_um"] == pytest.approx(1e3 * shifts.max(), abs=1e-4)
    assert found[1]["largest_shift_line"] == 1 + np.argmax(shifts)


def test_exact_corners_of_the_jerk_are_no_outliers():
    for step in (1.0, 2.0):
        degrees, lift = table(0.0, step)
        for digits in (3, 4, 12):
            assert law(degrees, np.round(lift, digits))[1]["outliers"] == 0


@pytest.mark.parametrize("sides", [(1, 1), (0, 1), (1, 0)])
@pytest.mark.parametrize("noise_um", [0.0, 5.0])
@pytest.mark.parametrize("last_deg", [68, 71, 72, 76, 85])
def test_a_cut_ramp_is_continued_by_the_scenes_and_says_so(last_deg, noise_um, sides):
    degrees, lift = table(noise_um)
    opening, closing = (last_deg if cut else 120 for cut in sides)
    rows = (degrees >= -opening) & (degrees <= closing)
    found = law(degrees, np.where(rows, lift, 0.0))
    said = found[1]
    at_end = TRUTH(last_deg * DEG) / MM
    assert said["cut_ramps"] == sum(sides)
    assert said["added_lift_mm"] == pytest.approx(at_end, abs=4e-3 * noise_um + 1e-4)  # four standard deviations
    fine = np.linspace(-180, 180, 7201)
    height, true = smooth_pieces(found)(np.mod(fine, 360)), TRUTH(fine * DEG) / MM
    assert height.min() >= 0
    beyond = ((fine < -opening - 1) & (sides[0] == 1)) | ((fine > closing + 1) & (sides[1] == 1))
    # the truth has the scene's ramp: what is added misses it by the cut ramp top's curvature at most, and by the noise
    assert np.abs(height - true)[beyond].max() < 0.03 + 6e-3 * noise_um
    assert np.abs(height - true)[~beyond].max() < 4e-3 + 3e-3 * noise_um
    lifted = fine[height > 0]
    measured = degrees[rows & (lift > 0)].max() - degrees[rows & (lift > 0)].min()
    if sum(sides) == 2:
        assert said["added_deg"] == pytest.approx(np.ptp(lifted) - measured, abs=2.0)  # feet end within two knots
    assert np.abs(smooth_pieces(found)(np.mod(fine, 360), 2)).max() < 1.2 * PEAK


@pytest.mark.parametrize("last_deg", [40, 60, 65])
def test_a_table_that_ends_on_the_flank_is_refused(last_deg):
    degrees, lift = table(1.0)
    with pytest.raises(InputError, match=r"line \d+: the table ends at [\d.]+ mm, over 5 % of its largest lift"):
        law(degrees, np.where(np.abs(degrees) > last_deg, 0.0, lift))


def test_a_steep_flank_that_ends_low_is_refused():
    degrees = np.arange(-180.0, 180.1, 0.25)
    lift = np.maximum(0.0, 9.0 * (1 - (degrees / 60.7) ** 2))
    lift[np.abs(degrees) > 60] = 0.0  # from 0.21 mm, sloping 0.3 mm/deg
    with pytest.raises(InputError, match=r"with a slope of 0\.293 mm/deg, which the scene's ramp does not continue"):
        law(degrees, lift)


@pytest.mark.parametrize("noise_um", [0.0, 2.0])
def test_lift_is_not_invented_in_a_gap(tmp_path, noise_um):
    degrees, lift = table(noise_um, 0.5)
    rows = np.abs(degrees - 10) > 12
    file = tmp_path / "cam.dat"
    np.savetxt(file, np.column_stack([degrees, lift])[rows], fmt="%.9f")
    with pytest.raises(InputError, match=r"lines 356 and 357: between them lie 25 cam degrees without a row"):
        read_cam(file, KODAMA, "cam", "mm")


# every one too far from its neighbours by itself, and of many sizes, so that none hides behind the rest as noise
GLITCHES = np.zeros(361)
GLITCHES[95:275:12] = 3.0 * 0.5 ** (np.arange(15) // 2)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda d, h: (d, h + np.random.default_rng(1).normal(0, 0.5, len(h)) * (h > 0.5)), "no usable acceleration"),
        (lambda d, h: (d, h + GLITCHES), "stand out from their neighbours"),
        (lambda d, h: (d, h - 0.2), "on the base circle"),
        (lambda d, h: (d[100:250], h[100:250]), "begin and end on the base circle"),
    ],
)
def test_refusals(change, says):
    with pytest.raises(InputError, match=says) as error:
        law(*change(*table(0.5)))
    assert "\n" not in str(error.value)


def test_ratio_turns_tappet_lift_into_valve_lift(tmp_path):
    degrees, lift = table(1.0)
    file = tmp_path / "cam.dat"
    np.savetxt(file, np.column_stack([degrees, lift / 1.6]), fmt="%.7f", header="table-angle = cam\ntable-lift = mm")
    assert read_cam(file, KODAMA, table_ratio=1.6).max_lift / MM == pytest.approx(9.4, abs=2e-3)
    file.write_text("# table-ratio: 1.6\n" + file.read_text())
    found = read_cam(file, KODAMA)
    assert found.max_lift / MM == pytest.approx(9.4, abs=2e-3)
    assert found.parameters["ratio"] == 1.6
    assert found.parameters["noise_um"] == pytest.approx(1.6 / 1.6, rel=0.25)
    file.write_text("# table-ratio: none\n" + file.read_text().split("\n", 1)[1])
    with pytest.raises(InputError, match="ratio is 'none'"):
        read_cam(file, KODAMA)


def test_angle_of_the_wrong_kind_is_refused(tmp_path):
    degrees, lift = table(1.0)
    file = tmp_path / "cam.dat"
    np.savetxt(file, np.column_stack([degrees, lift]))
    with pytest.raises(InputError, match="check --table-angle"):
        read_cam(file, KODAMA, "crank", "mm")


@pytest.mark.parametrize("count", [40, 41])
def test_a_turn_without_base_circle_is_fitted_periodically(count):
    degrees = np.linspace(0, 360, 90, endpoint=False)
    fit = fitted(degrees, 5 + np.cos(degrees * DEG), count, np.arange(count))
    at = np.linspace(0, 360, 77)
    np.testing.assert_allclose(basis(at, count) @ fit.coefficients, 5 + np.cos(at * DEG), atol=1e-5)


@pytest.mark.skipif(not MEASURED.is_dir(), reason="the measured tables lie outside the repository")
@pytest.mark.parametrize(
    ("name", "glitches", "noise_um", "cut"),
    # the exhaust table is computed: beyond its last digit (0.1 um, so 0.03 um of noise) its rows show none
    [("motorbike-exhaust-ramps", [1, 187], 0.03, None), ("motorbike-intake-coarse", [1, 153], 1.1, 2)],
)
def test_motorbike_tables(name, glitches, noise_um, cut):
    lift = read_cam(MEASURED / f"{name}.dat", KODAMA, "crank", "m")
    said = lift.parameters
    assert (said["outlier_lines"], said.get("cut_ramps")) == (glitches, cut)
    assert said["noise_um"] == pytest.approx(noise_um, rel=0.1) if cut else said["noise_um"] < noise_um
    assert said["acceleration_error_percent"] < 3
    assert said["peak_error_percent"] < 5
    assert said.get("added_lift_mm") == (0.4979 if cut else None)
    theta = np.linspace(-np.pi, np.pi, 7201)
    assert lift(theta).min() >= -1e-18  # m: a piece that ends in zero is rounded there
    assert np.all(lift(theta[np.abs(theta) > 110 * DEG]) == 0)
    low, high = (value / MM * DEG**2 for value in lift.extremes(2))
    assert -0.01 < low < -0.005
    assert 0.02 < high < 0.045
