"""The statement of a cam's yield in a run, from trains that the search never used and an independent check of some.

The largest cam for the train as designed, or an estimate of that for trains as built, accompanies it.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import ceil
from pathlib import Path
from typing import Any

import numpy as np

from camopt.cam.design_file import as_written, write_design
from camopt.cam.lift import Lift
from camopt.cam.tables.lift_table import write_lift_table
from camopt.exact.kernel.propagators import forget_propagators
from camopt.measure.as_built import TrainAsBuilt, draws_of_trains, trains_as_built
from camopt.measure.yield_words import ADVISED, IDEAL, asked_sentence, share_sentence, spoiling_sentences
from camopt.measure.yields import Looks, Share, UsedLimits, rank_correlation_shares, share_of, yield_record
from camopt.optimizer.accuracy import Accuracy, accuracy_named
from camopt.optimizer.as_built.checks import has_a_yield
from camopt.optimizer.as_built.measured import Track, measure_trains, track, trains_journal
from camopt.optimizer.as_built.prices import estimated_area_ratio
from camopt.optimizer.search.search import find_cam
from camopt.scene.errors import NoCamFound
from camopt.scene.schema import Scene
from camopt.scene.train import build_train
from camopt.scene.units import MM
from camopt.storage.journal import Records
from camopt.verifier.verdict import verdict_on

JOURNAL = "trains.jsonl"
"""File in a run's folder with the limit usage of the trains of its statement."""
SAMPLE = 3
"""Number of trains that the independent methods judge: those closest to their limits on either side, and the first."""
BASELINE_TRAINS = 60
"""Number of trains with which each baseline is measured; few are enough, since most baselines fail in all of them."""
IDEAL_TRAINS, IDEAL_SPEEDS = 200, 11
"""Number of trains and of speeds over the band with which the largest cam for the train as designed is measured."""


@dataclass(frozen=True, repr=False)
class YieldStatement:
    """The limit usage of new trains with a cam, and whether the share that passes reaches the wanted one, if any."""

    wanted: float | None
    seed: int
    used: UsedLimits
    share: Share
    blame: dict[str, float]
    independent: tuple[dict, ...]
    baselines: Mapping[str, Share | str]

    @property
    def confirmed(self) -> bool | None:
        """Whether there are no reasons against the wanted share; None where none was wanted."""
        return None if self.wanted is None else not self.reasons

    @property
    def reasons(self) -> list[str]:
        """Reasons against the yield: too small a share, an interval that allows twice the loss, disagreeing methods.

        The interval need not begin at the wanted share itself: that would require a larger share, 0.996 of 1000 trains.
        """
        reasons = []
        if self.wanted is not None:
            low = 1.0 - 2 * (1.0 - self.wanted)
            if self.share.share < self.wanted - 1e-12:
                reasons.append("fewer trains hold")
            if self.share.low < low:
                reasons.append(f"the interval of so few trains begins below {100 * low:g} %")
        if disagreeing := [str(entry["train"]) for entry in self.independent if not entry["agrees"]]:
            reasons.append(f"independent methods disagree on train {', '.join(disagreeing)}")
        return reasons

    def as_dict(self) -> dict:
        """The content of verification.json's "yield"."""
        return {
            "wanted": self.wanted,
            "confirmed": self.confirmed,
            "reasons": self.reasons,
            **yield_record(self.used, self.share, self.seed, self.blame),
            "independent": list(self.independent),
            "baselines": {
                name: dict(vars(share)) if isinstance(share, Share) else {"reason": share}
                for name, share in self.baselines.items()
            },
        }

    @property
    def sentences(self) -> list[str]:
        """Sentences on the share, whether the wanted one is reached, which limit is broken first, and the causes."""
        record = self.as_dict()
        return [share_sentence(record), asked_sentence(record), *spoiling_sentences(record)]

    def __repr__(self) -> str:
        return f"YieldStatement({self.share} of {self.share.trains} trains as built)"

    def _repr_html_(self) -> str:
        return "<br>".join(self.sentences)


