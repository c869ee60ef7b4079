"""`camopt yield`: the share of trains as built that hold the limits, what breaks first, which tolerance is to blame."""

from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from camopt.cam.lift import Lift
from camopt.measure.as_built import trains_as_built
from camopt.measure.limits import broken_by_shape, motion_limits
from camopt.measure.yields import Share, UsedLimits, blame, counted, share_of
from camopt.optimizer.as_built.track import track
from camopt.optimizer.as_built.wanted import check_scatter
from camopt.plots import save
from camopt.scene.as_built import GRINDING
from camopt.scene.errors import InputError
from camopt.scene.schema import AS_BUILT, Scene
from camopt.scene.toml_text import scene_toml
from camopt.storage import plain, run_folder, run_identity, write_json, write_text
from camopt.study.yields.measurement import TrainsJournal, measure_trains

TRAINS, SPEEDS = 1000, 11
"""How many trains are drawn, and at how many speeds of the band they are judged, where nothing else is said."""
JOURNAL, SUMMARY = "trains.jsonl", "yield.json"


@dataclass(frozen=True, repr=False)
class Yield:
    """What was found of a cam: `used` limits of every train (t, l, s), the share that holds, what spoils the others.

    `halved` tells by tolerance what the share of the same trains would be with half of it; empty where not asked.
    """

    scene: str
    cam: str
    seed: int
    used: UsedLimits
    share: Share
    first_broken: dict[str, dict]
    blame: dict[str, float]
    halved: dict[str, dict]
    broken_by_shape: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """The content of `yield.json`."""
        return {
            "cam": self.cam,
            "share": self.share.share,
            "low": self.share.low,
            "high": self.share.high,
            "trains": self.share.trains,
            "seed": self.seed,
            "speeds_rpm": self.used.speeds_rpm.tolist(),
            "first_broken": self.first_broken,
            "blame": self.blame,
            "halved": self.halved,
            "broken_by_shape": list(self.broken_by_shape),
        }

    @property
    def table(self) -> xr.DataArray:
        """How much of each limit each train uses at each speed, labelled."""
        coordinates = {"limit": list(self.used.limits), "speed_rpm": self.used.speeds_rpm}
        return xr.DataArray(self.used.used, coordinates, ("train", "limit", "speed_rpm"), name="used")

    def plot(self):
        """How much of each limit the trains use over the speed, as a matplotlib Figure."""
        from camopt.plots.yields import used_against_speed

        by_limit = dict(zip(self.used.limits, np.moveaxis(self.used.used, 1, 0), strict=True))
        return used_against_speed(self.used.speeds_rpm, by_limit, f"{self.scene}, {self.cam}: {self.share}")

    def plot_blame(self):
        """Which tolerance is to blame, and what half of it would buy, as a matplotlib Figure."""
        from camopt.plots.yields import blame_bars

        bought = {label: entry["share"] - self.share.share for label, entry in self.halved.items()}
        return blame_bars(self.blame, bought)

    def __repr__(self) -> str:
        return f"Yield({self.scene}, {self.cam}: {self.share} of {self.share.trains} trains)"

    def _repr_html_(self) -> str:
        return "<br>".join(yield_lines(self))


def manufacturing_yield(
    scene: Scene,
    cam: Lift,
    trains: int = TRAINS,
    *,
    speeds_rpm: Sequence[float] | None = None,
    seed: int = 0,
    halve: bool = False,
    out: Path | str | None = None,
    resume: bool = False,
    progress: bool = False,
) -> Yield:
    """The share of drawn trains that hold every limit on the motion at every speed, and what spoils the others.

    `speeds_rpm` (s) are crankshaft speeds, by default `SPEEDS` of them over the scene's band. Train i hangs on `seed`
    and i alone. With `halve` the same trains are measured with every tolerance halved in turn. With `out` a run folder
    is written, train by train; with `resume` it goes on there, and more trains may be asked for. Raises InputError
    for a scene without limits on the motion or without anything that scatters, and for a folder as `run_folder` does.
    """
    check_scatter(scene)
    if not motion_limits(scene.design):
        raise InputError(
            f"yield: [design] of {scene.name} limits nothing of the motion, so every train would hold: give it "
            f"bounce_max_mm or another limit on the motion"
        )
    speeds = _speeds(scene, speeds_rpm)
    identity = run_identity("yield", scene, seed=seed, speeds_rpm=speeds, cam=_digest(cam), as_built=_scatter(scene))
    with run_folder(out, identity, resume, [JOURNAL]) if out is not None else nullcontext() as folder:
        journal, way = TrainsJournal(folder and folder / JOURNAL), track(scene, cam, speeds)
        asked = {"seed": seed, "progress": progress}
        used = UsedLimits(
            tuple(way.limits), np.array(speeds), measure_trains(scene, way, trains, journal, halved="", **asked)
        )
        narrower = _halved(scene) if halve else {}
        others = {
            name: measure_trains(one, way, trains, journal, halved=name, **asked) for name, one in narrower.items()
        }
        found = _summary(scene, cam, seed, used, others)
        if folder is not None:
            _write(folder, scene, found)
    return found


