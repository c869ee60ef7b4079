"""Checks of the small sizes of the experiments on cams and searches, by a function of the content for each."""

import numpy as np
import pytest

from experiments.drawing_limits import LIMITS
from experiments.measured_tables import TABLES
from experiments.near_limit import OUTCOMES, SMALL
from experiments.support.near_limit_cams import AROUND


def architectures(content):
    (row,) = content["rows"]
    assert row["ends"] == "confirmed" or (row["ends"] != "defect" and len(row["sentence"]) > 20)


def baselines(content):
    (row,) = content["baselines"]
    assert row["holds"] == (row["bounce_mm"] <= 0.05)
    assert 0.4 < row["area_ratio"] < 0.65082


def best_polydyne(content):
    least, largest = content["least_bounce"], content["largest_area_within_limit"]
    assert 0 < least["area_ratio"] < 0.618 and least["bounce_mm"] >= 0
    assert largest is None or (largest["bounce_mm"] <= 0.05 and largest["area_ratio"] >= 0.5)


def cam_families(content):
    for row in content["cams"]:
        assert 0.5 < row["area_ratio"] < 0.65082  # the bang-bang bound without a jerk limit
        assert row["continuity"]["ramp"][0] >= 2 and row["continuity"]["nose"] == [4]
    trapezoid = content["cams"][2]
    assert set(trapezoid["continuity"]["sections"]) == {2} and trapezoid["broken"] == []
    assert [b["speed_rpm"] for b in trapezoid["bounce"]] == [5000.0]


KNOWN_LAWS = {
    "modified trapezoid": (4.888, 61.43, 4.728, 3.3),
    "modified sine": (5.528, 69.47, 4.612, 16.6),
    "3-4-5": (5.774, 60.0, 4.753, 17.7),
    "cycloidal": (6.283, 39.48, 5.574, 11.3),
    "4-5-6-7": (7.513, 52.5, 4.923, 34.5),
}
"""Peak acceleration, peak jerk, least acceleration at that jerk, possible gain in per cent."""


def classical_laws(content):
    assert [row["law"] for row in content["laws"]] == list(KNOWN_LAWS)
    for row in content["laws"]:
        peak, jerk, least, gain = KNOWN_LAWS[row["law"]]
        assert row["rise"] == pytest.approx(1.0, abs=1e-6)
        assert row["peak_acceleration"] == pytest.approx(peak, abs=6e-4)
        assert row["peak_jerk"] == pytest.approx(jerk, abs=6e-3)
        assert row["least_acceleration"] == pytest.approx(least, abs=1e-3)  # with 500 intervals 2e-4 above the least
        assert row["bound"] <= row["least_acceleration"] <= row["bound"] * (1 + 3e-4)
        closed = row["peak_jerk"] / 4 * (1 - np.sqrt(1 - 32 / row["peak_jerk"]))
        assert row["least_acceleration"] == pytest.approx(closed, rel=2e-4)
        assert row["possible_gain_percent"] == pytest.approx(gain, abs=0.06)
    assert [row["peak"] for row in content["least_peaks"]] == pytest.approx([4, 32, 384, 6144], rel=1e-6)
    table = content["table_5_4"]
    assert table["bound_cm_per_rad3"] <= 17.0121 <= table["least_jerk_cm_per_rad3"] * (1 + 1e-6)
    assert table["least_jerk_cm_per_rad3"] <= table["bound_cm_per_rad3"] * (1 + 2e-4)


def drawing_limits(content):
    limits = [(row["follower"], row["limit"]) for row in content["rows"]]
    assert limits == [*(("flat", limit) for limit in LIMITS), ("finger", "nose_radius_min_mm")]
    for row in content["rows"]:
        assert row["broken_without"] == [row["limit"]] and row["broken_with"] == []
        if row["limit"] == "waves_max":  # sign changes come in pairs, so the count may stay below its limit
            assert row["value_with"] <= row["value_asked"] and (row["value_asked"] - row["value_with"]) % 2 == 0
        else:
            near = 1e-6 if row["limit"].startswith("snap") else 3e-3
            assert row["value_with"] == pytest.approx(row["value_asked"], abs=near)
        assert row["area_ratio_with"] < row["area_ratio_without"]
        assert row["area_ratio_with"] < row["bound"] < 0.62
        assert row["price_percent"] > 0
        searched = ["duration_at", "waves_max", "snap_max_mm_per_deg4"]
        searched += ["nose_radius_min_mm"] * (row["follower"] != "flat")
        assert row["bound_leaves_out"] == [key for key in searched if key == row["limit"]]


def flat_follower(content):
    sharp, blunt = content["noses"]
    assert 1 - blunt["stress_of_the_sharp"] / sharp["stress_of_the_sharp"] == pytest.approx(0.338, abs=5e-4)  # 34 %
    assert abs(blunt["entrainment_mm"]) < 1e-9 < abs(sharp["entrainment_mm"])
    assert 4 < content["film"]["flanks"] < 6.5 and 0.2 < content["film"]["nose"] < 0.4


def fronts(content):
    tight, loose = content["fronts"]["jerk_max_mm_per_deg3"]["area_ratio"]
    assert 0.3 < tight < loose < 0.6
    spring = content["spring"]
    assert spring["area_ratio_program"] >= spring["area_ratio_program_as_given"]
    assert 0.9 <= spring["rate"] <= 1.1 and 0.9 <= spring["preload"] <= 1.1


