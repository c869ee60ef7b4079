"""The cost of a limit: the largest confirmed area over a range of one limit; joint design of cam and valve spring."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr
from tqdm import tqdm

from camopt.optimizer.accuracy import Accuracy, accuracy_named
from camopt.optimizer.as_built.checks import check_wanted
from camopt.optimizer.free_numbers import Programs
from camopt.optimizer.search.search import find_cam
from camopt.scene import InputError, Scene
from camopt.scene.parameters import with_spring
from camopt.scene.schema import AS_BUILT
from camopt.storage import check_file
from camopt.storage.journal import Records

VALUES = {
    "bounce_max_mm": (0.005, 0.02, 0.05, 0.1, 0.2),
    "jump_max_mm": (0.0, 0.02, 0.05, 0.1, 0.2),
    "jerk_max_mm_per_deg3": (0.0015, 0.002, 0.003, 0.005, 0.01),
    "snap_max_mm_per_deg4": (0.0005, 0.001, 0.002, 0.004),
    "yield": (0.99, 0.95, 0.9, 0.8, 0.5),
}
"""Default values by limit."""


@dataclass(frozen=True)
class Front:
    """Area against a limit: `table` has coordinate `limit` (k), area_ratio and worst metrics; NaN without a cam."""

    scene: str
    against: str
    table: xr.Dataset

    def plot(self):
        """The front as a matplotlib Figure."""
        from camopt.plots.studies import front

        return front(self.against, self.table["limit"].values, self.table["area_ratio"].values, self.scene)

    def _repr_html_(self) -> str:
        return self.table.to_dataframe().to_html(float_format="%.5g")


def pareto(
    scene: Scene,
    against: str = "bounce_max_mm",
    values: Sequence[float] | None = None,
    *,
    release: Sequence[str] = (),
    speeds: str = "band",
    accuracy: str = "draft",
    gradient: str = "none",
    seed: int = 0,
    out: Path | str | None = None,
    progress: bool = False,
) -> Front:
    """Largest area ratio that the event-exact judge confirms, for each value of the design's limit `against`.

    With `against` "yield" the values are shares of the trains as built in which the cam must hold, over the band;
    `seed` then draws the trains of the search. `values` (k) in the limit's own units (default: `VALUES`) are tried from
    tight to loose: a cam found under a tighter limit also counts for a looser one. `release` names limits to leave out,
    because a tight jump limit hides the cost of bounce. With `out` each point is stored as it is found, and a second
    call continues from there. A value without a confirmed cam is NaN. Raises InputError for an unknown limit or
    accuracy, or an unusable `out`.
    """
    design, is_yield = scene.design, against == "yield"
    is_limit = is_yield or (design is not None and against in type(design).model_fields)
    if design is None or not is_limit or not (values or against in VALUES):
        raise InputError(f"pareto: {against!r}: expected a limit of [design] such as {', '.join(VALUES)}, with values")
    left_out = None if is_yield else AS_BUILT
    plain = scene.model_dump(mode="json", exclude_none=True, exclude_defaults=True, exclude=left_out)
    identity = {"against": against, "release": sorted(release), "speeds": speeds, "accuracy": accuracy}
    identity |= {"gradient": gradient, "scene": plain} | ({"seed": seed} if is_yield else {})
    if out is not None:
        check_file(out)
    points = Records(out, "limit", identity=identity)
    rows, effort, best = [], accuracy_named(accuracy), {"area_ratio": None}
    nested = is_yield or "_max" in against or "_min" in against
    tight_first = sorted(values or VALUES[against], key=lambda value: -value if is_yield else abs(value))
    for value in tqdm(tight_first, disable=None if progress else True, desc=against):
        if (point := points.get(float(value))) is None:
            limits = dict.fromkeys(release) | ({} if is_yield else {against: value})
            changed = scene.model_copy(update={"design": design.model_copy(update=limits)})
            if is_yield:
                check_wanted(changed, value, "band")
            try:
                if is_yield:
                    outcome = _yield_point(changed, value, effort, gradient, seed)
                else:
                    outcome = _point(changed, speeds, effort, gradient)
            except InputError:
                outcome = {"area_ratio": None}
            point = {"limit": float(value)} | outcome
            points.add(point)
        if not nested or (point["area_ratio"] or 0.0) > (best["area_ratio"] or 0.0):
            best = point
        rows.append(best | {"limit": float(value)})
    names = dict.fromkeys(name for row in rows for name in row if name != "limit")
    columns = {n: ("limit", [np.nan if r.get(n) is None else r[n] for r in rows]) for n in names}
    return Front(scene.name, against, xr.Dataset(columns, {"limit": [r["limit"] for r in rows]}))


def _yield_point(scene: Scene, wanted: float, effort: Accuracy, gradient: str, seed: int) -> dict:
    """The largest area ratio of a cam that holds in this share of the drawn trains; raises InputError without a cam."""
    from camopt.optimizer.as_built.search import yield_search

    search = yield_search(scene, wanted, effort, gradient=gradient, seed=seed)
    return {"area_ratio": search.held[-1].area_ratio, "trains": search.trains_drawn, "cams": search.steps}


def _point(scene: Scene, speeds: str, effort: Accuracy, gradient: str) -> dict:
    """The largest area ratio within the limits, with its worst metrics; raises InputError without a cam."""
    search = find_cam(scene, speeds, effort, gradient)
    best, first = search.confirmed[-1], search.first
    assert first is not None, "a search with a cam has ended its first stage"
    worst = {f"worst_{name}": best.judged.worst(name) for name in ("bounce_mm", *best.judged.limited)}
    return {"area_ratio": best.area_ratio, "area_ratio_no_jump": first.area_ratio, **worst}


@dataclass(frozen=True)
class SpringDesign:
    """Spring and cam designed together: factors on rate and preload, the program's area ratios with and without."""

    rate: float
    preload: float
    area_ratio: float
    area_ratio_as_given: float
    scene: Scene
    evaluations: int


def joint_spring(
    scene: Scene,
    rate: tuple[float, float] = (0.9, 1.1),
    preload: tuple[float, float] = (0.9, 1.1),
    *,
    speeds: str = "band",
    accuracy: str = "draft",
    margin_N: float = 0.0,
    evaluations: int = 30,
) -> SpringDesign:
    """The factors on the valve spring's rate and preload, within the given ranges, that maximise the program's area
    (`camopt.optimizer.free_numbers`); `optimize` confirms the cam of the resulting scene."""
    effort = accuracy_named(accuracy)
    programs = Programs(lambda factors: with_spring(scene, *map(float, factors)), speeds, effort, margin_N)
    best = programs.largest((1.0, 1.0), (rate, preload), evaluations)
    rate_factor, preload_factor = best.values
    scene = with_spring(scene, rate_factor, preload_factor)
    return SpringDesign(rate_factor, preload_factor, best.area_ratio, best.at_start, scene, best.evaluations)
