"""The bar of a whole job: its stage, its best value, and the time left."""

import sys
from contextlib import AbstractContextManager

from tqdm import tqdm

from camopt.optimizer.accuracy import Accuracy

VERDICT_STEPS, YIELD_STEPS, COMPARISON_STEPS = 30, 20, 40
"""What verdict, drawn trains and comparison take, in judged cams of the search: only the estimate of the time left
hangs on it."""
OTHER_STEPS = 10
"""Cams that the search judges before margins are fed back and after that, more or less."""


class Progress:
    """A bar over the job's stages, whose end is the job's; silent where not wanted."""

    def __init__(self, wanted: bool, effort: Accuracy, gradient: str, compared: bool):
        self._end = {"search": OTHER_STEPS + (effort.feedback_rounds if gradient != "none" else 0)}
        self._end["verdict"] = self._end["search"] + VERDICT_STEPS
        self._end["yield"] = self._end["verdict"] + YIELD_STEPS
        self._end["comparison"] = self._end["yield"] + (COMPARISON_STEPS if compared else 0)
        total = max(self._end.values())
        form = "{desc}: {percentage:3.0f}% |{bar}| {elapsed}, {remaining} left{postfix}"
        self._bar = tqdm(total=total, disable=None if wanted else True, dynamic_ncols=True, bar_format=form)
        self._stage, self._unwanted = "", not wanted

    def __enter__(self) -> "Progress":
        return self

    def __exit__(self, *exception) -> None:
        self._bar.close()

    def begin(self, stage: str) -> None:
        """The stage "search", "verdict", "yield" or "comparison" begins; those before it are over."""
        start = [0, *self._end.values()][list(self._end).index(stage)]
        self._bar.update(max(0, start - self._bar.n))
        self._stage = stage
        self._bar.set_description(stage)

    def say(self, words: str) -> None:
        """What happens before the first stage, on a line of its own that stays, in a file too."""
        if not self._unwanted:
            with self.make_room():
                print(words, file=sys.stderr, flush=True)

    def end(self) -> None:
        """The job is done."""
        self._bar.update(self._bar.total - self._bar.n)

    def step(self, line: dict) -> None:
        """A line of the search's history."""
        best = line["best_area_ratio"]
        self._bar.set_description(line["stage"], refresh=False)
        if "failing" in line:
            last = f"{line['failing']} of {line['trains']} trains fail"
        else:
            last = f"bounce {line['worst_bounce_mm']:.3f} mm, worst at {line['worst_speed_rpm']:.0f} r/min"
        known = "no confirmed cam yet" if best is None else f"best area ratio {best:.4f}"
        self._bar.set_postfix_str(f"{known}, {last}", refresh=False)
        self._update(1)

    def advance(self, share: float) -> None:
        """A share of the drawn trains or of the comparison is done."""
        self._update(share * (YIELD_STEPS if self._stage == "yield" else COMPARISON_STEPS))

    def _update(self, steps: float) -> None:
        """So many of the stage's steps are done, at most all of them."""
        self._bar.update(min(steps, max(0, self._end[self._stage] - self._bar.n)))

    def make_room(self) -> AbstractContextManager:
        """While it lasts, others may print to the terminal without the bar in their way."""
        return self._bar.external_write_mode()
