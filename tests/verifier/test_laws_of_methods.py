"""Single laws as the methods' programs evaluate them, as plain Python, against integrals and lines by NumPy."""

import numpy as np
import pytest

from camopt.scene import InputError
from camopt.scene.laws import HERTZ, PROGRESSIVE, TABLE
from camopt.scene.train import GROUND
from camopt.verifier.methods.of_dop853 import PieceLaws
from camopt.verifier.methods.of_houbolt import PieceSets, _of_table, elements_of, forces
from camopt.verifier.methods.rkg import _elastic, _work
from tests.verifier.trains import laws, train

OF_TABLE, ELASTIC, WORK, FORCES = (
    getattr(program, "py_func", program) for program in (_of_table, _elastic, _work, forces)
)
ROWS = np.array([[-2e-3, 1e4], [1e-3, 3e4], [2e-3, 9e4]])
COMPRESSIONS = (-3e-3, -2e-3, -1e-3, 0.0, 1.5e-3, 2e-3, 5e-3)


@pytest.mark.parametrize("d", COMPRESSIONS)
def test_the_work_of_a_table_is_the_integral_of_its_stiffness(d):
    grid = np.linspace(ROWS[0, 0], d, 100_001)
    expected = np.trapezoid(np.interp(grid, *ROWS.T), grid)
    assert WORK(ROWS, d) == pytest.approx(expected, rel=1e-6)
    grid = np.linspace(0.0, d, 100_001)
    expected = 50.0 + np.trapezoid(np.interp(grid, *ROWS.T), grid)
    assert ELASTIC(PROGRESSIVE, 0.0, 1.0, ROWS, 50.0, d) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("pressed", [-1e-6, 1e-6, 2e-5])
def test_a_hertz_contact_is_pressed_from_where_its_preload_is_gone(pressed):
    k, preload, exponent = 1e9, 20.0, 1.5
    d = pressed - (preload / k) ** (1 / exponent)
    assert ELASTIC(HERTZ, k, exponent, ROWS, preload, d) == pytest.approx(k * max(pressed, 0.0) ** exponent)
    assert ELASTIC(HERTZ, k, exponent, ROWS, preload, 0.0) == pytest.approx(preload)


@pytest.mark.parametrize("d", COMPRESSIONS)
def test_a_force_table_goes_on_in_the_straight_lines_at_its_ends(d):
    slope = np.diff(ROWS[:, 1]) / np.diff(ROWS[:, 0])
    piece = 1 if d >= ROWS[1, 0] else 0
    table = np.column_stack([ROWS, np.append(slope, 0.0)])[None]
    row, force = OF_TABLE(table, 0, d)
    assert row == piece
    assert force == pytest.approx(ROWS[piece, 1] + slope[piece] * (d - ROWS[piece, 0]))


def test_a_contact_by_a_table_touches_where_its_force_rises_through_zero():
    rows = [[-2e-3, -60.0], [1e-3, -30.0], [2e-3, 30.0]]
    contact = train([1.0], [(GROUND, 0, True, False, 1.0, 0.0, 0.0, 0.0)], laws=laws([TABLE], [1.0], table=rows))
    assert PieceLaws(contact).touch[0] == pytest.approx(1.5e-3)


@pytest.mark.parametrize(("contacts", "refused"), [(62, False), (63, True)])
def test_more_sets_of_pieces_than_64_bits_number_are_refused(contacts, refused):
    contact = (0, GROUND, True, False, 1e6, 1.0, 0.0, 0.0)
    many = train([1.0], [contact] * contacts)
    if refused:
        with pytest.raises(InputError, match="cannot number the sets of pieces"):
            PieceSets(many, 1.0, 1.0, 1e-3)
    else:
        assert PieceSets(many, 1.0, 1.0, 1e-3).build(2**contacts - 1) == 0


@pytest.mark.parametrize(("d", "rate", "expected"), [
    (0.0, 0.5, 60.0),  # pressed and closing
    (0.0, -0.5, 0.0),  # pressed, but its damper would pull
    (-2e-5, 0.5, 0.0),  # apart, though its damper alone would push
    (-1e-5, 0.5, 0.0),  # at the touch
])  # fmt: skip
def test_a_contact_of_houbolts_method_pushes_only_while_it_is_pressed(d, rate, expected):
    contact = train([1.0], [(0, GROUND, True, False, 1e6, 100.0, 10.0, 0.0)])
    force, none = np.full(1, np.nan), np.zeros(0)
    key = FORCES(np.array([d]), np.array([rate]), np.zeros(2), elements_of(contact, 0.0), none, force, none)
    assert force[0] == pytest.approx(expected, abs=1e-9) and key == (expected > 0.0)
