"""The data of a task, its plain form, and its key."""

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping, Set
from dataclasses import dataclass
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

from pydantic import Field, TypeAdapter, ValidationError

from camopt.cam.design_file import design_record
from camopt.cam.families.registry import FAMILIES
from camopt.cam.lift import Lift
from camopt.cam.read import read_cam
from camopt.optimizer.program.chosen_duration import chosen_duration_deg, load_scene
from camopt.scene import InputError, Scene, builtin_scenes, parse_scene, scene_text
from camopt.scene.errors import did_you_mean
from camopt.scene.load import tuples
from camopt.scene.schema import SIMULATED
from camopt.scene.table import Positive, Table
from camopt.scene.text_file import excerpt, scene_toml
from camopt.storage import plain

LONGEST_INLINE = 200
"""Longest scene or cam [characters] that a task holds itself; a longer one is stored separately under its digest."""
PART = "sha256:"
Count = Annotated[int, Field(ge=0)]


class RehearseTask(Table, frozen=True):
    """A dummy task: it waits `seconds`, then returns a fraction derived from `number`, or ends as `end` requires."""

    verb: Literal["rehearse"]
    number: Count
    seconds: Annotated[float, Field(ge=0, le=3600)] = 0.0
    end: Literal["", "raise", "die"] = ""


class TaskOnScene(Table, frozen=True):
    """Fields of every task that simulates a scene's train with a cam; `vary` replaces values by NAME.KEY."""

    scene: str
    cam: str
    vary: Annotated[dict[str, float], Field(default_factory=dict)]


class SettledTask(TaskOnScene, frozen=True):
    """The metrics of the settled motion by event-exact at one crankshaft speed."""

    verb: Literal["settled"]
    speed_rpm: Positive


class SimulateSettings(Table, frozen=True):
    """Settings of a motion from rest, as in `camopt.simulate`."""

    method: str = "event"
    revolutions: Annotated[int, Field(ge=2, le=1000)] = 2
    step_deg: Positive = 0.1


class SimulateTask(TaskOnScene, SimulateSettings, frozen=True):
    """One motion from rest at one crankshaft speed."""

    verb: Literal["simulate"]
    speed_rpm: Positive


class YieldTask(TaskOnScene, frozen=True):
    """The limit usage of drawn train number `train` with this `seed`, within the scene's tolerances."""

    verb: Literal["yield"]
    speeds_rpm: Annotated[tuple[Positive, ...], Field(min_length=1, max_length=1000)]
    train: Count
    seed: Count = 0


class CallTask(Table, frozen=True):
    """A user's function, "package.module:name", called with `arguments` by name; it returns a dictionary."""

    verb: Literal["call"]
    function: Annotated[str, Field(pattern=r"^[A-Za-z_][\w.]*:[A-Za-z_]\w*$")]
    arguments: Annotated[dict[str, Any], Field(default_factory=dict)]


Task = RehearseTask | SettledTask | SimulateTask | YieldTask | CallTask
PlanVerb = Literal["settled", "simulate", "yield", "rehearse"]
"""Verbs allowed in a plan, which is a file of data; "call" runs any function and is left to programs."""
Verb = Literal[PlanVerb, "call"]
VERBS: tuple[str, ...] = get_args(Verb)
_TASKS: TypeAdapter[Task] = TypeAdapter(Annotated[Task, Field(discriminator="verb")])


@dataclass(frozen=True)
class StoredTask:
    """A task as it is stored and sent: its `key`, its canonical JSON, and by name the long texts that it refers to."""

    key: str
    text: str
    parts: dict[str, str]

    def task(self) -> Task:
        """The task with its long texts filled in."""
        data = json.loads(self.text)
        return _TASKS.validate_python(
            tuples({k: self.parts.get(v, v) if isinstance(v, str) else v for k, v in data.items()})
        )


