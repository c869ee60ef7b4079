"""Spoiled tables: each of ten spoils is mended, which is said, or refused with a sentence."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from camopt.cam.lift import Lift
from camopt.cam.tables.lift_table import read_lift_table
from camopt.scene import InputError
from camopt.scene.units import DEG, MM
from tests.cam.cams import KODAMA, MEASURED, MULTI_POL, POLYDYNE, difference

Rows = list[tuple[float, float]]


def crank_rows(cam: Lift, noise_um: float, seed: int) -> Rows:
    """A table as the measured ones are: crank degrees from mid-flank on, two apart, metres to seven decimals."""
    degrees = np.arange(0.0, 720.0, 2.0)
    lift = cam((degrees / 2 - 40) * DEG) + np.random.default_rng(seed).normal(0, 1e-6 * noise_um, len(degrees))
    return list(zip(degrees.tolist(), np.round(lift, 7).tolist(), strict=True))


def file_rows(name: str) -> Rows:
    return [tuple(row) for row in np.loadtxt(MEASURED / f"{name}.dat").tolist()]


def from_nose(rows: Rows) -> Rows:
    """The rows from the nose on, ascending, for half a turn of the cam."""
    i = near_top(rows)
    turned = [*rows[i:], *((angle + 720, lift) for angle, lift in rows[:i])]
    return [(angle, lift) for angle, lift in turned if angle <= rows[i][0] + 360]


def text(rows: Rows, delimiter: str = " ") -> str:
    return "\n".join(f"{angle:.4f}{delimiter}{lift:.9f}" for angle, lift in rows) + "\n"


def near_top(rows: Rows) -> int:
    return int(np.argmax([lift for _, lift in rows]))


def glitch(rows: Rows) -> str:
    i = near_top(rows) - 12
    return text([*rows[:i], (rows[i][0], rows[i][1] + 0.0004), *rows[i + 1 :]])


def missing(rows: Rows, count: int) -> str:
    i = near_top(rows) - 20
    return text([*rows[:i], *rows[i + count :]])


def repeated(rows: Rows) -> str:
    i = near_top(rows)
    return text([*rows[: i + 1], (rows[i][0], rows[i][1] - 1e-4), *rows[i + 1 :]])


def half(rows: Rows) -> str:
    return text(from_nose(rows))


def wrapped(rows: Rows) -> str:
    """From the nose on, the angles beginning anew at 720."""
    i = near_top(rows)
    return text([*rows[i:], *rows[:i]])


def torn(rows: Rows) -> str:
    return text(rows, ",").replace(".", ",")


SPOILS: dict[str, tuple[Callable[[Rows], str], str]] = {
    "glitch": (glitch, "set aside"),
    "two rows missing": (lambda rows: missing(rows, 2), "rows are missing between lines"),
    "forty rows missing": (lambda rows: missing(rows, 40), "refused: the lift would have to be invented"),
    "decimal commas": (lambda rows: text(rows).replace(".", ","), "its commas are read as decimal signs"),
    "commas everywhere": (torn, "refused: commas separate columns and are decimal signs too"),
    "repeated angle": (repeated, "refused: the angle is repeated"),
    "half a lobe": (half, "half a lobe"),
    "wrap-around": (wrapped, "its angles begin anew"),
    "descending": (lambda rows: text(rows[::-1]), "its angles descend throughout"),
    "rows that jump": (lambda rows: text([*rows[:40], *rows[60:80], *rows[40:60], *rows[80:]]), "refused: decreases"),
}
"""Spoil -> how a table's text is made of its rows, and what becomes of it."""
TABLES = {
    "polydyne": lambda: crank_rows(POLYDYNE, 0.3, 1),
    "multi-pol": lambda: crank_rows(MULTI_POL, 0.3, 2),
    "motorbike-exhaust-ramps": lambda: file_rows("motorbike-exhaust-ramps"),
    "motorbike-intake-coarse": lambda: file_rows("motorbike-intake-coarse"),
}


def read(file: Path, content: str) -> Lift:
    file.write_text(content)
    return read_lift_table(file, KODAMA, "crank", "m")


@pytest.mark.parametrize("name", TABLES)
@pytest.mark.parametrize("spoil", SPOILS)
def test_spoiled_tables(tmp_path, name, spoil):
    if name.startswith("motorbike") and not MEASURED.is_dir():
        pytest.skip("the measured tables lie outside the repository")
    rows = TABLES[name]()
    spoiled, becomes = SPOILS[spoil][0](rows), SPOILS[spoil][1]
    whole = read(tmp_path / "whole.dat", text(rows))
    if becomes.startswith("refused: "):
        with pytest.raises(InputError, match=becomes.removeprefix("refused: ")) as error:
            read(tmp_path / "cam.dat", spoiled)
        assert "\n" not in str(error.value)
        return
    found = read(tmp_path / "cam.dat", spoiled)
    said = " ".join(found.parameters.get("mended", []))
    if becomes == "set aside":
        assert len(found.parameters["outlier_lines"]) == len(whole.parameters.get("outlier_lines", [])) + 1
    else:
        assert becomes in said
    assert difference(found, whole) / MM < 0.1
