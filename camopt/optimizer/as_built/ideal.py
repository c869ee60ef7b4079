"""What stands beside a statement: the largest cam for the train as designed, or an estimate for trains as built."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from camopt.cam.design_file import as_written, write_design
from camopt.cam.lift import Lift
from camopt.cam.tables.lift_table import write_lift_table
from camopt.measure.yield_words import ADVISED
from camopt.optimizer.accuracy import accuracy_named
from camopt.optimizer.as_built.prices import estimated_area_ratio
from camopt.optimizer.as_built.statement import YieldStatement, yield_statement
from camopt.optimizer.baselines.figures import IDEAL
from camopt.optimizer.search.search import find_cam
from camopt.scene.errors import NoCamFound
from camopt.scene.schema import Scene
from camopt.scene.units import MM

TRAINS, SPEEDS = 200, 11
"""Fresh trains that say in what share of them it holds, and their speeds over the band."""


def beside(
    scene: Scene,
    lift: Lift,
    settings: Mapping[str, Any],
    stated: YieldStatement | None,
    folder: Path,
    start: Lift | None = None,
) -> dict[str, Any]:
    """Entries of verification.json's "yield" by the `settings` of a run: for a yield that was asked for the cam for the
    train as designed, which is written into the folder; else, where fewer trains hold than are advised, an estimate of
    the cam for so many, which is no larger than the run's. A search begins from the cam `start`, as the run's does."""
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
    """Writes `ideal/design.json` and `ideal/lift.csv` and says what they are: area ratio and share of trains with its
    interval. The search's own judge holds the cam, no verdict is asked. None where no cam holds.
    """
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
    stated = yield_statement(scene, lift, None, trains=TRAINS, speeds=SPEEDS, seed=settings["seed"], sample=0)
    return {"area_ratio": cam.area_ratio, **vars(stated.share)}