def statement_of_run(
    scene: Scene,
    lift: Lift,
    settings: Mapping[str, Any],
    folder: Path | None,
    *,
    baselines: Callable[[], Mapping[str, Lift | str]] = dict,
    advance: Callable[[float], None] = lambda share: None,
) -> YieldStatement | None:
    """The statement on a run's cam with its `settings`; None for a scene without scatter or limits on the motion.

    The results of the trains are stored in the folder, if there is one, from which an interrupted statement is resumed.
    `baselines` is called only where a yield is wanted; otherwise no train is judged by independent methods either.
    """
    if not has_a_yield(scene):
        return None
    effort, wanted = accuracy_named(settings["accuracy"]), settings.get("yield")
    looks = looks_of(effort, scene, wanted)
    return yield_statement(
        scene,
        lift,
        wanted,
        trains=looks.trains[-1],
        looks=looks.trains[:-1],
        speeds=sorted(scene.required_operation.speeds_rpm) if settings["speeds"] == "nominal" else effort.stated_speeds,
        seed=settings["seed"],
        baselines=None if wanted is None else baselines(),
        sample=0 if wanted is None else SAMPLE,
        journal=folder and folder / JOURNAL,
        advance=advance,
    )


def looks_of(effort: Accuracy, scene: Scene, wanted: float | None) -> Looks:
    """The numbers of trains after which a statement may end, if the wanted or the advised share is decided there.

    A train with curved laws costs as much as twenty others, so that the first interim look comes sooner for it.
    """
    most, parts = effort.stated_trains, effort.stated_parts
    if wanted is not None:
        most = max(most, ceil(effort.stated_failing / (1.0 - wanted)))
    parts = (*(() if build_train(scene).straight else (parts[0] / 4,)), *parts, 1.0)
    return Looks(tuple(round(part * most) for part in parts), ADVISED if wanted is None else wanted)


def yield_statement(
    scene: Scene,
    lift: Lift,
    wanted: float | None,
    *,
    trains: int,
    looks: Sequence[int] = (),
    speeds: int | Sequence[float],
    seed: int = 0,
    baselines: Mapping[str, Lift | str] | None = None,
    sample: int = SAMPLE,
    journal: Path | None = None,
    advance: Callable[[float], None] = lambda share: None,
) -> YieldStatement:
    """The statement on a cam from a number of `trains` of this seed, at a number of speeds over the scene's band or at
    the crankshaft `speeds` (s) [r/min].

    Measuring ends early after one of the interim `looks` (numbers of trains) if these trains decide whether the share
    is above or below the wanted one, or the advised one where none is wanted. `baselines` are cams by name, or a
    sentence where there is no cam. The independent methods judge `sample` trains. The results of the trains are stored
    in the file `journal`. `advance` receives the share of the work that is done.
    """
    speeds_rpm = (
        np.linspace(*scene.required_operation.band_rpm, speeds) if isinstance(speeds, int) else np.array(speeds)
    )
    conditions = track(scene, lift, speeds_rpm)
    interim = Looks((*looks, trains), ADVISED if wanted is None else wanted)
    usage = _measured(scene, conditions, interim, trains_journal(journal), seed, advance)
    used = UsedLimits(tuple(conditions.limits), speeds_rpm, usage)
    share = share_of(usage.max(axis=(1, 2)) <= 1.0, interim)
    blame = rank_correlation_shares(draws_of_trains(scene, len(usage), seed=seed), used.worst)
    baseline_trains = trains_as_built(scene, min(len(usage), BASELINE_TRAINS), seed=seed) if baselines else []
    baseline_shares = {
        name: _baseline(scene, cam, speeds_rpm, baseline_trains) for name, cam in (baselines or {}).items()
    }
    sample_trains = {t: trains_as_built(scene, 1, seed=seed, first=t)[0] for t in sampled(used.worst, sample)}
    judged = tuple(by_independent_methods(built, lift, used, t) for t, built in sample_trains.items())
    forget_propagators()
    return YieldStatement(wanted, seed, used, share, blame, judged, baseline_shares)


def _measured(
    scene: Scene, conditions: Track, looks: Looks, journal: Records, seed: int, advance: Callable[[float], None]
) -> np.ndarray:
    """Limit usage (t, l, s) of the trains up to the look after which measuring ends."""
    most = looks.trains[-1]
    for count in looks.trains:
        used = measure_trains(scene, conditions, count, journal, seed=seed, advance=lambda more: advance(more / most))
        if looks.ends(int(np.sum(used.max(axis=(1, 2)) <= 1.0)), count):
            return used
    raise AssertionError("counting ends after the last look")


