"""The motions of drawn trains, train by train and chunk by chunk, stored as they are measured."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from tqdm import tqdm

from camopt.measure.as_built import trains_as_built
from camopt.optimizer.as_built.track import Track
from camopt.scene.schema import Scene
from camopt.storage import append_line, plain, whole_lines

CHUNK = 20
"""Trains that are measured between two entries in the journal."""


@dataclass
class TrainsJournal:
    """What was measured, by the tolerance that was halved ("" for none) and the train's number, in a file if named."""

    path: Path | None

    def __post_init__(self) -> None:
        self._rows: dict[tuple[str, int], dict] = {}
        for line in whole_lines(self.path) if self.path else ():
            row = json.loads(line)
            self._rows[row["halved"], row["train"]] = row

    def add(self, halved: str, number: int, used: Mapping[str, np.ndarray]) -> None:
        """Notes how much of each limit a train uses at each speed (s)."""
        row = plain({"halved": halved, "train": number, "used": used})
        self._rows[halved, number] = row
        if self.path is not None:
            append_line(self.path, json.dumps(row, allow_nan=False))

    def missing(self, halved: str, count: int) -> list[int]:
        """The numbers below `count` that were not measured yet."""
        return [i for i in range(count) if (halved, i) not in self._rows]

    def used(self, halved: str, count: int) -> np.ndarray:
        """The used parts (t, l, s) of the first `count` trains; what the file cannot tell, infinity, is null there."""
        rows = [[*self._rows[halved, i]["used"].values()] for i in range(count)]
        return np.nan_to_num(np.array(rows, dtype=float), nan=np.inf)


def measure_trains(
    scene: Scene, track: Track, count: int, journal: TrainsJournal, *, seed: int, halved: str, progress: bool
) -> np.ndarray:
    """The used parts (t, l, s) of the first `count` trains of a scene, whose tolerance `halved` is already so."""
    missing = journal.missing(halved, count)
    name = f"{halved} halved" if halved else "trains"
    with tqdm(total=count, initial=count - len(missing), disable=None if progress else True, desc=name) as bar:
        for begin in range(0, len(missing), CHUNK):
            numbers = missing[begin : begin + CHUNK]
            drawn = [trains_as_built(scene, 1, seed=seed, first=i)[0] for i in numbers]
            for number, used in zip(numbers, track.used(drawn), strict=True):
                journal.add(halved, number, dict(zip(track.limits, used, strict=True)))
            bar.update(len(numbers))
    return journal.used(halved, count)
