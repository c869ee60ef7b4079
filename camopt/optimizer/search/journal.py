"""The search's journal in the run folder: what was judged, so that a resumed run repeats its steps without the cost."""

from pathlib import Path

import numpy as np

from camopt.optimizer.search.judge import Judged
from camopt.optimizer.step_files import StepFiles

FOLDER = "judged"
ARRAYS = ("speeds_rpm", "limit", "share", "states", "spread")
FIGURE = "figure:"


class Journal(StepFiles):
    """The steps' lines, and what the judge found at each of them."""

    def __init__(self, folder: Path | None):
        super().__init__(folder, FOLDER)

    def recall(self, step: int, z: np.ndarray) -> Judged | None:
        """What was judged at this step of an interrupted run, None if nothing was.

        Raises InputError where the stored step belongs to another cam.
        """
        stored = self.stored(step, z, (*ARRAYS, "limited"))
        if stored is None:
            return None
        figures = {name.removeprefix(FIGURE): stored[name] for name in stored if name.startswith(FIGURE)}
        limited = tuple(str(name) for name in stored["limited"])
        return Judged(figures=figures, limited=limited, **{name: stored[name] for name in ARRAYS})

    def keep(self, step: int, z: np.ndarray, judged: Judged) -> None:
        """Stores what was judged at a step."""
        arrays = {name: getattr(judged, name) for name in ARRAYS} | {"limited": np.array(judged.limited, dtype=str)}
        self.store(step, z, arrays | {FIGURE + name: values for name, values in judged.figures.items()})
