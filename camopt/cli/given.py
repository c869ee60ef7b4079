"""What a command is given: its scene with the notes on it, and its cam."""

import sys
from argparse import Namespace
from typing import TYPE_CHECKING

from camopt.scene import Scene, load_scene
from camopt.scene.notes import scene_notes, speed_notes

if TYPE_CHECKING:
    from pathlib import Path

    from camopt.cam.lift import Lift

SIMULATED = ("valve", "seat", "operation", "design")
"""What a scene needs for a simulation."""


def scene_of(args: Namespace, need: tuple[str, ...] = SIMULATED) -> Scene:
    """The scene that a command names; what is unusual about it or about the speeds asked is noted."""
    scene = load_scene(args.scene, need)
    notes = [f"{args.scene}: {note}" for note in scene_notes(scene)]
    if (speed := getattr(args, "speed", None)) is not None:
        notes += speed_notes("--speed", [speed])
    if isinstance(speeds := getattr(args, "speeds", None), tuple):
        notes += speed_notes("--speeds", speeds)
    for note in notes:
        print(f"camopt: note: {note}", file=sys.stderr)
    return scene


def say_compilation(args: Namespace) -> None:
    """Says, before a command is silent for minutes, that it compiles its programs."""
    from camopt.optimizer.first_run import SAYING, programs_missing

    if not args.quiet and programs_missing():
        print(SAYING, file=sys.stderr, flush=True)


def print_area_words(lift, scene, whose: str = "") -> None:
    """What must be said of a cam's duration and area ratio, a line each."""
    from camopt.optimizer.bound.area_words import area_words

    for sentence in area_words(lift, scene.design):
        print(f"note: {whose}{sentence}")


def cam_of(args: Namespace, scene: Scene, cam: "str | Path | None" = None) -> "Lift":
    """The cam that a command names, or another that is read as that one is."""
    from camopt.cam.read import read_cam

    given = args.cam if cam is None else cam
    text = {"table_first_line": args.table_first_line, "table_columns": args.table_columns}
    return read_cam(given, scene, args.table_angle, args.table_lift, args.table_ratio, args.table_probe_mm, **text)