def sampled(worst: np.ndarray, count: int = SAMPLE) -> list[int]:
    """Numbers of `count` trains: those closest to their limits that pass and that fail, and train 0 last."""
    if not count:
        return []
    order = np.argsort(np.abs(np.nan_to_num(worst, posinf=np.inf) - 1.0), kind="stable")
    most = max(1, (count - 1) // 2)
    sides = (order[worst[order] <= 1.0][:most], order[worst[order] > 1.0][:most])
    return list(dict.fromkeys(int(t) for t in (*sides[0], *sides[1], 0)))[:count]


def _baseline(
    scene: Scene, cam: Lift | str, speeds_rpm: Sequence[float] | np.ndarray, trains: Sequence[TrainAsBuilt]
) -> Share | str:
    """The share of trains that pass with a baseline's cam, or the sentence in place of a cam."""
    if isinstance(cam, str):
        return cam
    # most trains fail at the top speed, and only the others are measured at all speeds
    passes = track(scene, cam, speeds_rpm[-1:]).used(trains).max(axis=(1, 2)) <= 1.0
    if passes.any() and len(speeds_rpm) > 1:
        passing = [train for train, good in zip(trains, passes, strict=True) if good]
        usage = track(scene, cam, speeds_rpm[:-1]).used(passing)
        passes[passes] = usage.max(axis=(1, 2)) <= 1.0
    return share_of(passes)


def by_independent_methods(built: TrainAsBuilt, lift: Lift, used: UsedLimits, t: int) -> dict:
    """The verdict on a train, by methods that share no code with the search, at the speed of its largest limit usage.

    The methods agree if they confirm a train that passes and do not confirm one that fails. Every verdict agrees on a
    train within a twentieth of its limit, and the verdicts "sensitive" and "not converged" agree with both.
    """
    speed = float(used.speeds_rpm[int(np.argmax(used.used[t].max(axis=0)))])
    verdict = verdict_on(built.scene, built.cam(lift), (speed,), band_step_rpm=None).speeds[0].verdict
    worst = float(used.worst[t])
    near = abs(worst - 1.0) < 0.05 or verdict in ("sensitive", "not converged")
    agrees = bool(near or (verdict == "confirmed") == (worst <= 1.0))
    return {"train": t, "speed_rpm": speed, "used": worst, "verdict": verdict, "agrees": agrees}


def beside(
    scene: Scene,
    lift: Lift,
    settings: Mapping[str, Any],
    stated: YieldStatement | None,
    folder: Path,
    start: Lift | None = None,
) -> dict[str, Any]:
    """Further entries of verification.json's "yield", according to the `settings` of a run.

    Where a yield was wanted, they describe the cam for the train as designed, which is written into the folder; its
    search starts from the cam `start`, as the run's does. Otherwise, if fewer trains pass than is advised, they contain
    an estimate of the area ratio for the advised share, which is at most that of the run's cam.
    """
    if "yield" in settings:
        return {"ideal": write_ideal(scene, settings, folder, start)}
    if stated is None or stated.share.low >= ADVISED or settings["speeds"] != "band":
        return {}
    try:
        area_ratio = estimated_area_ratio(scene, ADVISED, settings["seed"])
    except NoCamFound:
        return {}
    if area_ratio is None or scene.design is None:
        return {}
    return {"advised": {"share": ADVISED, "area_ratio": min(area_ratio, lift.area_ratio_in(scene.design))}}


def write_ideal(scene: Scene, settings: Mapping[str, Any], folder: Path, start: Lift | None = None) -> dict | None:
    """Writes `ideal/design.json` and `ideal/lift.csv`, and returns the cam's area ratio and its share of trains with
    the interval. The cam is evaluated by the search's judge alone, without a verdict. None where no cam was found."""
    effort = accuracy_named(settings["accuracy"])
    try:
        search = find_cam(scene, settings["speeds"], effort, settings["gradient"], start=start, seed=settings["seed"])
    except NoCamFound:
        return None
    cam = search.confirmed[-1]
    lift, place = as_written(cam.lift), folder / IDEAL
    place.mkdir(exist_ok=True)
    write_design(place / "design.json", cam.lift, scene.required_design.max_lift_mm * MM)
    write_lift_table(place / "lift.csv", lift)
    stated = yield_statement(
        scene, lift, None, trains=IDEAL_TRAINS, speeds=IDEAL_SPEEDS, seed=settings["seed"], sample=0
    )
    return {"area_ratio": cam.area_ratio, **vars(stated.share)}
