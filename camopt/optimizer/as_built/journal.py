"""What drawn trains met with each cam of a search, in the run folder, so that a resumed run repeats no motion."""

from pathlib import Path

import numpy as np

from camopt.optimizer.as_built.drawn import DrawnTrains
from camopt.optimizer.step_files import StepFiles

FOLDER = "drawn"


class TrainsLog(StepFiles):
    """The steps' lines, and of each of them what the trains used and where they settled, as far as they were judged."""

    def __init__(self, folder: Path | None):
        super().__init__(folder, FOLDER)

    def recalled(self, step: int, z: np.ndarray, drawn: DrawnTrains) -> bool:
        """Whether an interrupted run judged this cam z (m) at this step; then `drawn` knows what it found.

        Raises InputError where the stored step belongs to another cam.
        """
        stored = self.stored(step, z, ("at", "used", "states"))
        if stored is None:
            return False
        trains, speeds = stored["at"]
        drawn.used[trains, :, speeds], drawn.states[trains, speeds] = stored["used"], stored["states"]
        return True

    def keep(self, step: int, z: np.ndarray, drawn: DrawnTrains, judged: np.ndarray) -> None:
        """Stores what the trains met at a step, at the speeds at which they were `judged` (t, s: bool)."""
        if self.kept:  # the states of thousands of trains are not copied for nothing
            at = np.nonzero(judged)
            self.store(step, z, {"at": np.stack(at), "used": drawn.used[at[0], :, at[1]], "states": drawn.states[at]})
