"""MOTORI 2004: what its Figures 5 and 6 say of the contact force, and what the extreme conditions must do."""

import numpy as np
import pytest

from experiments import motori


@pytest.fixture(scope="module")
def content(tmp_path_factory):
    return motori.main("small", tmp_path_factory.mktemp("motori"))


def row(content, table, **wanted):
    return next(r for r in content[table] if all(r[k] == v for k, v in wanted.items()))


def test_stiffening_calms_the_contact_up_to_50_and_hammers_at_1000(content):
    kept = "damping constant 1200 kg/s"
    soft, middle, hard = (row(content, "stiffness", kept=kept, train_kN_per_mm=k) for k in (10, 50, 1000))
    assert middle["ripple_N"] < soft["ripple_N"] < hard["ripple_N"] / 2
    assert middle["jump_mm"] == 0 and middle["contact_force_min_N"] > 100
    assert hard["jump_mm"] > 0 and hard["contact_force_min_N"] == 0 and hard["hop_um"] > 3


def test_at_one_damping_ratio_the_stiff_train_is_calm_over_the_duration(content):
    hard = row(content, "stiffness", kept="damping ratio 0.1", train_kN_per_mm=1000)
    assert hard["jump_mm"] == 0
    assert hard["ripple_N"] < row(content, "stiffness", kept="damping ratio 0.1", train_kN_per_mm=50)["ripple_N"] / 2


def test_closing_the_clearance_hits_like_a_mass_on_a_spring(content):
    # 0.011 mm/deg at 2000 r/min is 0.132 m/s; v sqrt(k m) = 2045 N, less damping, plus what lifts the seat's preload
    hard = row(content, "stiffness", kept="damping constant 1200 kg/s", train_kN_per_mm=1000)
    assert hard["landing_force_N"] == pytest.approx(0.132 * np.sqrt(1e9 * 0.24), rel=0.1)


def test_extreme_conditions_show_where_the_engines_fail(content):
    for engine in motori.ENGINES:
        fast = row(content, "extremes", engine=engine, case="high speed (4000)")
        assert fast["jump_mm"] > 1 and fast["bounce_mm"] > 1 and fast["clash_force_max_N"] > 1000
        calm = row(content, "extremes", engine=engine, case="low speed (300)")
        assert calm["jump_mm"] == 0 and calm["ripple_N"] < 5
        wide = row(content, "extremes", engine=engine, case="clearance 0.4 mm, beyond the ramp")
        assert wide["jump_mm"] > 0.1 and wide["contact_force_max_N"] > 1.3 * calm["contact_force_max_N"]


def test_soft_springs_hold_less_and_hard_ones_more(content):
    for engine in motori.ENGINES:
        least = [row(content, "extremes", engine=engine, case=c)["contact_force_min_N"]
                 for c in ("soft spring (x 0.5)", "as given", "hard spring (x 2)")]  # fmt: skip
        assert least[0] < least[1] - 100 < least[2] - 200
