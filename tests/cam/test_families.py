"""Largest-area members of the sectioned families, and the laws of the exponent, Kurz-type and trapezoidal cams."""

import numpy as np
import pytest

from camopt.cam.families.exponent import exponent
from camopt.cam.families.kurz import TABLE as KURZ
from camopt.cam.families.kurz import kurz
from camopt.cam.families.largest_area import FINE, _best_angles, best_levels, level_program
from camopt.cam.families.multi_pol import TABLE_1, multi_pol
from camopt.cam.families.new_design import new_design
from camopt.cam.families.powers import event_pieces
from camopt.cam.families.section_limits import control_points
from camopt.cam.families.sections import opening_flank
from camopt.cam.families.trapezoid import trapezoid
from camopt.cam.lift import Lift
from camopt.cam.ramps import scene_ramps
from camopt.cam.read import read_cam
from camopt.scene import InputError
from camopt.scene.units import DEG, MM, MM_PER_DEG, MM_PER_DEG2, MM_PER_DEG3
from tests.cam.cams import KODAMA, with_design

RAMP = scene_ramps(KODAMA.design)[0]
HALF = 72 * DEG


def ratio(lift: Lift) -> float:
    return lift.area_ratio(9.4 * MM)


def within(lift: Lift, jerk: bool = True) -> bool:
    """Whether a cam keeps kodama's limits on acceleration, jerk, nose and lift."""
    low, high = np.array(lift.extremes(2, -HALF, HALF)) / MM_PER_DEG2
    jerked = np.abs(lift.extremes(3, -HALF, HALF)).max() / MM_PER_DEG3 if jerk else 0.0
    nose = lift.extremes(2, -40 * DEG, 40 * DEG)[1]
    return low >= -0.008 and high <= 0.015 and jerked <= 0.003 and nose <= 0 and lift.max_lift <= 9.4 * MM * (1 + 1e-12)


def assert_largest(lift: Lift, jerk: bool = True) -> None:
    """Within the limits of kodama, of which the largest area uses what it is given, and no section below 2 deg."""
    assert within(lift, jerk)
    low, high = np.array(lift.extremes(2, -HALF, HALF)) / MM_PER_DEG2
    assert max(high / 0.015, low / -0.008) > 0.999
    assert lift.max_lift == pytest.approx(9.4 * MM, rel=1e-12)
    assert min(lift.parameters["sections_deg"]) >= 2 - 1e-9


class TestLargestArea:
    @pytest.mark.parametrize(
        ("design", "keywords", "reached"),
        [
            (multi_pol, {"jerk": False}, 0.636),
            (new_design, {"jerk": False}, 0.635),
            (new_design, {"jerk": False, "start_ratio": 0.0}, 0.612),
            (new_design, {"jerk": False, "quintic": True}, 0.6395),
            (multi_pol, {}, 0.602),
            (new_design, {}, 0.5505),
        ],
    )
    def test_reaches_what_a_long_search_reached(self, design, keywords, reached):
        """The first four: sequential quadratic programs from 60 starts, which checked acceleration at sampled angles.
        The others: this search with more generations and no start."""
        lift = design(KODAMA, **keywords)
        assert ratio(lift) > reached - 0.002
        assert_largest(lift, keywords.get("jerk", True))

    def test_levels_are_the_best_of_their_angles(self):
        angles = (10, 7, 7, 27, 21)
        best = multi_pol(KODAMA, angles)
        assert within(best)
        rng = np.random.default_rng(0)
        found = [best.parameters[f"{n}_mm_per_deg{k}"] for n, k in (("a12", 2), ("j34", 3), ("j45", 3))]
        better = 0
        for _ in range(300):
            a12, j34, j45 = found * (1 + 0.03 * rng.standard_normal(3))
            other = multi_pol(KODAMA, angles, a12=a12, j34=j34, j45=j45)
            better += within(other) and ratio(other) > ratio(best) * (1 + 1e-3)  # the slack of the control points
        assert better == 0

    def test_given_levels_are_kept(self):
        lift = multi_pol(KODAMA, (10, 7, 7, 27, 21), a12=0.0142, j45=-1e-4)
        assert lift.parameters["a12_mm_per_deg2"] == pytest.approx(0.0142, rel=1e-9)
        assert lift.parameters["j45_mm_per_deg3"] == pytest.approx(-1e-4, rel=1e-9)
        assert ratio(lift) < ratio(multi_pol(KODAMA, (10, 7, 7, 27, 21)))

    def test_control_points_bound_every_derivative(self):
        one = opening_flank(TABLE_1, np.array([10, 7, 7, 27, 21]) * DEG)
        x, stretch = best_levels(TABLE_1, one, KODAMA.design, RAMP, True, {})
        lift = one.lift(x, RAMP, "", {})
        assert stretch == 0
        linear = level_program(TABLE_1, one, KODAMA.design, RAMP, True)
        assert linear.area @ (x[2:] / linear.column) + linear.constant == pytest.approx(ratio(lift), rel=1e-12)
        for order in (0, 2, 3):
            points = control_points(one, order, FINE) @ x
            low, high = lift.extremes(order, -HALF, 0.0)
            slack = 2e-3 * max(abs(low), abs(high))
            assert low - slack <= points.min() <= low + 1e-12 * slack
            assert high - 1e-12 * slack <= points.max() <= high + slack
            nose = control_points(one, order, FINE, HALF - 30 * DEG) @ x
            assert nose[[0, -1]] == pytest.approx(
                lift(np.array([-30 * DEG, -1e-14]), order), rel=1e-9, abs=1e-9 * slack
            )

    def test_same_call_same_cam(self):
        one = trapezoid(KODAMA)
        _best_angles.cache_clear()
        other = trapezoid(KODAMA)
        assert one.coefficients is not other.coefficients
        assert np.array_equal(one.coefficients, other.coefficients)

    def test_no_jerk_limit_needs_no_switch(self):
        angles, free = (6, 11, 6, 28, 21), with_design(jerk_max_mm_per_deg3=None)
        one, other = multi_pol(free, angles), multi_pol(KODAMA, angles, jerk=False)
        assert one.coefficients == pytest.approx(other.coefficients)
        with pytest.raises(InputError, match="no member found within the limits"):
            multi_pol(KODAMA, angles)

    @pytest.mark.parametrize(
        ("changes", "says"),
        [
            ({"acceleration_max_mm_per_deg2": 0.004}, "no member found within the limits"),
            ({"duration_deg": 15.0, "nose_deg": 2.0}, "need a longer duration"),
        ],
    )
    def test_limits_that_no_member_meets(self, changes, says):
        with pytest.raises(InputError, match=says) as error:
            trapezoid(with_design(**changes))
        assert "\n" not in str(error.value)


