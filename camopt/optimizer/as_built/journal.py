"""What drawn trains met with each cam of a search, in the run folder, so that a resumed run repeats no motion."""

import io
import json
from pathlib import Path

import numpy as np

from camopt.optimizer.as_built.drawn import DrawnTrains
from camopt.scene.errors import InputError
from camopt.storage import append_line, plain, whole_lines, write_bytes

HISTORY, FOLDER = "history.jsonl", "drawn"


class TrainsLog:
    """`history.jsonl`, a line per cam, and `drawn/*.npz`, what the trains used and where they settled; or nothing."""

    def __init__(self, folder: Path | None):
        self.folder = folder
        if folder is not None:
            (folder / FOLDER).mkdir(exist_ok=True)
        self._noted = 0 if folder is None else len(whole_lines(folder / HISTORY))

    def recalled(self, step: int, z: np.ndarray, drawn: DrawnTrains) -> bool:
        """Whether an interrupted run judged this cam z (m) at this step; then `drawn` knows what it found.

        Raises InputError where the stored step belongs to another cam.
        """
        path = self._path(step)
        if path is None or not path.exists():
            return False
        with np.load(path, allow_pickle=False) as stored:
            same = "at" in stored and stored["z"].shape == z.shape and np.allclose(stored["z"], z, rtol=0, atol=1e-9)
            if not same:
                raise InputError(
                    f"{path}: belongs to another search: resume with the scene, yield, accuracy, gradient and seed of "
                    f"the interrupted run, or choose another --out"
                )
            trains, speeds = stored["at"]
            drawn.used[trains, :, speeds], drawn.states[trains, speeds] = stored["used"], stored["states"]
        return True

    def keep(self, step: int, z: np.ndarray, drawn: DrawnTrains, judged: np.ndarray) -> None:
        """Stores what the trains met at a step, at the speeds at which they were `judged` (t, s: bool)."""
        path = self._path(step)
        if path is not None:
            content = io.BytesIO()
            at = np.nonzero(judged)
            used, states = drawn.used[at[0], :, at[1]], drawn.states[at]
            np.savez(content, allow_pickle=False, z=z, at=np.stack(at), used=used, states=states)
            write_bytes(path, content.getvalue())

    def note(self, line: dict) -> None:
        """Appends a line to the history, but for a step that an interrupted run noted already."""
        if self.folder is not None and line["iteration"] > self._noted:
            append_line(self.folder / HISTORY, json.dumps(plain(line), allow_nan=False))

    def _path(self, step: int) -> Path | None:
        return None if self.folder is None else self.folder / FOLDER / f"{step:04d}.npz"
