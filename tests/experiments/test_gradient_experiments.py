"""Gradients against the truth over width, grid and precision, and what a batch of them costs: small sizes."""

import numpy as np
import pytest

from experiments import ensemble_gradients, gradient_batch, gradient_bias, gradient_cost


@pytest.mark.long
def test_refined_gradients_are_right_below_the_jump_and_failures_stay_in_the_table(tmp_path):
    rows = gradient_bias.main("small", tmp_path)["rows"]
    assert len(rows) == 2 * 2 * 2
    narrow = next(r for r in rows if (r["speed_rpm"], r["eps_m"], r["precision"]) == (5000, 2e-9, "float64"))
    assert narrow["relative_error"] < 1e-2 and narrow["value_bias"] < 1e-3 and narrow["cosine"] > 0.9999
    wide = next(r for r in rows if (r["speed_rpm"], r["eps_m"], r["precision"]) == (5000, 1e-6, "float64"))
    assert wide["relative_error"] > narrow["relative_error"]


@pytest.mark.long
def test_a_batch_costs_less_than_trajectories_one_by_one(tmp_path):
    content = gradient_batch.main("small", tmp_path)
    yardstick, exact, through_jax, batch, refined = content["methods"]
    assert yardstick["times_cheaper_than_diffrax"] == 1.0
    assert max(row["error_mm"] for row in (yardstick, exact, through_jax, batch)) <= 1e-3
    for row in (exact, through_jax):
        assert max(judged["relative_error"] for judged in row["at_speed"]) < 1e-4
        assert (
            row["processor_times_cheaper_than_diffrax"] > 30
        )  # ten times less than quiet: small batch, loaded machine
    assert refined["at_speed"][0]["relative_error"] < 1e-2
    assert all(np.isfinite(row["ms_per_trajectory"]) for row in content["methods"])


def test_the_mean_over_cams_does_what_its_gradient_promises_where_it_is_smooth(tmp_path):
    content = ensemble_gradients.main("small", tmp_path)
    rows = [r for r in content["rows"] if (r["metric"], r["gradient"]) == ("jump_mm", "mean, pathwise")]
    assert len(rows) == 1 and rows[0]["promised"] < 0.0
    assert rows[0]["change"] == pytest.approx(rows[0]["promised"], rel=2e-2)


def test_the_error_of_a_gradient_sees_sign_and_size():
    differences = np.array([[1.0, 2.0], [1.1, 2.0]])
    assert gradient_bias.against(np.array([1.1, 2.0]), differences)["relative_error"] == 0.0
    flipped = gradient_bias.against(np.array([-1.0, -2.0]), differences)
    assert flipped["cosine"] == pytest.approx(-1.0, abs=1e-2) and flipped["relative_error"] > 1.9
    assert gradient_bias.against(np.array([2.0, 4.0]), differences)["relative_error"] > 0.9
    assert np.isnan(gradient_bias.against(np.full(2, np.nan), differences)["relative_error"])


def test_a_gradient_costs_little_more_than_its_value(tmp_path):
    """2.2 times is the aim and 1.5 to 1.7 what is measured; a loaded machine scatters even processor times."""
    content = gradient_cost.main("small", tmp_path)
    assert set(content["worst_ratio"]) == {"20", "200"}
    assert max(content["worst_ratio"].values()) < 3.0
    assert all(row["ratio"] > 1.0 for row in content["rows"])
