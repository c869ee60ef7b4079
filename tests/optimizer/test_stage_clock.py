"""What a run's stages cost, and what of it was compiling."""

import time

import numba
import pytest

from camopt.optimizer.stage_clock import StageClock, peak_memory_mb


def busy(seconds: float) -> None:
    begun = time.process_time()
    while time.process_time() - begun < seconds:
        pass


def test_a_stage_that_is_entered_twice_is_counted_together():
    clock = StageClock()
    for _ in range(2):
        with clock.stage("search"):
            busy(0.05)
    with clock.stage("verdict"):
        pass
    cost = clock.costs["search"]
    assert 0.1 <= cost.processor_s < 0.1 + clock.times_s()["total"] and cost.compilation_s == 0.0
    assert list(clock.as_dict()) == ["search", "verdict"] and list(clock.times_s()) == ["search", "verdict", "total"]
    assert clock.costs["verdict"].processor_s < 0.05


def test_compiling_is_told_from_running():
    @numba.njit
    def inner(x):
        return x + 1.0

    @numba.njit
    def outer(x):
        return inner(x) * 2.0

    clock = StageClock()
    with clock.stage("compiles"):
        assert outer(1.0) == 4.0
    with clock.stage("runs"):
        assert outer(1.0) == 4.0
    cost = clock.costs["compiles"]
    assert 0.0 < cost.compilation_s <= cost.processor_s + 0.01  # the inner one is not counted twice
    assert clock.costs["runs"].compilation_s == 0.0


def test_a_stage_that_raises_is_measured_too():
    clock = StageClock()
    with pytest.raises(ZeroDivisionError), clock.stage("search"):
        raise ZeroDivisionError
    assert "search" in clock.costs


def test_the_peak_of_memory_never_falls():
    before = peak_memory_mb()
    held = bytearray(200_000_000)
    held[::4096] = b"x" * len(held[::4096])
    after = peak_memory_mb()
    del held
    assert before is not None and after is not None
    assert after >= before > 10 and peak_memory_mb() >= after
