"""The stages of a run, with their wall time, processor time, peak memory and compilation, and the progress bar."""

import os
import sys
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import asdict, dataclass
from itertools import accumulate
from threading import get_ident

from numba.core import event
from tqdm import tqdm

from camopt.optimizer.accuracy import Accuracy

VERDICT_STEPS, YIELD_STEPS, COMPARISON_STEPS = 30, 20, 40
"""Cost of verdict, drawn trains and comparison in judged cams of the search, to estimate the remaining time."""
OTHER_STEPS = 10
"""Approximate number of cams that the search judges before and after the programs with fed-back margins."""


@dataclass
class Cost:
    """The cost of one stage. Processor time is that of all threads; memory is the process's highest so far."""

    clock_s: float = 0.0
    processor_s: float = 0.0  # including processes that the stage waited for
    compilation_s: float = 0.0  # processor time of numba's compilations, and wall time of JAX's
    peak_memory_MB: float | None = None  # None if the system does not report it


def processor_s() -> float:
    """Processor time of this process and of the processes that it has waited for [s]."""
    times = os.times()
    return time.process_time() + times.children_user + times.children_system


class StageClock:
    """The stages of a run in the order in which they ran. The costs of a stage that is entered twice are added."""

    def __init__(self):
        self.costs: dict[str, Cost] = {}
        self.begun = time.perf_counter()

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Measures the cost of the block, even if it raises."""
        begun, spent = time.perf_counter(), processor_s()
        with _compiling() as compiled:
            try:
                yield
            finally:
                cost = self.costs.setdefault(name, Cost())
                cost.clock_s += time.perf_counter() - begun
                cost.processor_s += processor_s() - spent
                cost.compilation_s += compiled.seconds
                cost.peak_memory_MB = peak_memory_mb()

    def times_s(self) -> dict[str, float]:
        """Wall time of every stage and, under "total", since this object was made [s]."""
        total = time.perf_counter() - self.begun
        return {name: round(cost.clock_s, 3) for name, cost in self.costs.items()} | {"total": round(total, 3)}

    def spent_s(self, stage: str) -> float:
        """Processor time of a stage [s]; zero before its end."""
        return round(self.costs[stage].processor_s, 3) if stage in self.costs else 0

    def as_dict(self) -> dict[str, dict]:
        """Every stage's cost, for provenance.json."""
        return {
            name: {key: None if value is None else round(value, 3) for key, value in asdict(cost).items()}
            for name, cost in self.costs.items()
        }


def peak_memory_mb() -> float | None:
    """The process's highest resident memory so far [MB]; None if the system does not report it."""
    try:
        from resource import RUSAGE_SELF, getrusage
    except ImportError:  # Windows
        return None
    highest = getrusage(RUSAGE_SELF).ru_maxrss
    return highest * (1 if sys.platform == "darwin" else 1024) / 1000**2  # bytes there, KiB elsewhere


class _Compilation(event.Listener):
    """Processor time of numba's compilations [s]; nested compilations are not counted twice."""

    def __init__(self):
        self.seconds, self._depth, self._begun = 0.0, {}, {}

    def on_start(self, event):
        thread = get_ident()
        self._depth[thread] = self._depth.get(thread, 0) + 1
        if self._depth[thread] == 1:
            self._begun[thread] = time.thread_time()

    def on_end(self, event):
        thread = get_ident()
        if thread in self._begun:
            self._depth[thread] -= 1
            if self._depth[thread] == 0:
                self.seconds += time.thread_time() - self._begun.pop(thread)

    def add(self, name: str, seconds: float, **_) -> None:
        """Callback for JAX, which reports the duration of each step of a compilation."""
        if name.startswith("/jax/core/compile/"):
            self.seconds += seconds


@contextmanager
def _compiling() -> Iterator[_Compilation]:
    """Listens to numba and, if it is already loaded, to JAX."""
    compilation, monitoring = _Compilation(), sys.modules.get("jax.monitoring")
    if monitoring is not None:
        monitoring.register_event_duration_secs_listener(compilation.add)
    try:
        with event.install_listener("numba:compile", compilation):
            yield compilation
    finally:
        if monitoring is not None:
            monitoring.unregister_event_duration_listener(compilation.add)


class Progress:
    """A progress bar over all stages of the job; hidden if it is not `wanted`."""

    def __init__(self, wanted: bool, effort: Accuracy, gradient: str, compared: bool):
        search = OTHER_STEPS + (effort.feedback_rounds if gradient != "none" else 0)
        steps = search, VERDICT_STEPS, YIELD_STEPS, COMPARISON_STEPS if compared else 0
        ends = zip(("search", "verdict", "yield", "comparison"), accumulate(steps), strict=True)
        self._end: dict[str, int] = dict(ends)
        layout = "{desc}: {percentage:3.0f}% |{bar}| {elapsed}, {remaining} left{postfix}"
        self._bar = tqdm(total=sum(steps), disable=None if wanted else True, dynamic_ncols=True, bar_format=layout)
        self._stage, self._unwanted = "", not wanted

    def __enter__(self) -> "Progress":
        return self

    def __exit__(self, *exception) -> None:
        self._bar.close()

    def begin(self, stage: str) -> None:
        """Begins the stage "search", "verdict", "yield" or "comparison"; the stages before it are complete."""
        start = [0, *self._end.values()][list(self._end).index(stage)]
        self._bar.update(max(0, start - self._bar.n))
        self._stage = stage
        self._bar.set_description(stage)

    def say(self, words: str) -> None:
        """Prints a message before the first stage, on a line of its own that stays, also in a file."""
        if not self._unwanted:
            with self.make_room():
                print(words, file=sys.stderr, flush=True)

    def end(self) -> None:
        """Completes the bar."""
        self._bar.update(self._bar.total - self._bar.n)

    def step(self, line: dict) -> None:
        """Shows a line of the search's history, and advances by one step."""
        best = line["best_area_ratio"]
        self._bar.set_description(line["stage"], refresh=False)
        if "failing" in line:
            last = f"{line['failing']} of {line['trains']} trains fail"
        else:
            last = f"bounce {line['worst_bounce_mm']:.3f} mm, worst at {line['worst_speed_rpm']:.0f} r/min"
        confirmed = "no confirmed cam yet" if best is None else f"best area ratio {best:.4f}"
        self._bar.set_postfix_str(f"{confirmed}, {last}", refresh=False)
        self._update(1)

    def advance(self, share: float) -> None:
        """Advances by a share of the drawn trains or of the comparison."""
        self._update(share * (YIELD_STEPS if self._stage == "yield" else COMPARISON_STEPS))

    def _update(self, steps: float) -> None:
        """Advances by this number of steps, at most to the end of the stage."""
        self._bar.update(min(steps, max(0, self._end[self._stage] - self._bar.n)))

    def make_room(self) -> AbstractContextManager:
        """Context in which other output can be printed to the terminal without the bar."""
        return self._bar.external_write_mode()
