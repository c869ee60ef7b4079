"""Lift tables as the tools of the field write them: what is read of each, and what of a spoiled one is said."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from camopt.cam.lift import Lift
from camopt.cam.tables.lift_table import read_lift_table
from camopt.cam.tables.text import parsed
from camopt.cli import main
from camopt.scene import InputError
from camopt.scene.units import DEG, MM
from tests.cam.cams import KODAMA, MEASURED
from tests.cam.cams import POLYDYNE as CAM

CRANK = np.arange(1.0, 721.0)
"""Rows 1 to 720, the nose at 250 crank degrees."""
THETA = ((CRANK - 250 + 360) % 720 - 360) / 2 * DEG
LIFT = CAM(THETA) / MM


def engmod(delimiter: str = "\t") -> list[str]:
    """Degree and lift, without a header."""
    return [f"{degree:g}{delimiter}{lift:.15g}" for degree, lift in zip(CRANK, LIFT, strict=True)]


def svl() -> list[str]:
    """Degree, lift, velocity and acceleration below a title."""
    rows = zip(CRANK, LIFT, CAM(THETA, 1) / MM * DEG / 2, CAM(THETA, 2) / MM * (DEG / 2) ** 2, strict=True)
    head = ["Static valve lift", "Intake, 4 valves, 2 of them", "deg crank   lift mm   mm/deg   mm/deg2"]
    return head + ["  ".join(f"{number:.15g}" for number in row) for row in rows]


def commas() -> list[str]:
    """A spreadsheet of a place where decimals have commas, the lift in the third column."""
    head = ["Nocke Einlass;;", "Datum;12.03.2024;", "Winkel;Hub Auslass;Hub Einlass"]
    rows = (f"{degree:g};0;{lift:.15g}".replace(".", ",") for degree, lift in zip(CRANK, LIFT, strict=True))
    return head + list(rows)


FORMATS: dict[str, tuple[Callable[[], list[str]], tuple | None]] = {
    "engmod, tabs": (engmod, None),
    "engmod, spaces": (lambda: engmod("  "), None),
    "svl": (svl, None),
    "decimal commas": (commas, ("Winkel", "hub einlass")),
}


def read(folder: Path, lines: list[str], columns: tuple | None = None, **more) -> Lift:
    (folder / "cam.txt").write_text("\n".join(lines) + "\n")
    return read_lift_table(folder / "cam.txt", KODAMA, "crank", "mm", table_columns=columns, **more)


@pytest.mark.parametrize("name", FORMATS)
def test_every_row_comes_back_with_its_digits(tmp_path, name):
    make, columns = FORMATS[name]
    (tmp_path / "cam.txt").write_text("\n".join(make()) + "\n")
    rows = parsed(tmp_path / "cam.txt", columns=columns).rows
    assert np.array_equal(rows[:, 0], CRANK)
    assert np.abs(rows[:, 1] - LIFT).max() < 1e-13  # fifteen digits of 9.4


@pytest.mark.parametrize("name", FORMATS)
def test_the_law_passes_through_the_rows(tmp_path, name):
    """Rows with every digit are met; the table's middle becomes angle zero, which moves them by some 1e-10 deg."""
    make, columns = FORMATS[name]
    found = read(tmp_path, make(), columns)
    assert np.abs(found(THETA) / MM - LIFT).max() < 1e-9


def test_a_header_is_skipped_and_said_so(tmp_path):
    said = read(tmp_path, svl()).parameters["mended"]
    assert said == ["its rows begin in line 4: the 3 lines of text before them are its header"]
    assert "mended" not in read(tmp_path, engmod()).parameters


def test_columns_are_counted_or_named(tmp_path):
    by_name = read(tmp_path, commas(), ("Winkel", "Hub Einlass"))
    by_number = read(tmp_path, commas(), (1, 3))
    assert np.array_equal(by_name.coefficients, by_number.coefficients)
    with pytest.raises(InputError, match="check --table-lift"):
        read(tmp_path, commas(), (1, 2))


def test_the_first_line_is_given_where_the_header_looks_like_rows(tmp_path):
    lines = ["720 2", "1 1", "0 0", *engmod()]
    with pytest.raises(InputError, match="the angle"):
        read(tmp_path, lines)
    assert np.array_equal(read(tmp_path, lines, table_first_line=4).borders, read(tmp_path, engmod()).borders)


def test_command_and_next_step_have_the_options(tmp_path, capsys):
    (tmp_path / "cam.txt").write_text("\n".join(commas()) + "\n")
    options = ["--table-angle", "crank", "--table-lift", "mm", "--table-columns", "1,3", "--table-first-line", "4"]
    assert main(["cam", "kodama", "--cam", str(tmp_path / "cam.txt"), *options]) == 0
    out, err = capsys.readouterr()
    assert "maximum lift   9.4" in out and "rows begin in line 4" in out
    assert "--table-columns 1,3 --table-first-line 4" in err


def row(lines: list[str]) -> int:
    """Index of a row on the flank."""
    return len(lines) - 500


def replaced(change: Callable[[str], str]) -> Callable[[list[str]], list[str]]:
    return lambda lines: [*lines[: row(lines)], change(lines[row(lines)]), *lines[row(lines) + 1 :]]


SPOILS: dict[str, tuple[Callable[[list[str]], list[str]], str]] = {
    "a letter O for a zero": (replaced(lambda line: line[:-1] + "O"), "expected finite numbers"),
    "not a number": (
        replaced(lambda line: line[: line.rindex(line.split()[-1][-6:])] + " nan"),
        "expected finite|columns",
    ),
    "a column too few": (replaced(lambda line: line[:1] + "1"), "columns; every row needs"),
    "a huge number": (replaced(lambda line: line + "e300"), "larger than any angle or lift"),
    "text amid the rows": (replaced(lambda line: "Page 2"), "expected finite numbers"),
    "nothing": (lambda lines: [], "holds no numbers"),
    "the header alone": (lambda lines: ["Valve lift", "crank deg; lift mm"], "holds no numbers"),
    "the top alone": (
        lambda lines: lines[row(lines) - 10 : row(lines) + 50],
        "begin and end on the base circle|no column",
    ),
}


@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.parametrize("spoil", SPOILS)
def test_a_spoiled_file_ends_in_one_sentence(tmp_path, name, spoil):
    make, columns = FORMATS[name]
    change, says = SPOILS[spoil]
    with pytest.raises(InputError, match=says) as error:
        read(tmp_path, change(make()), columns)
    assert len(str(error.value).splitlines()) == 1 and "cam.txt" in str(error.value)


@pytest.mark.parametrize(
    ("columns", "says"),
    [
        ((1, 9), r"no column '9' among its 3, named 'Winkel', 'Hub Auslass', 'Hub Einlass': count them from 1"),
        ((0, 3), "no column '0'"),
        (("Winkel", "Hub"), "no column 'Hub'"),
        ((3, 3), "give one for the angle and one for the lift"),
    ],
)
def test_columns_that_are_not_there(tmp_path, columns, says):
    with pytest.raises(InputError, match=says):
        read(tmp_path, commas(), columns)


@pytest.mark.skipif(not MEASURED.is_dir(), reason="the measured tables lie outside the repository")
@pytest.mark.parametrize("name", ["motorbike-exhaust-ramps", "motorbike-intake-coarse"])
def test_real_files_are_read_with_every_row(name):
    rows = parsed(MEASURED / f"{name}.dat").rows
    assert np.array_equal(rows, np.loadtxt(MEASURED / f"{name}.dat"))
