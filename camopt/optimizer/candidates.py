"""The candidates for the cam of a run, and the largest of them that the full verdict confirms.

They are the last cams of the search and every family's largest member under the limits on the shape. If one of them is
confirmed, the run ends with a cam.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from camopt.cam.design_file import as_written
from camopt.cam.families.registry import FAMILIES
from camopt.cam.lift import Lift
from camopt.exact.settled import settled_metrics
from camopt.measure.limits import broken_by_shape, motion_limits
from camopt.optimizer.accuracy import Accuracy
from camopt.scene.errors import NoCamFound
from camopt.scene.schema import Scene
from camopt.scene.train import build_train
from camopt.verifier.verdict import Verdict, verdict_on

RULED_OUT = 1.5
"""Share of a limit beyond which event-exact alone rules out a family's member: it is one of the methods that must
agree. Nearer to the limit the verdict decides, with its finer steps."""


class CandidateCam(Protocol):
    """A cam of a search or of a family."""

    @property
    def lift(self) -> Lift: ...

    @property
    def area_ratio(self) -> float: ...


class Member(NamedTuple):
    """The largest member of a family under a scene's limits on the shape."""

    lift: Lift
    area_ratio: float


def family_cams(scene: Scene) -> dict[str, Lift | str]:
    """Every family's largest member under the limits on the shape, by name, or a sentence why it has none."""
    from camopt.optimizer.baselines.comparison import member_or_sentence  # which loads matplotlib

    return {name: member_or_sentence(scene, name) for name in FAMILIES}


def ruled_out(scene: Scene, lift: Lift) -> str:
    """The limit that the settled event-exact motion breaks by far at a listed speed; empty if there is none."""
    operation = scene.required_operation
    metrics = settled_metrics([build_train(scene)], [lift], [scene.cam_speed(s) for s in operation.speeds_rpm])
    for key, limit in motion_limits(scene.required_design).items():
        shares = limit.share(metrics.worst(limit.metric)[0, 0])
        if shares.max() > RULED_OUT:
            return f"{key} at {operation.speeds_rpm[int(shares.argmax())]:g} r/min"
    return ""


@dataclass(frozen=True)
class Choice:
    """A run's cam with its verdict, and the larger cams that were refused before it, each with the reason."""

    cam: CandidateCam
    verdict: Verdict
    refused: Sequence[tuple[CandidateCam, str]]

    @property
    def fell_back(self) -> dict:
        """Whether the verdict fell back to a smaller cam of the search: the number of its cams that were judged, and
        the largest area ratio that was refused."""
        refused = [cam for cam, _ in self.refused if not isinstance(cam, Member)]
        judged = len(refused) + (not isinstance(self.cam, Member) and not any(cam is self.cam for cam in refused))
        largest = max((cam.area_ratio for cam in refused), default=None)
        return {"candidates_judged": judged, "largest_refused_area_ratio": largest}

    def why_a_family(self, searched: Sequence[CandidateCam], failed: str) -> str:
        """Why a family's cam is delivered instead of one of the search; empty if it is one of the search."""
        if not isinstance(self.cam, Member):
            return ""
        largest = searched[-1].area_ratio if searched else 0.0
        search = f"The search's largest cam has an area ratio of {largest:.5f}" if searched else f"The search: {failed}"
        larger = f" The larger ones were refused: {_reasons(self.refused)}." if self.refused else ""
        return (
            f"{search}. The cam is the largest that the family {self.cam.lift.family} has under the limits on the "
            f"shape, and the largest candidate that the verdict confirms.{larger}"
        )


def full_verdict(scene: Scene, lift: Lift, speeds: str, effort: Accuracy) -> Verdict:
    """The verdict on a run's design: at the listed speeds and, with `speeds` "band", over the band."""
    final = effort.verdict
    band_step_rpm = final.band_step_rpm if speeds == "band" else None
    return verdict_on(scene, lift, None, final.methods_of(build_train(scene)), band_step_rpm, final.tolerances)


def largest_confirmed(
    scene: Scene,
    searched: Sequence[CandidateCam],
    speeds: str,
    effort: Accuracy,
    families: Mapping[str, Lift | str] | None = None,
    failed: str = "",
) -> Choice:
    """The largest cam that the full verdict confirms, of the `searched` cams, which ascend in area, and of the
    `family_cams`, which may be left out. A family's member is judged only if no larger cam is confirmed.

    If none is confirmed, the result is the search's largest cam with its own verdict, and all cams that were judged.
    Raises NoCamFound, with the reason why the search `failed`, if the search has no cam either.
    """
    design = scene.required_design
    lifts = [cam for cam in (families or {}).values() if not isinstance(cam, str) and not broken_by_shape(cam, design)]
    members = [Member(lift, lift.area_ratio_in(design)) for lift in lifts]
    candidates: list[CandidateCam] = sorted([*searched[::-1], *members], key=lambda cam: -cam.area_ratio)
    first, refused = None, []
    for cam in candidates:
        if isinstance(cam, Member) and (reason := ruled_out(scene, cam.lift)):
            refused.append((cam, reason))
            continue
        verdict = full_verdict(scene, as_written(cam.lift), speeds, effort)
        if verdict.verdict == "confirmed":
            return Choice(cam, verdict, refused)
        if not isinstance(cam, Member):
            first = first or (cam, verdict)
        refused.append((cam, next(iter(verdict.broken), verdict.verdict)))
    if first:
        return Choice(*first, refused)
    no_member = "no family has a member that holds the limits on the shape"
    beside = f"of the families' largest cams none is confirmed: {_reasons(refused)}" if refused else no_member
    raise NoCamFound(f"{failed}, and {beside}")


def _reasons(refused: Sequence[tuple[CandidateCam, str]]) -> str:
    """Each refused cam with its area ratio and the reason."""
    return "; ".join(
        f"{cam.lift.family if isinstance(cam, Member) else 'the search'} with {cam.area_ratio:.5f} ({reason})"
        for cam, reason in refused
    )