class TestExponent:
    def test_conditions_of_the_flank_end(self):
        lift = exponent(KODAMA)
        assert float(lift(0.0)) == pytest.approx(9.4 * MM, rel=1e-12)
        inner = HALF * (1 - 1e-13)
        assert float(lift(inner)) == pytest.approx(0.265 * MM, rel=1e-9)
        assert float(lift(inner, 1)) == pytest.approx(-0.011 * MM_PER_DEG, rel=1e-9)
        assert float(lift(inner, 2)) == pytest.approx(0.0, abs=1e-8 * MM_PER_DEG2)
        assert float(lift(inner, 3)) == pytest.approx(0.0, abs=1e-8 * MM_PER_DEG3)
        assert abs(float(lift(inner, 4))) < 1e-5 * abs(np.array(lift.extremes(3))).max() / DEG

    def test_coefficients_without_ramp_velocity(self):
        """C_i = -prod_j p_j / (p_j - p_i) where the flank ends at rest; mean over peak lift 0.5072 for 2-8-14-20-26."""
        powers = np.array([2, 8, 14, 20, 26], dtype=float)
        c = [-np.prod([q / (q - p) for q in powers if q != p]) for p in powers]
        borders, pieces = event_pieces(powers, HALF, 9.0 * MM, 0.25 * MM, (1.0, 0.0, np.zeros(5)))
        x = borders[:-1] / HALF
        assert pieces[:, 0] == pytest.approx(
            0.25 * MM + 9.0 * MM * (1 + np.abs(x)[:, None] ** powers @ c), abs=1e-12 * MM
        )
        assert 1 + np.sum(c / (powers + 1)) == pytest.approx(0.5072, abs=5e-5)

    def test_is_polydyne_without_its_correction(self):
        assert read_cam("exponent:exponents=2/12/20/32/34", KODAMA).parameters == {"exponents": [2, 12, 20, 32, 34]}
        with pytest.raises(InputError, match="exponent: exponents"):
            exponent(KODAMA, (2, 2, 3, 4, 5))


