"""What a sweep costs beside its tasks, at small size."""

import os

import pytest

from experiments import sweep_scaling

MOST_MS = 5.0
MOST_GROWTH_MB = 5.0
"""What caches and the allocator may still take after a tenth of the tasks; tasks that were kept would take 20 MB."""


def test_overhead_is_small_and_memory_flat(tmp_path):
    content = sweep_scaling.main("small", tmp_path)
    for name in ("one process", "two processes"):
        row, cores = content["empty"][name], os.cpu_count() or 1
        assert max(row["parent_ms_per_task"], row["ms_per_task"]) < MOST_MS
        assert 0 < row["parent_ms_per_task"] < cores * row["ms_per_task"]  # its threads may run at the same time
    assert content["settled"].keys() == content["speedup"].keys() == {"one process", "two processes"}
    many = content["many"]
    assert many["late_MB"] - many["early_MB"] < MOST_GROWTH_MB
    assert 100 < many["bytes_per_row"] < 1000
    assert {p.name for p in tmp_path.iterdir()} == {"sweep_scaling.json"}


@pytest.mark.long
@pytest.mark.timeout(3600)
def test_a_million_tasks_by_two_processes_keep_memory_flat(tmp_path):
    many = sweep_scaling.memory(1_000_000, 2, tmp_path)
    assert many["late_MB"] - many["early_MB"] < MOST_GROWTH_MB
    assert 100 < many["bytes_per_row"] < 1000
