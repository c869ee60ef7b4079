"""The experiment on the handbook's pushrod train: every printed number to its digits."""

import pytest

from experiments import handbook


def test_every_printed_number_comes_out(tmp_path):
    rows = handbook.main("small", tmp_path)["rows"]
    assert len(rows) == 4
    for row in rows:
        assert row["camopt"] == pytest.approx(row["printed"], rel=4e-3), row["what"]  # printed to two or three digits
    assert (tmp_path / "handbook-modes.png").stat().st_size > 10_000
