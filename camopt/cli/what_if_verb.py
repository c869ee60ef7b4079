"""The verb `what-if` of the command line, and its options."""

import argparse
from collections.abc import Callable

from camopt.cli.cam_options import cam_options
from camopt.cli.given import cam_of, say_compilation, scene_of
from camopt.cli.values import change, trains
from camopt.scene.errors import InputError
from camopt.scene.text_file import excerpt
from camopt.storage import write_json


def what_if(args: argparse.Namespace) -> int:
    """Prints what a cam comes to before and after the change."""
    scene = scene_of(args)
    cam = cam_of(args, scene)
    changes = dict(args.set)
    if len(changes) < len(args.set):
        twice = next(name for i, (name, _) in enumerate(args.set) if name in dict(args.set[:i]))
        raise InputError(f"--set {excerpt(twice)}: is given twice: give one value")
    from camopt.study.what_if import what_if as outcome

    say_compilation(args)
    found = outcome(scene, cam, changes, redesign=args.redesign, trains=args.trains)
    if args.json:
        write_json(args.json, found.as_dict())
    print(found)
    return 0


def what_if_options(command: Callable[[str, str, str], argparse.ArgumentParser]) -> None:
    c = command(
        "what-if",
        "what other numbers of a scene would buy: verdict, area, where jump and bounce begin, yield, before and after",
        "camopt what-if kodama --cam polydyne --set valve_tip.mass_kg=*0.9",
    )
    c.add_argument("scene", metavar="SCENE", help="built-in scene or TOML file")
    cam_options(c)
    words = (
        "a number of a mass or an element, or as in design.max_lift_mm=9.8, repeatable; a * before it multiplies the "
        "scene's own"
    )
    c.add_argument("--set", type=change, action="append", required=True, metavar="NAME.KEY=[*]VALUE", help=words)
    c.add_argument("--redesign", action="store_true", help="also the cam that a draft search finds for them")
    c.add_argument("--trains", type=trains, default=100, metavar="N", help="trains drawn for the yield (100)")
    c.add_argument("--json", metavar="FILE", help="write the table as JSON")
