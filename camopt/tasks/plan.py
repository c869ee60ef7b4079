"""Plans: a TOML file that lists the tasks of a sweep (docs/sweeps.md shows one), and an iterator over these tasks."""

import hashlib
import json
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from math import prod
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError, field_validator

from camopt.cam.families.registry import FAMILIES
from camopt.scene import InputError, builtin_scenes
from camopt.scene.load import scene_with, tuples
from camopt.scene.schema import SIMULATED
from camopt.scene.table import Positive, Table
from camopt.scene.text_file import read_text, toml_data, usable_path
from camopt.tasks.task import (
    Count,
    PlanVerb,
    SimulateSettings,
    cam_as_text,
    scene_as_text,
    scene_of_text,
    task_faults,
)

MOST_BYTES = 1_000_000
NonEmpty = Field(min_length=1, max_length=100_000)


class YieldSettings(Table, frozen=True):
    """Number of drawn trains and the seed that draws them."""

    trains: Annotated[int, Field(ge=1, le=10_000_000)] = 1000
    seed: Count = 0


class RehearseSettings(Table, frozen=True):
    """Number of dummy tasks and the time [s] that each of them waits."""

    tasks: Annotated[int, Field(ge=1, le=10_000_000)] = 200
    seconds: Annotated[float, Field(ge=0, le=3600)] = 0.0


SETTINGS = {"settled": Table, "simulate": SimulateSettings, "yield": YieldSettings, "rehearse": RehearseSettings}


class PlanFile(Table, frozen=True):
    """The contents of a plan file."""

    format: Literal[1]
    verb: PlanVerb
    scenes: Annotated[tuple[str, ...], NonEmpty] | None = Field(default=None, validate_default=True)
    cams: Annotated[tuple[str, ...], NonEmpty] | None = Field(default=None, validate_default=True)
    speeds_rpm: Annotated[tuple[Positive, ...], NonEmpty] | None = None
    combine: Literal["grid", "list"] = "grid"
    vary: Annotated[dict[str, Annotated[tuple[float, ...], NonEmpty]], Field(default_factory=dict)]
    settings: Annotated[dict[str, Any], Field(default_factory=dict)]

    @field_validator("scenes", "cams")
    @classmethod
    def _missing_only_in_rehearsals(cls, names, info):
        rehearsal = info.data.get("verb") == "rehearse"
        if (names is None) != rehearsal:
            raise ValueError('verb "rehearse" has none: leave it out' if rehearsal else "missing")
        return names

    @field_validator("vary")
    @classmethod
    def _equal_lengths_in_a_list(cls, vary, info):
        lengths = {name: len(values) for name, values in vary.items()}
        if info.data.get("combine") == "list" and len({*lengths.values()}) > 1:
            listed = ", ".join(f"{name} {length}" for name, length in lengths.items())
            raise ValueError(f'combine = "list" needs as many values of each, and these are {listed}')
        return vary


