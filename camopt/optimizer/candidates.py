"""The cams that a search ends with, before the full verdict."""

from collections.abc import Sequence
from typing import Protocol, TypeVar

from camopt.cam.design_file import as_written
from camopt.cam.lift import Lift
from camopt.optimizer.accuracy import Accuracy
from camopt.scene.schema import Scene
from camopt.scene.train import build_train
from camopt.verifier.verdict import Verdict, verdict_on

CANDIDATES = 4
"""Confirmed cams of the search, largest first, that the full verdict may be asked about."""


class SearchedCam(Protocol):
    """What every search says of a cam that it found."""

    @property
    def lift(self) -> Lift:
        """The cam's lift law."""
        ...

    @property
    def area_ratio(self) -> float:
        """Area over the rectangle of largest lift and duration."""
        ...


F = TypeVar("F", bound=SearchedCam)


def full_verdict(scene: Scene, lift: Lift, speeds: str, effort: Accuracy) -> Verdict:
    """The verdict on a run's design: at the listed speeds and, with `speeds` "band", over the band."""
    asked = effort.verdict
    band_step = asked.band_step_rpm if speeds == "band" else None
    return verdict_on(scene, lift, None, asked.methods_of(build_train(scene)), band_step, asked.demand)


def confirmed_cam(scene: Scene, candidates: Sequence[F], speeds: str, effort: Accuracy) -> tuple[F, Verdict, list[F]]:
    """The largest candidate that the full verdict confirms, and those that it refused before.

    `candidates` grow. Where none is confirmed, the largest one with its own verdict and all that were judged.
    """
    first, refused = None, []
    for found in candidates[::-1][:CANDIDATES]:
        verdict = full_verdict(scene, as_written(found.lift), speeds, effort)
        first = first or (found, verdict)
        if verdict.verdict == "confirmed":
            return found, verdict, refused
        refused.append(found)
    assert first is not None, "a search that ends has a confirmed cam"
    return *first, refused


def fallen_back(chosen: SearchedCam, refused: Sequence[SearchedCam]) -> dict:
    """Whether the verdict had to go back to a smaller cam: cams it judged, and the largest area ratio it refused."""
    judged = len(refused) + (not any(found is chosen for found in refused))
    largest = max((found.area_ratio for found in refused), default=None)
    return {"candidates_judged": judged, "largest_refused_area_ratio": largest}
