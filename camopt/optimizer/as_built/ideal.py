"""Beside a cam for trains as built the largest one for the train as designed: what precision would buy."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from camopt.cam.design_file import as_written, write_design
from camopt.cam.tables.lift_table import write_lift_table
from camopt.optimizer.accuracy import accuracy_named
from camopt.optimizer.as_built.statement import yield_statement
from camopt.optimizer.baselines.figures import IDEAL
from camopt.optimizer.search.search import find_cam
from camopt.scene.errors import NoCamFound
from camopt.scene.schema import Scene
from camopt.scene.units import MM

TRAINS, SPEEDS = 200, 11
"""Fresh trains that say in what share of them it holds, and their speeds over the band."""


def write_ideal(scene: Scene, settings: Mapping[str, Any], folder: Path) -> dict | None:
    """Writes `ideal/design.json` and `ideal/lift.csv` and says what they are: area ratio and share of trains with its
    interval. The search's own judge holds the cam, no verdict is asked. None where no cam holds.
    """
    assert scene.design is not None, "load_scene(..., need='design') guarantees it"
    try:
        search = find_cam(
            scene, settings["speeds"], accuracy_named(settings["accuracy"]), settings["gradient"], seed=settings["seed"]
        )
    except NoCamFound:
        return None
    cam = search.confirmed[-1]
    lift, place = as_written(cam.lift), folder / IDEAL
    place.mkdir(exist_ok=True)
    write_design(place / "design.json", cam.lift, scene.design.max_lift_mm * MM)
    write_lift_table(place / "lift.csv", lift)
    stated = yield_statement(scene, lift, None, trains=TRAINS, speeds=SPEEDS, seed=settings["seed"], sample=0)
    return {"area_ratio": cam.area_ratio, **vars(stated.share)}
