"""What a run says of a cam's yield: by draws that the search never saw, a sample of them judged independently."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from camopt.cam.lift import Lift
from camopt.measure.as_built import TrainAsBuilt, trains_as_built
from camopt.measure.yields import Share, UsedLimits, blame, counted, share_of
from camopt.optimizer.as_built.track import Track, track
from camopt.scene.schema import Scene
from camopt.verifier.verdict import verdict_on

CHUNK = 20
"""Trains between two reports of progress."""
SAMPLE = 3
"""Trains that the independent methods judge: those that come nearest to their limits on either side, and the first."""
BASELINE_TRAINS = 60
"""Trains with which each baseline is measured: most of them hold in none."""


@dataclass(frozen=True)
class YieldStatement:
    """What `trains` fresh trains use of the limits with a cam, and whether that is the share that was wanted."""

    wanted: float
    seed: int
    used: UsedLimits
    share: Share
    blame: dict[str, float]
    independent: tuple[dict, ...]
    baselines: Mapping[str, Share | str]

    @property
    def confirmed(self) -> bool:
        """Whether nothing speaks against it."""
        return not self.reasons

    @property
    def reasons(self) -> list[str]:
        """Why the yield is not confirmed: the share misses what was wanted, its interval allows more than twice the
        loss, or methods disagree.

        That the interval's lower end reaches the wanted share itself would need a cam of a larger one: 0.996 of 1000.
        """
        low, found = 1.0 - 2 * (1.0 - self.wanted), []
        if self.share.share < self.wanted - 1e-12:
            found.append("fewer trains hold")
        if self.share.low < low:
            found.append(f"the interval of so few trains begins below {100 * low:g} %")
        if disagreeing := [str(entry["train"]) for entry in self.independent if not entry["agrees"]]:
            found.append(f"independent methods disagree on train {', '.join(disagreeing)}")
        return found

    def as_dict(self) -> dict:
        """The content of verification.json's "yield"."""
        return {
            "wanted": self.wanted,
            "confirmed": self.confirmed,
            "reasons": self.reasons,
            **_of(self.share),
            "seed": self.seed,
            "speeds_rpm": self.used.speeds_rpm.tolist(),
            "first_broken": counted(self.used),
            "blame": self.blame,
            "independent": list(self.independent),
            "baselines": {
                name: _of(found) if isinstance(found, Share) else {"reason": found}
                for name, found in self.baselines.items()
            },
        }


def _of(share: Share) -> dict:
    return {"share": share.share, "low": share.low, "high": share.high, "trains": share.trains}


def yield_statement(
    scene: Scene,
    lift: Lift,
    wanted: float,
    *,
    trains: int,
    speeds: int,
    seed: int = 0,
    baselines: Mapping[str, Lift | str] | None = None,
    advance: Callable[[float], None] = lambda share: None,
) -> YieldStatement:
    """The statement on a cam by so many trains of this seed at so many speeds over the scene's band.

    `baselines` by name are cams, or a sentence where there is none; `advance` is told the share of the work done.
    """
    assert scene.operation is not None, "load_scene(..., need=...) guarantees it"
    speeds_rpm = np.linspace(*scene.operation.band_rpm, speeds)
    way, drawn = track(scene, lift, speeds_rpm), trains_as_built(scene, trains, seed=seed)
    parts = []
    for begin in range(0, trains, CHUNK):
        parts.append(way.used(drawn[begin : begin + CHUNK]))
        advance(len(parts[-1]) / trains)
    used = UsedLimits(tuple(way.limits), speeds_rpm, np.concatenate(parts))
    draws = {label: np.array([one.draws[label] for one in drawn]) for label in drawn[0].draws}
    others = {name: _baseline(scene, cam, speeds_rpm, drawn) for name, cam in (baselines or {}).items()}
    sample = tuple(_by_independent_methods(drawn[t], lift, used, t) for t in sampled(used.worst))
    return YieldStatement(wanted, seed, used, share_of(used.holds), blame(draws, used.worst), sample, others)


def sampled(worst: np.ndarray) -> list[int]:
    """The train that comes nearest to its limits and holds, the one that breaks them least, and the first."""
    order = np.argsort(np.abs(np.nan_to_num(worst, posinf=np.inf) - 1.0), kind="stable")
    holding, breaking = order[worst[order] <= 1.0], order[worst[order] > 1.0]
    return list(dict.fromkeys(int(t) for t in (*holding[:1], *breaking[:1], 0)))[:SAMPLE]


def _baseline(
    scene: Scene, cam: Lift | str, speeds_rpm: Sequence[float] | np.ndarray, drawn: Sequence[TrainAsBuilt]
) -> Share | str:
    if isinstance(cam, str):
        return cam
    way: Track = track(scene, cam, speeds_rpm[-1:])  # most fail at the top; those that hold there are judged everywhere
    few = drawn[:BASELINE_TRAINS]
    holds = way.used(few).max(axis=(1, 2)) <= 1.0
    if holds.any():
        others = track(scene, cam, speeds_rpm).used([one for one, good in zip(few, holds, strict=True) if good])
        holds[holds] = others.max(axis=(1, 2)) <= 1.0
    return share_of(holds)


def _by_independent_methods(one: TrainAsBuilt, lift: Lift, used: UsedLimits, t: int) -> dict:
    """What methods that share no code with the search say of a train at the speed at which it uses its limits most.

    They agree where they confirm a train that holds and do not confirm one that does not; a train within a twentieth
    of its limit may be called sensitive.
    """
    speed = float(used.speeds_rpm[int(np.argmax(used.used[t].max(axis=0)))])
    verdict = verdict_on(one.scene, one.cam(lift), (speed,), band_step_rpm=None)
    worst = float(used.worst[t])
    said = verdict.speeds[0].verdict
    near = abs(worst - 1.0) < 0.05 or said in ("sensitive", "not converged")
    agrees = bool(near or (said == "confirmed") == (worst <= 1.0))
    return {"train": t, "speed_rpm": speed, "used": worst, "verdict": said, "agrees": agrees}
