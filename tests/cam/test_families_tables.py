"""Multi-Pol and New Design against Tables 1 and 2 of Kodama et al., read here as the paper prints them."""

from dataclasses import replace

import numpy as np
import pytest

from camopt.cam.families.multi_pol import TABLE_1, multi_pol
from camopt.cam.families.new_design import new_design, table_2
from camopt.cam.families.section_limits import control_points
from camopt.cam.families.sections import QUANTITIES, U, opening_flank
from camopt.cam.lift import Lift
from camopt.cam.read import read_cam
from camopt.scene import InputError
from camopt.scene.units import DEG, MM, MM_PER_DEG
from tests.cam.cams import FITTED, KODAMA, with_design

HALF_DEG = 72.0

# Columns: lift, velocity, acceleration, jerk, each at the start and the end; U: not given; y12: the lift where
# sections 1 and 2 meet. Table 1 prints the start of acceleration in section 5 as that of its border, 4-5.
PRINTED_1 = """
y_r  U   v_r  U   0     a12   U    0
y12  U   v12  U   a12   a12   0    0
y23  U   v23  U   a12   0     0    j34
y34  U   v34  U   0     a45   j34  j45
y45  U   v45  0   a45   U     j45  0
"""
PRINTED_2 = """
y_r  U   v_r  U   a12*  a12   0    U
y12  U   v12  U   a12   0     0    j23
y23  U   v23  U   0     a34   j23  j34
y34  U   v34  0   a34   U     j34  0
"""
QUINTIC = {"section_II": "quintic", "start_ratio": 0.8}
QUARTIC = PRINTED_2.replace("0     0    j23", "0     0    U")
NEW_DESIGN = {"sections_deg": (15.8, 9.9, 11.0, 35.3), "a12": 0.0125, "j34": 0.00044, "start_ratio": 0.66}


def printed(text: str) -> list[list]:
    """Cells per section in the order of the tables, as the package writes them."""
    cells = {"U": U, "0": 0}
    return [[cells.get(word, word) for word in line.split()] for line in text.split("\n") if line]


def assert_conditions(lift: Lift, text: str, ratio: float = 1.0) -> None:
    """Every condition of a printed table on both flanks of a cam, to 1e-10 of the largest value of its derivative, and
    the end lift, which both tables leave out."""
    assert float(lift(0.0)) == pytest.approx(9.4 * MM, rel=1e-12)
    borders = -HALF_DEG + np.concatenate([[0.0], np.cumsum(lift.parameters["sections_deg"])])
    for k, name in enumerate(QUANTITIES):
        tolerance = 1e-10 * np.abs(lift.extremes(k, -HALF_DEG * DEG, HALF_DEG * DEG)).max()
        values = one_sided(lift, borders, k)
        for section, row in enumerate(printed(text)):
            for end, cell in enumerate(row[2 * k : 2 * k + 2]):
                if cell is not U:
                    wanted = expected(lift, cell, values[section - 1][1], k, ratio)
                    place = name, section, end, cell
                    assert values[section][end] == pytest.approx(wanted, rel=0, abs=tolerance), place
        mirror = one_sided(lift, -borders[::-1], k)[::-1]
        assert np.array(mirror)[:, ::-1] * (-1.0) ** k == pytest.approx(np.array(values), rel=0, abs=tolerance)


def one_sided(lift: Lift, borders_deg: np.ndarray, order: int) -> list[tuple[float, float]]:
    """Value of a derivative at the start and the end of every section, each from inside the section."""
    values = []
    for low, high in zip(borders_deg[:-1] * DEG, borders_deg[1:] * DEG, strict=True):
        piece = np.searchsorted(lift.borders, 0.5 * (low + high)) - 1
        polynomial = np.polynomial.Polynomial(lift.coefficients[piece])
        local = np.array([low, high]) - lift.borders[piece]
        assert local == pytest.approx([0.0, lift.borders[piece + 1] - lift.borders[piece]], abs=1e-12)
        start, end = polynomial.deriv(order)(local) if order else polynomial(local)
        values.append((float(start), float(end)))
    return values