@dataclass(frozen=True, repr=False)
class SweepPlan:
    """The tasks of a plan as an iterable with a length and a `digest`, which is equal for equal plans."""

    file: PlanFile
    settings: Table
    scenes: tuple[str, ...]  # names or TOML texts, as in tasks
    cams: tuple[tuple[str, ...], ...]  # by scene
    speeds_rpm: tuple[tuple[float, ...], ...]  # by scene

    @property
    def digest(self) -> str:
        """SHA-256 of everything that determines the tasks, including the contents of scenes and cams."""
        content = [self.file.verb, self.settings.model_dump(), self.scenes, self.cams, self.speeds_rpm]
        content += [self.file.combine, self.file.vary]
        return hashlib.sha256(json.dumps(content).encode()).hexdigest()

    def __len__(self) -> int:
        if isinstance(self.settings, RehearseSettings):
            return self.settings.tasks
        trains = self.settings.trains if isinstance(self.settings, YieldSettings) else None
        lengths = [len(values) for values in self.file.vary.values()]
        combinations = prod(lengths) if self.file.combine == "grid" else max(lengths, default=1)
        pairs = zip(self.cams, self.speeds_rpm, strict=True)
        return combinations * sum(len(cams) * (trains or len(speeds)) for cams, speeds in pairs)

    def _combinations(self) -> Iterator[dict[str, float]]:
        """The varied values of the scene, one dictionary per combination."""
        vary, together = self.file.vary, product if self.file.combine == "grid" or not self.file.vary else zip
        return (dict(zip(vary, values, strict=True)) for values in together(*vary.values()))

    def __iter__(self) -> Iterator[dict[str, Any]]:
        settings = self.settings
        if isinstance(settings, RehearseSettings):
            for number in range(settings.tasks):
                yield {"verb": "rehearse", "number": number, "seconds": settings.seconds}
            return
        for scene, cams, speeds in zip(self.scenes, self.cams, self.speeds_rpm, strict=True):
            for numbers, cam in product(self._combinations(), cams):
                task = {"verb": self.file.verb, "scene": scene, "cam": cam, "vary": numbers}
                if isinstance(settings, YieldSettings):
                    drawn = task | {"speeds_rpm": speeds, "seed": settings.seed}
                    yield from (drawn | {"train": i} for i in range(settings.trains))
                else:
                    yield from (task | {"speed_rpm": speed} | settings.model_dump() for speed in speeds)

    def __repr__(self) -> str:
        return f"SweepPlan({len(self)} tasks of the verb {self.file.verb})"


def load_plan(path: str | Path) -> SweepPlan:
    """Reads a plan from a TOML file. Raises InputError with a line per fault, also of its scenes and cams."""
    path = usable_path(path, "plan")
    if not path.is_file():
        raise InputError(f"{path}: no such file: name a TOML file, as `camopt sweep --help` shows")
    data = toml_data(read_text(path, MOST_BYTES, "plan"), str(path))
    if isinstance(vary := data.get("vary"), dict):  # an unquoted `spring.preload_N` is read as nested tables
        tables = {name: value if isinstance(value, dict) else {"": value} for name, value in vary.items()}
        numbers = ((name, key, values) for name, keys in tables.items() for key, values in keys.items())
        data["vary"] = {f"{name}.{key}" if key else name: values for name, key, values in numbers}
    try:
        file = PlanFile.model_validate(tuples(data))
        settings = SETTINGS[file.verb].model_validate(file.settings)
    except ValidationError as error:
        keys = {*PlanFile.model_fields, *(key for table in SETTINGS.values() for key in table.model_fields)}
        raise InputError("\n".join(f"{path}: {fault}" for fault in task_faults(error, keys))) from None
    try:
        return _resolved(file, settings, path.parent)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _resolved(file: PlanFile, settings: Table, folder: Path) -> SweepPlan:
    """The plan with its scenes and cams read; its first combination of values is checked on every scene."""
    if file.scenes is None or file.cams is None:
        return SweepPlan(file, settings, (), (), ())
    scenes = tuple(scene_as_text(_beside(name, folder, builtin_scenes())) for name in file.scenes)
    cams = tuple(tuple(cam_as_text(_beside(cam, folder, FAMILIES), scene) for cam in file.cams) for scene in scenes)
    operations = [scene_of_text(scene).operation for scene in scenes]
    speeds = tuple(file.speeds_rpm or operation.speeds_rpm for operation in operations if operation is not None)
    plan = SweepPlan(file, settings, scenes, cams, speeds)
    for scene in scenes:
        scene_with(scene_of_text(scene), next(plan._combinations()), "vary", SIMULATED)
    return plan


def _beside(name: str, folder: Path, names) -> str | Path:
    """The path of a file relative to the plan; a name of a built-in scene or a family is returned as it is."""
    return name if name.partition(":")[0] in names else folder / name