def stored_task(task: Mapping[str, Any], version: str, where: str = "task") -> StoredTask:
    """Checks a task and returns its plain form; `where` begins error sentences.

    Its key is the SHA-256 of camopt's version and of its canonical JSON, in which a long scene or cam is replaced by
    its SHA-256: two tasks have the same key if they are the same computation. A cam given as a lift law or a file is
    stored as the text of its `design.json`. Raises InputError for an invalid task, and for an unreadable scene or cam.
    """
    raw = dict(task)
    try:
        if raw.get("verb") not in ("rehearse", "call") and "scene" in raw:
            raw["scene"] = scene_as_text(raw["scene"])
            if "cam" in raw:
                raw["cam"] = cam_as_text(raw["cam"], raw["scene"])
        checked = _TASKS.validate_python(tuples(raw))
    except ValidationError as error:
        raise InputError("; ".join(f"{where}: {sentence}" for sentence in task_faults(error))) from None
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    if isinstance(checked, CallTask):
        _check_call(checked, where)
    data, parts = checked.model_dump(exclude_defaults=True), {}
    for name in ("scene", "cam"):
        if len(text := data.get(name, "")) > LONGEST_INLINE:
            data[name] = PART + _digest(text)
            parts[data[name]] = text
    text = json.dumps(data, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return StoredTask(_digest(f"{version}\n{text}"), text, parts)


def function_at(place: str) -> Callable[..., dict]:
    """The function at "package.module:name"; raises ImportError or AttributeError where it does not exist."""
    module, _, name = place.partition(":")
    return getattr(import_module(module), name)


def _check_call(task: CallTask, where: str) -> None:
    """Raises InputError for a function that does not exist, and for arguments that are not plain data."""
    try:
        function_at(task.function)
        json.dumps(task.arguments, allow_nan=False)
    except (ImportError, AttributeError) as error:
        raise InputError(
            f"{where}: function {excerpt(task.function)}: cannot be imported ({error}); expected another"
        ) from None
    except (TypeError, ValueError) as error:
        raise InputError(f"{where}: arguments: expected numbers, texts, lists and dictionaries ({error})") from None


def task_faults(error: ValidationError, keys: Set[str] = frozenset()) -> Iterable[str]:
    """The faults of invalid data, one sentence each, beginning with the key; `keys` are suggested for unknown keys."""
    for fault in error.errors(include_url=False):
        key = ".".join(str(part) for part in fault["loc"] if part not in VERBS)
        if fault["type"] == "extra_forbidden":
            unknown = str(fault["loc"][-1])
            yield f"{key}: unknown key{did_you_mean(unknown, keys - {unknown})}"
        elif fault["type"] in ("union_tag_invalid", "union_tag_not_found"):
            yield f"verb: expected one of {', '.join(VERBS)}"
        else:
            shown = f" (given: {excerpt(repr(fault['input']))})" if fault["type"] != "missing" else ""
            yield f"{key}: {fault['msg'].replace('Input should be', 'must be')}{shown}"


def scene_as_text(scene: str | Path | Scene) -> str:
    """The name of a built-in scene, or the TOML text of any other; raises InputError where `scene` is neither."""
    if isinstance(scene, Scene):
        return scene_toml(scene)
    if not isinstance(scene, str | Path):
        raise InputError(f"scene: {type(scene).__name__} given, expected a name, a file, a TOML text or a Scene")
    return scene if isinstance(scene, str) and "\n" in scene else _named_scene(str(scene))


@lru_cache(maxsize=256)
def _named_scene(source: str) -> str:
    """Reads and checks a scene once, so that a file that changes during a sweep does not change any task."""
    load_scene(source, SIMULATED)
    return source if source in builtin_scenes() else scene_text(source)


def cam_as_text(cam: str | Path | Lift, scene: str) -> str:
    """The name of a family member as on the command line, or the text of the `design.json` of any other cam."""
    if isinstance(cam, Lift):
        return _record_text(cam)
    if not isinstance(cam, str | Path):
        raise InputError(f"cam: {type(cam).__name__} given, expected a family, a file, the text of a design or a Lift")
    if isinstance(cam, str) and (cam.startswith("{") or cam.partition(":")[0] in FAMILIES):
        return cam
    return _named_cam(str(cam), scene)


@lru_cache(maxsize=256)
def _named_cam(source: str, scene: str) -> str:
    return _record_text(read_cam(Path(source), scene_of_text(scene)))


@lru_cache(maxsize=256)
def _record_text(lift: Lift) -> str:
    return json.dumps(plain(design_record(lift, lift.max_lift)), allow_nan=False)


@lru_cache(maxsize=64)
def scene_of_text(text: str) -> Scene:
    """The scene with a built-in name or of a TOML text."""
    if "\n" in text:
        return parse_scene(text, "the task's scene", SIMULATED, chosen_duration_deg)
    return load_scene(text, SIMULATED)


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