def expected(lift: Lift, cell, before: float, order: int, ratio: float) -> float:
    """What a cell of a table stands for: a number, the ramp's, a level of the cam, or the section before's end."""
    if cell == 0:
        return 0.0
    if cell in ("y_r", "v_r"):
        return {"y_r": 0.265 * MM, "v_r": 0.011 * MM_PER_DEG}[cell]
    level = f"{cell.rstrip('*')}_mm_per_deg{order}"
    if level in lift.parameters:
        return lift.parameters[level] * MM / DEG**order * (ratio if cell.endswith("*") else 1.0)
    return before


@pytest.mark.parametrize(("table", "text"), [(TABLE_1, PRINTED_1), (table_2(QUINTIC), PRINTED_2)])
def test_tables_are_the_papers(table, text):
    cells = [[c for q in QUANTITIES for c in getattr(section, q)] for section in table.sections]
    assert cells == printed(text)


def test_quartic_reading_leaves_only_the_end_jerk_of_section_2_open():
    literal, quartic = table_2(QUINTIC).sections, table_2(QUINTIC | {"section_II": "quartic"}).sections
    assert [len(s.conditions) for s in quartic] == [5, 5, 6, 6]
    assert quartic[1] == replace(literal[1], jerk=(0, U))
    assert (*quartic[:1], *quartic[2:]) == (*literal[:1], *literal[2:])


class TestConditions:
    @pytest.mark.parametrize(
        "keywords",
        [
            FITTED,
            {"sections_deg": (2, 20, 15, 30, 5), "a12": 0.01, "a45": -0.006, "j34": -0.001},
            {"sections_deg": (12, 10, 12, 18, 20), "a12": -0.01, "a45": 0.02, "j45": 0.004},
        ],
    )
    def test_multi_pol(self, keywords):
        lift = multi_pol(KODAMA, **keywords)
        assert_conditions(lift, PRINTED_1)

    @pytest.mark.parametrize("ratio", [0.0, 0.5, 0.95])
    def test_new_design_quintic(self, ratio):
        lift = new_design(KODAMA, **NEW_DESIGN | {"start_ratio": ratio, "quintic": True, "j23": -0.002})
        assert_conditions(lift, PRINTED_2, ratio)

    @pytest.mark.parametrize("ratio", [0.0, 0.66])
    def test_new_design_quartic(self, ratio):
        lift = new_design(KODAMA, **NEW_DESIGN | {"start_ratio": ratio})
        assert_conditions(lift, QUARTIC, ratio)
        piece = np.searchsorted(lift.borders, (-72 + 15.8 + 1) * DEG) - 1
        assert lift.coefficients[piece, 5:] == pytest.approx(0.0)
        end = np.polynomial.Polynomial(lift.coefficients[piece]).deriv(3)(9.9 * DEG)
        assert end == pytest.approx(-2 * 0.0125 * MM / DEG**3 / 9.9, rel=1e-10)  # a result of the quartic

    @pytest.mark.parametrize(
        ("reading", "text", "ratio"),
        [
            ("start_ratio=0.7,quintic=yes,j23_mm_per_deg3=-0.002", PRINTED_2, 0.7),
            ("start_ratio=0,quintic=yes,j23_mm_per_deg3=-0.002", PRINTED_2, 0.0),
            ("start_ratio=0,quintic=no", QUARTIC, 0.0),
            ("", QUARTIC, 0.95),
        ],
    )
    def test_readings_of_table_2_are_chosen_on_the_command_line(self, reading, text, ratio):
        levels = "sections_deg=15.8/9.9/11/35.3,a12_mm_per_deg2=0.0125,j34_mm_per_deg3=0.00044"
        assert_conditions(read_cam(f"new-design:{levels},{reading}".rstrip(","), KODAMA), text, ratio)

    def test_a_wrong_level_is_noticed(self):
        lift = multi_pol(KODAMA, **FITTED)
        wrong = Lift(
            lift.borders, lift.coefficients, lift.half_duration, "", lift.parameters | {"a12_mm_per_deg2": 0.0115}
        )
        with pytest.raises(AssertionError, match="acceleration"):
            assert_conditions(wrong, PRINTED_1)


