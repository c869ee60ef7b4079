"""The outcome of an ascent: every iterate as a labelled dataset, the best and the nearest cam, and a figure."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from camopt.cam.design_file import write_design
from camopt.cam.lift import Lift
from camopt.plots import save
from camopt.plots.search import course
from camopt.scene.quantities import QUANTITIES
from camopt.scene.schema import Scene
from camopt.scene.text_file import scene_toml
from camopt.scene.units import MM
from camopt.storage import write_csv, write_text

NEAREST = "nearest.json"
"""File of the nearest cam, written if no cam holds every limit."""


@dataclass(frozen=True)
class Iterate:
    """One point of an ascent: the objective's value and terms, the norm of its gradient along the limits, the largest
    used share of a limit of the event-exact motion (NaN if the point was not judged), and the variables."""

    value: float
    terms: Mapping[str, float]
    gradient_norm: float
    share: float
    cam: np.ndarray  # (m)
    train: np.ndarray  # (k)

    @property
    def judged(self) -> bool:
        """Whether the motion was simulated by event-exact."""
        return not np.isnan(self.share)

    @property
    def holds(self) -> bool:
        """Whether the event-exact motion holds every limit; False if the point was not judged."""
        return self.share <= 1.0

    def __str__(self) -> str:
        judged = f", largest used share of a limit {self.share:.3g}" if self.judged else ""
        return f"objective {self.value:.4f}{judged}"


@dataclass(frozen=True, repr=False)
class AscentHistory:
    """The iterates of an ascent, and the best of them.

    `dataset` has by `step`: `objective`, its terms (the area ratio, the metrics' means, and for each constraint the
    worst value of its path), `gradient_norm`, `judged`, `holds`, `largest_share`, and the variables `cam` and, where
    numbers of the train vary, `train`. `best` is the cam of the largest objective among those whose event-exact motion
    holds every limit at the objective's speeds, None if there is none; `nearest` is the judged cam whose largest used
    share of a limit is smallest. `best_scene` and `nearest_scene` are the scenes with the factors of these cams, and
    the dataset's attributes `best` and `nearest` are their steps.
    """

    dataset: xr.Dataset
    nearest: Lift
    nearest_scene: Scene
    best: Lift | None
    best_scene: Scene | None

    def __getitem__(self, name: str) -> xr.DataArray:
        return self.dataset[name]

    @property
    def confirmed(self) -> bool:
        """Whether the event-exact motion of a cam holds every limit at the objective's speeds."""
        return self.best is not None

    def plot(self) -> Figure:
        """Objective, area ratio and the judged share of the limits over the steps, as a matplotlib Figure."""
        data, title = self.dataset, f"{self.dataset.attrs['scene']}, {self.dataset.attrs['path']} path"
        names = ("objective", "area_ratio", "largest_share", "holds")
        return course(*(data[name].values for name in names), best=data.attrs.get("best"), title=title)

    def lines(self) -> list[str]:
        """The outcome in sentences."""
        about, judged = self.dataset.attrs, int(self["judged"].sum())
        step = about.get("best", about["nearest"])
        iterate = self.dataset.isel(step=step)
        cam = f"step {step}, {float(iterate['area_ratio']):.4f}"
        none = f"none of the {judged} judged cams holds all limits; the nearest is that of {cam}"
        outcome = f"{cam}, holds every limit" if self.confirmed else none
        return [
            f"{about['scene']}, {about['path']} path, {self.dataset.sizes['step'] - 1} steps: area ratio "
            f"{float(self['area_ratio'][0]):.4f} at the start; {outcome} (event-exact; largest used share "
            f"{float(iterate['largest_share']):.3g})"
        ]

    def write(self, folder: Path) -> None:
        """Writes `design.json` of the best cam or, if none holds every limit, `nearest.json` of the nearest one, with
        its `scene.toml`, `history.csv` and the figure, into a folder."""
        cam, scene = self.best or self.nearest, self.best_scene or self.nearest_scene
        (folder / NEAREST).unlink(missing_ok=True)  # left by the ascent that this one continues
        path = folder / ("design.json" if self.confirmed else NEAREST)
        write_design(path, cam, scene.required_design.max_lift_mm * MM)
        write_text(folder / "scene.toml", scene_toml(scene))
        flat = [str(name) for name, values in self.dataset.data_vars.items() if values.dims == ("step",)]
        write_csv(folder / "history.csv", {"step": self["step"].values, **{name: self[name].values for name in flat}})
        save(self.plot(), folder / "figures", "ascent")

    def __repr__(self) -> str:
        return f"AscentHistory({'; '.join(self.lines())})"

    def _repr_html_(self) -> str:
        return "<br>".join(self.lines()) + self.dataset._repr_html_()


def notable(iterates: Sequence[Iterate]) -> dict[str, int]:
    """The indices of the iterates "nearest" and, if one holds every limit, "best"; see `AscentHistory`."""
    judged = [i for i, iterate in enumerate(iterates) if iterate.judged]
    nearest = {"nearest": min(judged, key=lambda i: iterates[i].share)}
    holding = [i for i in judged if iterates[i].holds]
    return nearest | ({"best": max(holding, key=lambda i: iterates[i].value)} if holding else {})


def dataset_of(iterates: Sequence[Iterate], train: Sequence[str]) -> xr.Dataset:
    """The dataset of the iterates by step, with units."""
    columns: dict[str, Any] = {"objective": [i.value for i in iterates]}
    columns |= {name: [i.terms[name] for i in iterates] for name in iterates[0].terms}
    columns |= {"gradient_norm": [i.gradient_norm for i in iterates], "judged": [i.judged for i in iterates]}
    columns |= {"holds": [i.holds for i in iterates], "largest_share": [i.share for i in iterates]}
    data = xr.Dataset({name: ("step", values) for name, values in columns.items()}, {"step": np.arange(len(iterates))})
    for name in iterates[0].terms:
        if name in QUANTITIES:
            data[name].attrs |= {"units": QUANTITIES[name].unit, "long_name": f"mean {QUANTITIES[name].label}"}
    data["cam"] = ("step", "coefficient"), np.array([i.cam for i in iterates])
    if train:
        data["train"] = xr.DataArray([i.train for i in iterates], {"factor": list(train)}, ("step", "factor"))
    return data
