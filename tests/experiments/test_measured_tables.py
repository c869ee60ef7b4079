"""Measured tables against their truth, at the small size."""

from experiments import measured_tables


def test_smoothing_beats_interpolation_everywhere(tmp_path):
    content = measured_tables.main("small", tmp_path)
    assert len(content["generated"]) == 4
    for row in content["generated"]:
        assert row["refused"] == row["rows_rejected"] == 0
        assert 0.8 < row["noise_estimated_um"] / row["noise_um"] < 1.25
        assert row["lift_rms_um"] < 0.8 * row["noise_um"]
        assert row["acceleration_rms_mm_per_deg2"] < 0.35 * row["plain_acceleration_rms_mm_per_deg2"]
        assert row["acceleration_rms_percent"] < 5
        assert row["acceleration_rms_percent"] < row["acceleration_stated_percent"]
    for held in content["stated"].values():
        assert held["tables"] == 4 and held["refused"] == 0
        assert held["acceleration_within"] == held["peak_within"] == 1
    assert set(content["measured"]) == set(measured_tables.TABLES)
    assert (tmp_path / "measured_tables-small.json").is_file()