class TestCalibratedMembers:
    """The members used with the reference train, with what its fit states of them (its last printed digit)."""

    @pytest.mark.parametrize(
        ("lift", "closing", "ratio", "acceleration", "jerk"),
        [
            (multi_pol(KODAMA, **FITTED), ("a45", -0.00535090), 0.5656, (-0.00733, 0.01140), 0.00304),
            (new_design(KODAMA, **NEW_DESIGN), ("a34", -0.00654361), 0.5647, (-0.00763, 0.01250), 0.00253),
        ],
        ids=["multi-pol", "new-design"],
    )
    def test_figures(self, lift, closing, ratio, acceleration, jerk):
        assert lift.parameters[f"{closing[0]}_mm_per_deg2"] == pytest.approx(closing[1], abs=5e-9)
        assert lift.area_ratio(9.4 * MM) == pytest.approx(ratio, abs=5e-5)
        inside = -HALF_DEG * DEG, HALF_DEG * DEG
        assert np.array(lift.extremes(2, *inside)) / MM * DEG**2 == pytest.approx(acceleration, abs=5e-6)
        assert np.abs(lift.extremes(3, *inside)).max() / MM * DEG**3 == pytest.approx(jerk, abs=5e-6)
        assert lift.max_lift / MM == pytest.approx(9.4, abs=5e-7)


@pytest.mark.parametrize(
    ("design", "keywords", "says"),
    [
        (multi_pol, {"sections_deg": (10, 10, 10, 10, 10)}, "sum to 50 and must sum to half the duration, 72"),
        (multi_pol, {"sections_deg": (22, 10, 20, 20)}, "5 positive angles"),
        (multi_pol, {"sections_deg": (22, 10, -20, 40, 20)}, "5 positive angles"),
        (multi_pol, {"sections_deg": (22, 10, float("nan"), 20, 20)}, "5 positive angles"),
        (multi_pol, {"a12": 0.01}, "a12 given without sections_deg"),
        (multi_pol, FITTED | {"a45": -0.005}, "leave it out"),
        (multi_pol, FITTED | {"a12": float("inf")}, "finite numbers"),
        (multi_pol, {"sections_deg": (7.5, 1.5, 7.5, 22.7, 32.8)}, "no member found within the limits"),
        (new_design, NEW_DESIGN | {"start_ratio": 1.2}, "from 0 to 1"),
        (new_design, NEW_DESIGN | {"start_ratio": float("nan")}, "from 0 to 1"),
        (new_design, NEW_DESIGN | {"j23": -0.002}, "section II is quintic"),
    ],
)
def test_faults(design, keywords, says):
    with pytest.raises(InputError, match=says) as error:
        design(KODAMA, **keywords)
    assert "\n" not in str(error.value)


def test_ramps_that_differ_are_refused():
    with pytest.raises(InputError, match="closing ramp differs"):
        multi_pol(with_design(closing_ramp_height_mm=0.3), **FITTED)


def test_control_points_from_an_angle_on_begin_and_end_with_the_curve():
    angles = np.array([10.0, 7.0, 7.0, 27.0, 21.0]) * DEG
    one, x = opening_flank(TABLE_1, angles), np.arange(1.0, 3.0 + len(TABLE_1.levels))
    for start in (0.0, 8 * DEG, float(angles[:2].sum()), 30 * DEG):
        piece = np.searchsorted(one.borders, start, side="right") - 1
        u = start - one.borders[piece]
        rows = control_points(one, 2, 20, start)
        power = np.arange(2, one.pieces.shape[1])
        acceleration = (power * (power - 1) * u ** (power - 2)) @ (one.pieces[piece, 2:] @ x)
        assert rows[0] @ x == pytest.approx(acceleration)
        assert rows[-1] @ x == pytest.approx(one.end(2) @ x)
        assert len(rows) == (len(one.pieces) - piece) * (20 // len(one.pieces)) * (one.pieces.shape[1] - 2)