def gradient_ascent(content):
    calm, bouncing = content["calm"], content["bouncing"]
    for name, row in calm["ascents"].items():
        assert row["confirmed"] and row["area_ratio"] <= calm["area_ratio_of_the_shape"] + 1e-9, name
    assert bouncing["area_ratio_no_jump"] < bouncing["area_ratio_of_the_shape"]
    assert all(row["share_at_the_start"] > 50 for row in bouncing["ascents"].values())
    assert bouncing["ascents"]["adam 1e-3"]["largest_share"] < 50


def job_time(content):
    (row,) = content["cases"].values()
    assert row["exit_code"] == 0 and row["area_ratio"] > 0.5
    assert list(row["stages"]) == ["bound", "search", "verdict", "yield", "comparison"]
    assert 0 < sum(stage["processor_s"] for stage in row["stages"].values()) < row["processor_s"]
    assert max(stage["peak_memory_MB"] for stage in row["stages"].values()) <= row["peak_memory_MB"] * 1.01


def linear_programs(content):
    assert content["all"]["programs"] == 20 and content["all"]["boxed_undecided"] == 0
    assert sum(row["programs"] for row in content["kinds"].values()) == 20


def live_latency(content):
    """Answers are painted while a slider is dragged, and memory stays constant."""
    (row,) = content["scenes"]
    assert row["drag_all"]["answers"] > 5 and row["rest"]["answers"] > 3
    assert row["over_changes"]["states"] == {"ok": 20}
    first, *_, last = (one["resident_MB"] for one in row["over_changes"]["memory"])
    assert last < 1.2 * first


def measured_tables(content):
    """Smoothing is more accurate than interpolation in every case."""
    assert len(content["generated"]) == 4 and set(content["measured"]) == set(TABLES)
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


def near_limit(content):
    counts = content["table"]
    assert counts["cams"] == SMALL["cams"] == sum(counts[name] for name in OUTCOMES)
    assert counts["confirmed-BAD"] == 0
    assert all(AROUND[0] <= row["truth"]["share"] <= AROUND[1] for row in content["rows"])


def never_nothing(content):
    """The scene ends with a confirmed cam of a family."""
    assert content["exit_codes"] == {"0": 1}
    assert content["losses"] == [] and content["a_family_holds"] == content["confirmed"] == 1
    (row,) = content["rows"]
    assert row["best_family"] == "kurz" and row["bound"] > row["area_ratio"] >= row["family_area_ratio"] - 1e-9


def optimiser(content):
    (row,) = content["rows"]
    assert 0.54 < row["area_ratio"] < row["area_ratio_bound"] < 0.65
    assert row["bounce_mm"] <= 0.05
    assert row["acceleration_sign_changes"] >= 2 and row["acceleration_sign_changes"] % 2 == 0  # up, nose, down


def optimisers(content):
    search, drawn = content["runs"]
    assert 0.3 < drawn["area_ratio"] < search["area_ratio"] < 0.6
    assert drawn["ended"] == "budget spent"
    assert content["areas"]["CMA-ES"] == {"motori-1": [drawn["area_ratio"]]}
    for row in content["runs"]:
        assert all(at <= content["budget_s"] for at, _ in row["stairs"])
        assert np.all(np.diff([area for _, area in row["stairs"]]) > 0)


def real_trains(content):
    (found,) = (one for one in content.values() if isinstance(one, dict) and "verdict" in one)
    assert found["verdict"] == "confirmed" and found["broken"] == []
    assert 0.57 < found["area_ratio"] <= found["bound"]
    assert found["beside"]["multi-pol"]["used_part_of_a_limit"] > 1.0
    assert isinstance(found["beside"]["polydyne"], str), "its plain member breaks the acceleration limit"


def starts(content):
    """Every start leads to the same cam, which is larger than that of the job before its search used paths."""
    rows = content["rows"]
    assert {row["start"] for row in rows} == {"calmest", "Polydyne", "random 1"}
    assert {row["verdict"] for row in rows} == {"confirmed"}
    areas = [row["area_ratio"] for row in rows]
    np.testing.assert_allclose(areas, areas[0], rtol=1e-3)  # SETTLED_GAIN, to which a first stage settles
    assert min(areas) > content["scenes"]["motori-1"]["before"]
    for row in rows:
        assert len(row["course"]) == row["rounds"] > row["jacobians"] > 0 and row["search_s"] > 0.0
    found = content["scenes"]["motori-1"]["exact"]
    assert (found["least"], found["largest"], found["confirmed"]) == (min(areas), max(areas), len(rows))


def stated_yields(content):
    (row,) = content["scenes"].values()
    assert row["differs"] == 0 and row["open"] < row["judged"] == 3
    assert content["coverage"]["population"] == 60 and 0.93 <= content["coverage"]["covered"] <= 1.0


MOST_GROWTH_MB = 5.0
"""Allowed growth by caches and the allocator after a tenth of the tasks; tasks kept in memory would take 20 MB."""


def sweep_scaling(content):
    """A sweep costs little in addition to its tasks, and its memory stays constant."""
    for row in content["empty"].values():
        assert max(row["parent_ms_per_task"], row["ms_per_task"]) < 5.0
    memory_is_flat(content["many"])


def memory_is_flat(many):
    assert many["late_MB"] - many["early_MB"] < MOST_GROWTH_MB
    assert 100 < many["bytes_per_row"] < 1000


def yield_price(content):
    assert (list(content["rows"]), list(content["shares"])) == (["1"], ["motori-1, 70 %", "motori-1, 80 %"])
    for row in (content["rows"] | content["shares"]).values():
        assert 0.0 < row["area_ratio"] < 1.0 and row["low"] < row["share"] <= row["high"]
    assert content["prices"]["halved"] and content["prices"]["processor_s"] > 0.0
    assert content["literature"] and all(one["uses"] > 0.0 for one in content["literature"].values())
