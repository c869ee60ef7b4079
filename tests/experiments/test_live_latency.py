"""The latency experiment at its small size: answers come while a hand drags, and memory stays flat."""

import json
import shutil

import pytest

from experiments import live_latency

pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")


@pytest.mark.skipif(shutil.which("chromium") is None, reason="no Chromium on this machine")
def test_answers_come_and_memory_stays(tmp_path):
    (content,) = live_latency.main("small", tmp_path)["scenes"]
    assert content["drag_all"]["answers"] > 5 and content["rest"]["answers"] > 3
    assert content["drag_all"]["p95_ms"] > 0
    assert content["over_changes"]["states"] == {"ok": live_latency.SIZES["small"][3]}
    first, *_, last = (row["resident_MB"] for row in content["over_changes"]["memory"])
    assert last < 1.2 * first
    assert json.loads((tmp_path / "live_latency.json").read_text())["scenes"][0]["loop_clock_s"] > 0
    assert content["reached"]["drag_p95"] == (content["drag_all"]["p95_ms"] <= 300.0)


def test_percentiles_of_nothing():
    assert live_latency.percentiles([]) == {"answers": 0, "p50_ms": None, "p95_ms": None, "largest_ms": None}
