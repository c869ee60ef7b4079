"""`camopt yield`: the share of trains as built that hold the limits, what breaks first, the tolerances to blame."""

from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from tqdm import tqdm

from camopt.cam.lift import Lift
from camopt.measure.as_built import draws_of_trains
from camopt.measure.limits import broken_by_shape, motion_limits
from camopt.measure.yield_words import ADVISED, counted_trains, share_sentence, spoiling_sentences
from camopt.measure.yields import Share, UsedLimits, counted, rank_correlation_shares, share_of, yield_record
from camopt.optimizer.as_built.checks import check_scatter
from camopt.optimizer.as_built.measured import (
    Track,
    cam_digest,
    measure_trains,
    missing_trains,
    track,
    trains_journal,
)
from camopt.optimizer.as_built.prices import PriceList, price_list
from camopt.plots import save
from camopt.scene import InputError, Scene
from camopt.scene.as_built import scatter_labels, with_scatter
from camopt.scene.schema import AS_BUILT
from camopt.scene.text_file import scene_toml
from camopt.storage import plain, run_folder, run_identity, write_json, write_text
from camopt.storage.journal import Records

TRAINS, SPEEDS = 1000, 11
"""Default numbers of drawn trains and of speeds over the band at which they are judged."""
HIGHEST = 0.99
"""Largest share of the trains for which prices are stated."""
JOURNAL, SUMMARY = "trains.jsonl", "yield.json"


@dataclass(frozen=True, repr=False)
class Yield:
    """The yield of a cam: the limit usage `used` of every train (t, l, s), the share that holds, and the causes of the
    failures; `halved` holds, by tolerance, the share with this tolerance halved, where requested."""

    scene: str
    cam: str
    seed: int
    used: UsedLimits
    share: Share
    first_broken: dict[str, dict]
    blame: dict[str, float]
    halved: dict[str, dict]
    broken_by_shape: tuple[str, ...]
    prices: PriceList | None = None

    def as_dict(self) -> dict[str, Any]:
        """The content of `yield.json`."""
        return {
            "cam": self.cam,
            **yield_record(self.used, self.share, self.seed, self.blame),
            "halved": self.halved,
            "broken_by_shape": list(self.broken_by_shape),
            **({"prices": self.prices.as_dict()} if self.prices else {}),
        }

    @property
    def table(self) -> xr.DataArray:
        """The usage of each limit by each train at each speed, labelled."""
        coordinates = {"limit": list(self.used.limits), "speed_rpm": self.used.speeds_rpm}
        return xr.DataArray(self.used.used, coordinates, ("train", "limit", "speed_rpm"), name="used")

    def plot(self):
        """The usage of each limit by the trains against the speed, as a matplotlib Figure."""
        from camopt.plots.yields import used_against_speed

        by_limit = dict(zip(self.used.limits, np.moveaxis(self.used.used, 1, 0), strict=True))
        return used_against_speed(self.used.speeds_rpm, by_limit, f"{self.scene}, {self.cam}: {self.share}")

    def plot_blame(self):
        """The contribution of each tolerance, and the gain from halving it, as a matplotlib Figure."""
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
    price: bool = False,
    out: Path | str | None = None,
    resume: bool = False,
    progress: bool = False,
) -> Yield:
    """The share of drawn trains that hold every limit on the motion at every speed, and the causes of the failures.

    `speeds_rpm` (s) are crankshaft speeds, by default `SPEEDS` of them over the scene's band. Train i depends on `seed`
    and i alone. With `halve` the same trains are measured with every tolerance halved in turn; with `price` the area
    that each tolerance costs is stated at the share that holds, or at the advised share where fewer hold. With `out` a
    run folder is written, train by train; with `resume` it is continued, also with more trains. Raises InputError for a
    scene without limits on the motion or without any scatter, and for a folder as `run_folder` does.
    """
    check_scatter(scene)
    if not motion_limits(scene.design):
        raise InputError(
            f"yield: [design] of {scene.name} limits nothing of the motion, so every train would hold: give it "
            f"bounce_max_mm or another limit on the motion"
        )
    chosen = np.linspace(*scene.required_operation.band_rpm, SPEEDS).tolist() if speeds_rpm is None else speeds_rpm
    speeds = sorted(map(float, chosen))
    scatter = plain(scene.model_dump(mode="json", include=AS_BUILT))
    identity = run_identity("yield", scene, seed=seed, speeds_rpm=speeds, cam=cam_digest(cam), as_built=scatter)
    with run_folder(out, identity, resume, [JOURNAL]) if out is not None else nullcontext() as folder:
        journal, cam_track = trains_journal(folder and folder / JOURNAL), track(scene, cam, speeds)
        labels = scatter_labels(scene) if halve else ()  # halving changes no draw: draws depend on a tolerance's label
        scenes = {"": scene} | {label: with_scatter(scene, {label: 0.5}) for label in labels}
        by_halved = {name: _measured(s, cam_track, trains, journal, seed, name, progress) for name, s in scenes.items()}
        used = UsedLimits(tuple(cam_track.limits), np.array(speeds), by_halved.pop(""))
        result = _summary(scene, cam, seed, used, by_halved)
        if price:
            result = replace(result, prices=_prices(scene, cam, result.share, seed, progress))
        if folder is not None:
            write_text(folder / "scene.toml", scene_toml(scene))
            figures = {"used_limits": result.plot(), "blame": result.plot_blame()}
            figures |= {"prices": result.prices.plot()} if result.prices else {}
            for name, figure in figures.items():
                save(figure, folder / "figures", name)
            write_json(folder / SUMMARY, result.as_dict())
    return result


