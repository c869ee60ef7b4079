"""The verb `cam` of the command line."""

from argparse import Namespace
from typing import TYPE_CHECKING

from camopt.cli.given import SIMULATED, cam_of, print_area_words, scene_of
from camopt.scene import InputError, Scene

if TYPE_CHECKING:
    from camopt.cam.card import CamCard
    from camopt.cam.lift import Lift

GEOMETRY = ("speed", "contour", "dxf")
"""Options that need [geometry]."""
CARD = ("card", "card_csv", "lifts_mm", "centre_deg", "exhaust")
"""Options that ask for a cam card."""


def cam(args: Namespace) -> int:
    """Writes what is asked for and prints the cam against the scene's limits, its contact, its card and its torque."""
    moving = any(getattr(args, name) is not None for name in ("speed", "lobes_deg", "valve_lift"))
    scene = scene_of(args, SIMULATED if moving else ("operation", "design"))
    _check(args, scene)
    lift = cam_of(args, scene)
    from camopt.study.cam_exports import Files, export
    from camopt.study.cam_sheet import sheet

    pitch = {name: getattr(args, name) for name in ("step_deg", "step_crank_deg", "digits", "dxf_tolerance_um")}
    simulated = {"valve_lift": args.valve_lift, "dynamic_lift": args.dynamic_lift, "speed_rpm": args.speed}
    said = export(scene, lift, Files(args.csv, args.contour, args.dxf, args.figure, **simulated, **pitch))
    speed = args.speed if scene.geometry is not None else None
    print("\n".join([*sheet(scene, lift, speed), *said]))
    if any(getattr(args, name) for name in CARD):
        _show_cards(args, _cards(args, scene, lift))
    if args.lobes_deg is not None:
        from camopt.study.camshaft import camshaft_torque

        print(camshaft_torque(scene, lift, args.lobes_deg, args.speed))
    print_area_words(lift, scene)
    return 0


def _check(args: Namespace, scene: Scene) -> None:
    """Raises InputError for options that the scene or the other options do not allow."""
    asked = [f"--{name}" for name in GEOMETRY if getattr(args, name) is not None]
    if (args.lobes_deg is not None or args.dynamic_lift is not None) and "--speed" in asked:
        asked.remove("--speed")
    if args.dynamic_lift is not None and args.speed is None:
        raise InputError("--dynamic-lift: is the valve's motion at a speed: add --speed RPM")
    if asked and scene.geometry is None:
        raise InputError(f"scene {scene.name}: {' and '.join(asked)} needs [geometry]: follower and base radius")
    if args.step_crank_deg is not None and args.csv is None:
        raise InputError("--step-crank-deg: is the step of the lift table: add --csv FILE")
    if args.exhaust is not None and (args.centre_deg is None or args.exhaust_centre_deg is None):
        raise InputError(
            "--exhaust: an overlap needs the crank angle of both cams: add --centre-deg and --exhaust-centre-deg"
        )
    if args.exhaust_centre_deg is not None and args.exhaust is None:
        raise InputError("--exhaust-centre-deg: belongs to --exhaust: give both, or leave it out")


def _cards(args: Namespace, scene: Scene, lift: "Lift") -> list["CamCard"]:
    """The card of the cam, and of the other one where there is one."""
    from camopt.cam.card import LIFTS_MM, CrankTiming, cam_card

    assert scene.operation is not None, "scene_of asks for it"
    per_crank, lifts = scene.operation.cam_per_crank, args.lifts_mm or LIFTS_MM
    how = {"at_mm": lifts[0], "cam_per_crank": per_crank}
    timing = None if args.centre_deg is None else CrankTiming.of(lift, *args.centre_deg, **how)
    if args.exhaust is None:
        return [cam_card(lift, lifts, timing=timing)]
    other = cam_of(args, scene, args.exhaust)
    standing = CrankTiming.of(other, *args.exhaust_centre_deg, closing=args.exhaust_centre_deg[0] == "tdc-lift", **how)
    its = cam_card(other, lifts, name=f"exhaust, {other.family}", timing=standing)
    return [cam_card(lift, lifts, name=f"intake, {lift.family}", timing=timing, other=its), its]


def _show_cards(args: Namespace, cards: list["CamCard"]) -> None:
    from camopt.cam.card import COLUMNS
    from camopt.storage import write_csv_rows

    if args.card_csv:
        write_csv_rows(args.card_csv, COLUMNS, [row for card in cards for row in card.cells()])
    print("\n".join(map(str, cards)))
