"""Single laws as the methods' programs evaluate them, as plain Python, against integrals and lines by NumPy."""

import numpy as np
import pytest

from camopt.scene import InputError
from camopt.scene.laws import HERTZ, OIL, PROGRESSIVE, TABLE
from camopt.scene.train import GROUND
from camopt.verifier.methods.of_dop853 import FILLS, MEMORY, WAITS, PieceLaws
from camopt.verifier.methods.of_houbolt import PieceSets, _march, _of_table, elements_of, forces
from camopt.verifier.methods.rkg import _elastic, _work
from tests.verifier.trains import laws, train

OF_TABLE, ELASTIC, WORK, FORCES, MARCH = (
    getattr(program, "py_func", program) for program in (_of_table, _elastic, _work, forces, _march)
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


def test_the_explicit_form_of_houbolts_method_follows_a_constant_acceleration_from_before_the_start():
    """Both fictitious points are on the parabola, and the third-order difference of a parabola is exact."""
    free = train([2.0], [(0, GROUND, True, False, 1e6, 0.0, 0.0, 1e3)], force=3.0)
    h, samples = 0.1, 6
    x, v, force, z = (np.zeros(shape) for shape in ((samples + 2, 1), (samples, 1), (samples, 1), (samples, 0)))
    x[2], v[0] = 0.5, -0.2
    masses = free.mass, free.mass_damping, free.mass_force
    MARCH((x, v, force, z), np.zeros((samples, 2)), h, masses, elements_of(free, h))
    t = h * np.arange(-2, samples)
    np.testing.assert_allclose(x[:, 0], 0.5 - 0.2 * t + 0.75 * t**2, rtol=1e-12)
    np.testing.assert_allclose(v[:, 0], -0.2 + 1.5 * t[2:], rtol=0, atol=1e-12)


@pytest.mark.parametrize(("rate", "phase"), [(-0.1, FILLS), (0.0, WAITS), (0.1, WAITS)])
def test_oil_that_is_just_without_gap_fills_only_while_its_column_lengthens(rate, phase):
    numbers = laws([OIL], [1e6], leak=1e3, travel=1e-4)
    column = train([1.0], [(GROUND, 0, False, False, 1e6, 0.0, 0.0, 0.0)], laws=numbers)
    assert PieceLaws(column).first_phases(np.zeros(1), np.array([rate]), np.zeros(1)) == {(0, MEMORY): phase}
