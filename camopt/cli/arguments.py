"""Helpers that turn a verb's arguments into the scene, the cam and the output folder, and print results."""

import sys
from argparse import Namespace
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from camopt.optimizer.program.chosen_duration import load_scene
from camopt.scene import InputError, Scene
from camopt.scene.notes import scene_notes, speed_notes
from camopt.scene.schema import SIMULATED, Part
from camopt.scene.text_file import excerpt
from camopt.storage import check_run_folder, default_run_folder, write_json

if TYPE_CHECKING:
    from camopt.cam.lift import Lift


def scene_of(args: Namespace, need: tuple[Part, ...] = SIMULATED) -> Scene:
    """Reads the scene of a command and prints notes on unusual values in it and on unusual speeds."""
    scene = load_scene(args.scene, need)
    notes = [f"{args.scene}: {note}" for note in scene_notes(scene)]
    if (speed := getattr(args, "speed", None)) is not None:
        notes += speed_notes("--speed", [speed])
    if isinstance(speeds := getattr(args, "speeds", None), tuple):
        notes += speed_notes("--speeds", speeds)
    for note in notes:
        print(f"camopt: note: {note}", file=sys.stderr)
    return scene


def cam_of(args: Namespace, scene: Scene, cam: str | Path | None = None) -> "Lift":
    """Reads the cam of a command, or another cam under the same table options."""
    from camopt.cam.read import read_cam

    text = {"table_first_line": args.table_first_line, "table_columns": args.table_columns}
    layout = args.table_angle, args.table_lift, args.table_ratio, args.table_probe_mm
    return read_cam(args.cam if cam is None else cam, scene, *layout, **text)


def run_named(args: Namespace) -> Path | None:
    """The run folder given in the scene's place, if there is one and its cam is used. Its cam is the command's cam
    where no other is named. Raises InputError where no cam is named at all."""
    run = Path(args.scene) if (Path(args.scene) / "scene.toml").is_file() else None
    args.cam = args.cam or (run and args.scene)
    if args.cam is None:
        words = "no cam: add --cam CAM, or give a run folder in the scene's place"
        raise InputError(f"{args.command} {excerpt(args.scene)}: {words}")
    return run if args.cam == args.scene else None


def folder_of(args: Namespace, name: str) -> Path:
    """The output folder of a command, checked to be free or resumable; it is also stored as `args.folder`."""
    resume = getattr(args, "resume", False)
    if resume and args.out is None:
        raise InputError(f"{args.command}: --resume needs the folder to go on in: add --out DIR")
    folder = Path(args.out) if args.out else default_run_folder(name)
    check_run_folder(folder, resume)
    args.folder = folder
    return folder


def unique_values(pairs: Sequence[tuple[str, Any]], sentence: str) -> dict[str, Any]:
    """Values by name; raises InputError with `sentence`, which contains `{name}`, for a name that occurs twice."""
    values = dict(pairs)
    if len(values) < len(pairs):
        twice = next(name for i, (name, _) in enumerate(pairs) if name in dict(pairs[:i]))
        raise InputError(sentence.format(name=excerpt(twice)))
    return values


def say_compilation(args: Namespace) -> None:
    """Prints that programs are being compiled, before a command is silent for minutes."""
    from camopt.optimizer.first_run import SAYING, programs_missing

    if not args.quiet and programs_missing():
        print(SAYING, file=sys.stderr, flush=True)


def print_area_words(lift: "Lift", scene: Scene, whose: str = "") -> None:
    """Prints the remarks on a cam's duration and area ratio, one line each."""
    from camopt.optimizer.bound.certificate import area_words

    for sentence in area_words(lift, scene.required_design):
        print(f"note: {whose}{sentence}")


def write_result(args: Namespace, content: Mapping[str, Any], lines: Iterable[object]) -> int:
    """Writes a result to the JSON file, if one was named, and prints its lines; returns the exit code 0."""
    if args.json:
        write_json(args.json, content)
    print("\n".join(map(str, lines)))
    return 0
