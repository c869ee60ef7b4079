"""The experiment on three laws of a damped contact at its small size: one train, and figures that differ by law."""

import pytest

from camopt.verifier.from_outside import find_spec
from camopt.verifier.outside.forces import LAWS_OF_CONTACT
from experiments import contact_laws


@pytest.mark.skipif(find_spec("exudyn") is None, reason="the extra `outside` is not installed")
def test_the_small_size(tmp_path):
    rows = contact_laws.main("small", tmp_path)["rows"]
    assert tuple(row["law"] for row in rows) == LAWS_OF_CONTACT
    assert all(low <= high for row in rows for low, high in (row["jump_mm"], row["bounce_mm"]))
    assert len({row["jump_mm"][1] for row in rows}) == 3
    assert (tmp_path / "contact_laws.json").is_file()
