"""Coarse to fine: the search fine from the start ends in the same design, and takes longer."""

import numpy as np

from experiments import coarse_to_fine
from experiments.coarse_to_fine import EFFORT, variants


def test_small_size(tmp_path):
    content = coarse_to_fine.main("small", tmp_path)
    rows = {row["search"]: row for row in content["rows"]}
    coarse, fine = rows["coarse to fine"], rows["fine throughout"]
    assert {row["verdict"] for row in rows.values()} == {"confirmed"}
    assert fine["lift_apart_um"] < 1.0 and coarse["area_ratio"] > 0.5
    np.testing.assert_allclose(fine["area_ratio"], coarse["area_ratio"], rtol=1e-4)
    assert all(row["processor_s"] > 0 and row["cams_judged"] >= row["cams_failed"] for row in rows.values())
    assert (tmp_path / "coarse_to_fine.json").exists()


def test_the_variants_differ_in_what_they_say():
    effort = variants(EFFORT["full"])
    assert [e.judge_stride for e in effort.values()] == [4, 1, 1]
    assert [e.program_speeds for e in effort.values()] == [9, 9, 33]
    assert {e.judged_speeds for e in effort.values()} == {187}