class TestKurz:
    ANGLES = (24.0, 25.0, 23.0)

    def test_is_its_three_functions(self):
        """The coefficients c11 to c33 from their own seven conditions, solved here without the table."""
        lift = kurz(KODAMA, self.ANGLES, a23=-0.0078)
        w1, w2, w3 = np.array(self.ANGLES) * DEG
        q1, q2 = np.pi / w1, np.pi / (2 * w2)
        h, v, a = 0.265 * MM, 0.011 * MM_PER_DEG, -0.0078 * MM_PER_DEG2
        system = np.array(  # c11, c12, c21, c22, c31, c32, c33
            [
                [1, -q1, 0, 0, 0, 0, 0],  # ramp velocity
                [1, q1, -1, -q2, 0, 0, 0],  # velocity 1-2
                [w1, 0, w2, 1, -(w3**4), w3**2, -1],  # lift 2-3
                [0, 0, 1, 0, 4 * w3**3, -2 * w3, 0],  # velocity 2-3
                [0, 0, 0, -(q2**2), -12 * w3**2, 2, 0],  # acceleration 2-3
                [0, 0, 0, -(q2**2), 0, 0, 0],  # its level
                [0, 0, 0, 0, 0, 0, 1],  # maximum lift
            ]
        )
        c11, c12, c21, c22, c31, c32, c33 = np.linalg.solve(system, [v, 0, -h, 0, 0, a, 9.4 * MM])
        phi = np.linspace(0.01, 0.99, 40)
        one, two, three = phi * w1, phi * w2, w3 * (1 - phi)
        expected = [
            (-HALF + one, h + c11 * one - c12 * np.sin(q1 * one)),
            (-HALF + w1 + two, h + c11 * w1 + c21 * two + c22 * np.sin(q2 * two)),
            (-three, c31 * three**4 - c32 * three**2 + c33),
        ]
        for theta, s in expected:
            assert lift(theta) == pytest.approx(s, rel=0, abs=1e-11 * MM)
            assert lift(-theta) == pytest.approx(s, rel=0, abs=1e-11 * MM)
        assert lift(-HALF + one, 2) == pytest.approx(c12 * q1**2 * np.sin(q1 * one), rel=1e-8)

    def test_largest_area_and_continuous_acceleration(self):
        lift = kurz(KODAMA)
        assert_largest(lift)
        assert ratio(lift) > 0.5728 - 0.0005  # two searches from different points
        borders = -72 + np.cumsum([0, *lift.parameters["sections_deg"][:2]])
        for border in borders * DEG:
            assert lift(border - 1e-9, 2) == pytest.approx(lift(border + 1e-9, 2), abs=1e-6 * MM_PER_DEG2)

    def test_section_count_is_checked(self):
        assert len(KURZ.sections) == 3
        with pytest.raises(InputError, match=r"kurz: sections_deg.*3 positive angles"):
            kurz(KODAMA, (36.0, 36.0))


class TestTrapezoid:
    def test_acceleration_is_the_trapezoid(self):
        angles = np.array([5.0, 8.0, 13.0, 46.0])
        lift = trapezoid(KODAMA, angles)
        a12, a34 = (lift.parameters[f"{n}_mm_per_deg2"] for n in ("a12", "a34"))
        theta = np.linspace(-71.99, -0.01, 500)
        corners = -72 + np.concatenate([[0], np.cumsum(angles)])
        shape = np.interp(theta, corners, [0, a12, a12, a34, a34])
        assert lift(theta * DEG, 2) / MM_PER_DEG2 == pytest.approx(shape, abs=1e-12)
        assert a12 > 0 > a34
        assert float(lift(0.0)) == pytest.approx(9.4 * MM, rel=1e-12)
        assert float(lift(-1e-12, 1)) == pytest.approx(0.0, abs=1e-10 * MM_PER_DEG)

    def test_largest_area(self):
        lift = trapezoid(KODAMA)
        assert_largest(lift)
        assert ratio(lift) > 0.5832 - 2e-4
        rise, _, fall, _ = lift.parameters["sections_deg"]
        a12, a34 = (lift.parameters[f"{n}_mm_per_deg2"] for n in ("a12", "a34"))
        assert a12 / rise == pytest.approx(0.003, rel=1e-2)  # both slopes at the jerk limit
        assert (a12 - a34) / fall == pytest.approx(0.003, rel=1e-2)
        assert lift.extremes(2)[1] == pytest.approx(0.015 * MM_PER_DEG2, rel=1e-3)


@pytest.mark.parametrize("design", [trapezoid, kurz, multi_pol, new_design])
@pytest.mark.parametrize(
    "changes",
    [
        {"acceleration_min_mm_per_deg2": -2.8e-12},
        {"acceleration_max_mm_per_deg2": 2.8e-12},
        {"jerk_max_mm_per_deg3": 1e-12},
        {"max_lift_mm": 1e6},
    ],
    ids=lambda changes: next(iter(changes)),
)
def test_limits_a_million_times_too_tight_are_a_sentence(design, changes):
    """Rows of any size beside the stretch of all of them: the solver decides these programs too."""
    with pytest.raises(InputError, match=r"no member found within the limits.*loosen"):
        design(with_design(**changes))
