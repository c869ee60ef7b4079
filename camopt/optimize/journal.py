"""The search's journal in the run folder: what was judged, so that a resumed run repeats its steps without the cost."""

import io
import json
from pathlib import Path

import numpy as np

from camopt.optimize.judge import Judged
from camopt.scene.errors import InputError
from camopt.storage import append_line, plain, whole_lines, write_bytes

HISTORY = "history.jsonl"
ARRAYS = ("speeds_rpm", "limit", "share", "states")


class Journal:
    """`history.jsonl` (one line per step) and `judged/*.npz` (what the judge found), in a run folder or nowhere."""

    def __init__(self, folder: Path | None):
        self.folder = folder
        if folder is not None:
            (folder / "judged").mkdir(exist_ok=True)
        self._noted = 0 if folder is None else len(whole_lines(folder / HISTORY))

    def recall(self, step: int, z: np.ndarray) -> Judged | None:
        """What was judged at this step of an interrupted run, None if nothing was.

        Raises InputError where the stored step belongs to another cam: the folder is of another search.
        """
        path = self._path(step)
        if path is None or not path.exists():
            return None
        with np.load(path, allow_pickle=False) as stored:
            if stored["z"].shape != z.shape or not np.allclose(stored["z"], z, rtol=0, atol=1e-9):
                raise InputError(
                    f"{path}: belongs to another search: resume with the scene, speeds, accuracy, gradient and seed "
                    f"of the interrupted run, or choose another --out"
                )
            figures = {k.removeprefix("figure:"): stored[k] for k in stored.files if k.startswith("figure:")}
            limited = tuple(str(n) for n in stored["limited"])
            named = {k: stored[k] for k in ARRAYS}
            return Judged(figures=figures, limited=limited, **named)

    def keep(self, step: int, z: np.ndarray, judged: Judged) -> None:
        """Stores what was judged at a step."""
        path = self._path(step)
        if path is None:
            return
        content = io.BytesIO()
        stored = {f"figure:{k}": v for k, v in judged.figures.items()}
        stored |= {k: getattr(judged, k) for k in ARRAYS}
        stored |= {"z": z, "limited": np.array(judged.limited, dtype=str)}
        np.savez(content, allow_pickle=False, **stored)
        write_bytes(path, content.getvalue())

    def note(self, line: dict) -> None:
        """Appends one line to the history, but for a step that an interrupted run noted already."""
        if self.folder is not None and line["iteration"] > self._noted:
            append_line(self.folder / HISTORY, json.dumps(plain(line), allow_nan=False))

    def _path(self, step: int) -> Path | None:
        return None if self.folder is None else self.folder / "judged" / f"{step:04d}.npz"
