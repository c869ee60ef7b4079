"""What an ascent was: every iterate as a labelled dataset, the best cam, and a figure."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from camopt.cam.design_file import write_design
from camopt.cam.lift import Lift
from camopt.plots import save
from camopt.plots.ascent import course
from camopt.scene.quantities import QUANTITIES
from camopt.scene.schema import Scene
from camopt.scene.toml_text import scene_toml
from camopt.scene.units import MM
from camopt.storage import write_csv, write_text


@dataclass(frozen=True)
class Iterate:
    """One point of an ascent: the objective's value and terms, the length of its gradient along the limits, the largest
    share of a limit on the motion by event-exact (NaN where it was not judged), and the variables."""

    value: float
    terms: Mapping[str, float]
    gradient_norm: float
    share: float
    cam: np.ndarray  # (m)
    train: np.ndarray  # (k)

    @property
    def judged(self) -> bool:
        """Whether event-exact was asked."""
        return not np.isnan(self.share)

    @property
    def holds(self) -> bool:
        """Whether every limit is held by event-exact; False where it was not asked."""
        return self.share <= 1.0

    def as_dict(self) -> dict[str, Any]:
        """Numbers and lists."""
        return asdict(self) | {"cam": self.cam.tolist(), "train": self.train.tolist()}

    @classmethod
    def of(cls, stored: Mapping[str, Any]) -> "Iterate":
        """The iterate of `as_dict`."""
        arrays = {name: np.array(stored[name], dtype=float) for name in ("cam", "train")}
        return cls(**{**stored, **arrays})

    def __str__(self) -> str:
        judged = f", largest used share of a limit {self.share:.3g}" if self.judged else ""
        return f"objective {self.value:.4f}{judged}"


@dataclass(frozen=True, repr=False)
class AscentHistory:
    """The iterates of an ascent, and the best of them.

    `dataset` has by `step`: `objective`, its terms (the area ratio and the metrics' means), `gradient_norm`, `judged`,
    `holds`, `largest_share`, and the variables `cam` and, where numbers of the train vary, `train`. `best` is the cam
    of the largest objective among those that hold every limit by event-exact at the objective's speeds; where none
    does, that which uses the least share of its limits. `best_scene` is the scene with its factors.
    """

    dataset: xr.Dataset
    best: Lift
    best_scene: Scene

    def __getitem__(self, name: str) -> xr.DataArray:
        return self.dataset[name]

    @property
    def confirmed(self) -> bool:
        """Whether `best` holds every limit by event-exact at the objective's speeds."""
        return bool(self["holds"][self.dataset.attrs["best"]])

    def plot(self) -> Figure:
        """Objective, area ratio and the judged share of the limits over the steps, as a matplotlib Figure."""
        data, title = self.dataset, f"{self.dataset.attrs['scene']}, {self.dataset.attrs['path']} path"
        names = ("objective", "area_ratio", "largest_share", "holds")
        return course(*(data[name].values for name in names), best=data.attrs["best"], title=title)

    def lines(self) -> list[str]:
        """What came out, in sentences."""
        one, about = self.dataset.isel(step=self.dataset.attrs["best"]), self.dataset.attrs
        said = "holds every limit" if self.confirmed else "is the nearest to hold every limit, and does not"
        return [
            f"{about['scene']}, {about['path']} path, {self.dataset.sizes['step'] - 1} steps: area ratio "
            f"{float(self['area_ratio'][0]):.4f} at the start; step {about['best']}, {float(one['area_ratio']):.4f}, "
            f"{said} (event-exact; largest used share {float(one['largest_share']):.3g})"
        ]

    def write(self, folder: Path) -> None:
        """Writes `design.json` of the best cam, `scene.toml`, `history.csv` and the figure into a folder."""
        assert self.best_scene.design is not None, "objective() asks for [design]"
        write_design(folder / "design.json", self.best, self.best_scene.design.max_lift_mm * MM)
        write_text(folder / "scene.toml", scene_toml(self.best_scene))
        flat = [str(name) for name, values in self.dataset.data_vars.items() if values.dims == ("step",)]
        write_csv(folder / "history.csv", {"step": self["step"].values, **{name: self[name].values for name in flat}})
        save(self.plot(), folder / "figures", "ascent")

    def __repr__(self) -> str:
        return f"AscentHistory({'; '.join(self.lines())})"

    def _repr_html_(self) -> str:
        return "<br>".join(self.lines()) + self.dataset._repr_html_()


def best_of(iterates: Sequence[Iterate]) -> int:
    """The number of the best judged iterate: see `AscentHistory`."""
    judged = [i for i, one in enumerate(iterates) if one.judged]
    holding = [i for i in judged if iterates[i].holds]
    if holding:
        return max(holding, key=lambda i: iterates[i].value)
    return min(judged, key=lambda i: iterates[i].share)


def dataset_of(iterates: Sequence[Iterate], train: Sequence[str]) -> xr.Dataset:
    """The iterates by step, with units."""
    columns: dict[str, Any] = {"objective": [one.value for one in iterates]}
    columns |= {name: [one.terms[name] for one in iterates] for name in iterates[0].terms}
    columns |= {"gradient_norm": [one.gradient_norm for one in iterates], "judged": [one.judged for one in iterates]}
    columns |= {"holds": [one.holds for one in iterates], "largest_share": [one.share for one in iterates]}
    data = xr.Dataset({name: ("step", values) for name, values in columns.items()}, {"step": np.arange(len(iterates))})
    for name in iterates[0].terms:
        if name in QUANTITIES:
            data[name].attrs |= {"units": QUANTITIES[name].unit, "long_name": f"mean {QUANTITIES[name].label}"}
    data["cam"] = ("step", "coefficient"), np.array([one.cam for one in iterates])
    if train:
        data["train"] = xr.DataArray([one.train for one in iterates], {"factor": list(train)}, ("step", "factor"))
    return data
