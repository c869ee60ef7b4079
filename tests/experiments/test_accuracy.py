"""`--accuracy`'s two experiments at their small sizes: curves that rise, promises that are kept."""

import json

import numpy as np
import pytest

from camopt.verifier.accuracy import stored_curves
from experiments import accuracy_curves, accuracy_promise
from experiments.accuracy_promise import counts, row
from experiments.support.record import RESULTS


def test_curves(tmp_path, monkeypatch):
    monkeypatch.setattr(accuracy_curves, "write_json", lambda *_: pytest.fail("the small size is not for the package"))
    curves = accuracy_curves.main("small", tmp_path)["curves"]
    assert set(curves) == {"event", "dop853", "rkg", "tmm", "houbolt", "settling", "band_step"}
    for name in ("rkg", "tmm", "houbolt"):
        fine, coarse = curves[name]["median_um"]
        assert 0 < fine < coarse, name
        assert coarse > 1e3 * curves["event"]["median_um"][-1]  # it locates what they step over
    assert curves["band_step"]["median_um"][0] == 0.0
    stored = json.loads((tmp_path / "accuracy_curves.json").read_text())
    assert stored["provenance"]["command"] == "python -m experiments.accuracy_curves small"


def test_the_package_holds_the_measured_curves():
    """What `--accuracy` reads is what the experiment wrote at full size."""
    measured = json.loads((RESULTS / "accuracy_curves.json").read_text())
    assert measured["provenance"]["command"].endswith("full") and measured["draws"] == 40
    for name, curve in stored_curves().items():
        np.testing.assert_array_equal(curve.p90_um, np.array(measured["curves"][name]["p90_um"], dtype=float))


def test_promises(tmp_path):
    content = accuracy_promise.main("small", tmp_path)
    assert len(content["rows"]) == 3 * accuracy_promise.DRAWS["small"]
    assert not [r for r in content["rows"] if r["outcome"].endswith("promised") and r["outcome"] != "good, promised"]
    assert content["counts"]["lift, event"]["good, promised"] >= 2
    assert content["truth_against_dop853_um"] < 1.0
    assert (tmp_path / "accuracy_promise.json").exists()


@pytest.mark.parametrize(
    ("estimate", "true", "unknown", "outcome"),
    [
        (0.9, 0.5, 0.0, "good, promised"),
        (1.1, 0.5, 0.0, "good, flagged"),
        (0.9, 1.1, 0.0, "off, promised"),
        (np.inf, 2.0, 0.0, "off, flagged"),
        (0.9, 0.5, 0.4, "good, promised"),
        (0.9, 0.5, 0.6, "no truth, promised"),
        (0.9, 1.1, 0.2, "no truth, promised"),
        (2.0, 0.5, np.nan, "no truth, flagged"),
    ],
)
def test_outcomes(estimate, true, unknown, outcome):
    assert row("lift", 1.0, estimate, true, unknown, 0.1)["outcome"] == outcome


def test_a_promise_without_truth_is_not_kept():
    outcomes = {"good, promised": 6, "good, flagged": 2, "off, promised": 1, "no truth, promised": 1, "off, flagged": 3}
    rows = [{"quantity": "q", "outcome": outcome} for outcome, n in outcomes.items() for _ in range(n)]
    found = counts(rows)["q"]
    assert found["promises_kept_percent"] == 75.0
    assert found["good_ones_flagged_percent"] == 25.0