def yield_lines(found: Yield) -> list[str]:
    """What was found, in sentences."""
    n, speeds = found.share.trains, found.used.speeds_rpm
    good = round(found.share.share * n)
    lines = [
        f"{found.scene}, {found.cam}: {good} of {n} trains hold every limit on the motion at {len(speeds)} speeds from "
        f"{speeds[0]:g} to {speeds[-1]:g} r/min: {found.share}"
    ]
    for limit, entry in found.first_broken.items():
        often = max(entry["speeds_rpm"], key=entry["speeds_rpm"].get)
        lines.append(f"breaks first: {limit} in {_counted(entry['trains'])}, most often at {often} r/min")
    if any(found.blame.values()):
        parts = ", ".join(f"{label} {100 * part:.0f} %" for label, part in found.blame.items())
        rest = max(0.0, 1.0 - sum(found.blame.values()))
        lines.append(
            f"to blame (squared rank correlations with the worst used limit): {parts}; {100 * rest:.0f} % unexplained"
        )
    for label, entry in sorted(found.halved.items(), key=lambda item: -item[1]["share"]):
        lines.append(
            f"{label} halved: {100 * entry['share']:.1f} %, {_counted(entry['gained'])} gained and {entry['lost']} lost"
        )
    if found.broken_by_shape:
        lines.append(f"note: the cam's shape, as designed, breaks {', '.join(found.broken_by_shape)}")
    return lines


def _counted(trains: int) -> str:
    return f"{trains} train{'' if trains == 1 else 's'}"


def _summary(scene: Scene, cam: Lift, seed: int, used: UsedLimits, others: dict[str, np.ndarray]) -> Yield:
    holds, count = used.holds, len(used.used)
    drawn = [one.draws for one in trains_as_built(scene, count, seed=seed)]
    draws = {label: np.array([one[label] for one in drawn]) for label in drawn[0]}
    halved = {}
    for label, theirs in others.items():
        now = UsedLimits(used.limits, used.speeds_rpm, theirs).holds
        share = share_of(now)
        halved[label] = {"share": share.share, "low": share.low, "high": share.high}
        halved[label] |= {"gained": int((now & ~holds).sum()), "lost": int((holds & ~now).sum())}
    to_blame, shape = blame(draws, used.worst), tuple(broken_by_shape(cam, scene.design))
    return Yield(scene.name, cam.family, seed, used, share_of(holds), counted(used), to_blame, halved, shape)


def _halved(scene: Scene) -> dict[str, Scene]:
    """By tolerance the scene with half of it; the draws stay those of its label."""
    found = {}
    for i, tolerance in enumerate(scene.tolerance):
        widths = {key: getattr(tolerance, key) for key in ("relative", "plus_minus")}
        half = {key: width / 2 for key, width in widths.items() if width is not None}
        rows = list(scene.tolerance)
        rows[i] = tolerance.model_copy(update=half)
        found[tolerance.label] = scene.model_copy(update={"tolerance": tuple(rows)})
    if scene.grinding is not None:
        half = scene.grinding.model_copy(update={"error_um": scene.grinding.error_um / 2})
        found[GRINDING] = scene.model_copy(update={"grinding": half})
    return found


def _speeds(scene: Scene, speeds_rpm: Sequence[float] | None) -> list[float]:
    if speeds_rpm is not None:
        return sorted(map(float, speeds_rpm))
    assert scene.operation is not None, "load_scene(..., need='operation') guarantees it"
    return np.linspace(*scene.operation.band_rpm, SPEEDS).tolist()


def _digest(cam: Lift) -> str:
    """What tells one cam from another."""
    return sha256(cam.borders.tobytes() + cam.coefficients.tobytes() + repr(cam.half_duration).encode()).hexdigest()


def _scatter(scene: Scene) -> dict:
    return plain(scene.model_dump(mode="json", include=AS_BUILT))


def _write(folder: Path, scene: Scene, found: Yield) -> None:
    write_text(folder / "scene.toml", scene_toml(scene))
    save(found.plot(), folder / "figures", "used_limits")
    save(found.plot_blame(), folder / "figures", "blame")
    write_json(folder / SUMMARY, found.as_dict())
