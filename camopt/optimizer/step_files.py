"""What a search met at each of its steps, in the run folder, so that a resumed run repeats no motion."""

import io
import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from camopt.scene.errors import InputError
from camopt.storage import plain, write_bytes
from camopt.storage.journal import append_line, whole_lines

HISTORY = "history.jsonl"


class StepFiles:
    """`history.jsonl`, a line per step, and `NAME/*.npz`, what was found out at a step; in a run folder, or nowhere."""

    def __init__(self, folder: Path | None, name: str):
        self._folder, self._name, self._noted = folder, name, 0
        if folder is not None:
            (folder / name).mkdir(exist_ok=True)
            self._noted = len(whole_lines(folder / HISTORY))

    @property
    def kept(self) -> bool:
        """Whether anything is kept: a search without a run folder keeps nothing."""
        return self._folder is not None

    def stored(self, step: int, z: np.ndarray, names: Sequence[str]) -> dict[str, np.ndarray] | None:
        """The arrays of this step of an interrupted run, None where there are none; z (m) is the step's cam.

        Raises InputError where they belong to another cam or lack one of `names`: the folder is of another search.
        """
        path = self._path(step)
        if path is None or not path.exists():
            return None
        with np.load(path, allow_pickle=False) as found:
            arrays = dict(found)
        known = {"z", *names} <= set(arrays) and arrays["z"].shape == z.shape
        if not (known and np.allclose(arrays["z"], z, rtol=0, atol=1e-9)):
            raise InputError(
                f"{path}: belongs to another search: resume with the scene, the options and the seed of the "
                f"interrupted run, or choose another --out"
            )
        return arrays

    def store(self, step: int, z: np.ndarray, arrays: dict[str, np.ndarray]) -> None:
        """Stores the arrays of a step with its cam z (m)."""
        path = self._path(step)
        if path is not None:
            content = io.BytesIO()
            np.savez(content, allow_pickle=False, z=z, **arrays)
            write_bytes(path, content.getvalue())

    def note(self, line: dict) -> None:
        """Appends a line to the history, but for a step that an interrupted run noted already."""
        if self._folder is not None and line["iteration"] > self._noted:
            append_line(self._folder / HISTORY, json.dumps(plain(line), allow_nan=False))

    def _path(self, step: int) -> Path | None:
        return None if self._folder is None else self._folder / self._name / f"{step:04d}.npz"