def _measured(
    scene: Scene, cam_track: Track, trains: int, journal: Records, seed: int, halved: str, progress: bool
) -> np.ndarray:
    """The limit usage (t, l, s) of this many trains, with a progress bar."""
    stored = trains - len(missing_trains(journal, cam_digest(cam_track.lift), halved, trains))
    name = f"{halved} halved" if halved else "trains"
    with tqdm(total=trains, initial=stored, disable=None if progress else True, desc=name) as bar:
        return measure_trains(scene, cam_track, trains, journal, seed=seed, halved=halved, advance=bar.update)


def _prices(scene: Scene, cam: Lift, share: Share, seed: int, progress: bool) -> PriceList:
    """The price list at the share that holds and the cam's own area, or at the advised share where fewer hold."""
    wanted = min(max(share.share, ADVISED), HIGHEST)
    area = cam.area_ratio_in(scene.required_design) if share.share >= ADVISED else None
    with tqdm(total=100, disable=None if progress else True, desc="prices", unit="%") as bar:
        return price_list(
            scene, wanted, area_ratio=area, seed=seed, advance=lambda done: bar.update(round(100 * done) - bar.n)
        )


def yield_lines(result: Yield) -> list[str]:
    """The yield in sentences."""
    record = result.as_dict()
    lines = [f"{result.scene}, {result.cam}: {share_sentence(record)}", *spoiling_sentences(record)]
    for label, entry in sorted(result.halved.items(), key=lambda item: -item[1]["share"]):
        gained = f"{counted_trains(entry['gained'])} gained and {entry['lost']} lost"
        lines.append(f"{label} halved: {100 * entry['share']:.1f} %, {gained}")
    lines += str(result.prices).splitlines() if result.prices else []
    if result.broken_by_shape:
        lines.append(f"note: the cam's shape, as designed, breaks {', '.join(result.broken_by_shape)}")
    return lines


def _summary(scene: Scene, cam: Lift, seed: int, used: UsedLimits, by_halved: dict[str, np.ndarray]) -> Yield:
    holds, count = used.holds, len(used.used)
    draws = draws_of_trains(scene, count, seed=seed)
    halved = {}
    for label, used_halved in by_halved.items():
        holds_halved = UsedLimits(used.limits, used.speeds_rpm, used_halved).holds
        share = share_of(holds_halved)
        halved[label] = {"share": share.share, "low": share.low, "high": share.high}
        halved[label] |= {"gained": int((holds_halved & ~holds).sum()), "lost": int((holds & ~holds_halved).sum())}
    blame, shape = rank_correlation_shares(draws, used.worst), tuple(broken_by_shape(cam, scene.design))
    return Yield(scene.name, cam.family, seed, used, share_of(holds), counted(used), blame, halved, shape)
