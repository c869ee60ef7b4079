"""The verbs that design, judge and show a cam: each calls one public function and prints the result.

Everything but the scene is imported inside the verb, so that bad input is reported before JAX or numba are loaded.
"""

import atexit
import gc
import signal
import sys
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from camopt.cli.arguments import (
    cam_of,
    folder_of,
    print_area_words,
    run_named,
    say_compilation,
    scene_of,
    unique_values,
    write_result,
)
from camopt.cli.studies import bound, extremes, gradient, modes, reduce, rise, scenes, sweep, tradeoff, what_if, yield_  # noqa: F401
from camopt.optimizer.program.chosen_duration import load_scene
from camopt.scene import InputError, Scene, build_train
from camopt.scene.schema import SIMULATED
from camopt.storage import write_csv, write_csv_rows, write_json
from camopt.verifier import DRAFT

if TYPE_CHECKING:
    from camopt.cam.card import CamCard
    from camopt.cam.lift import Lift

atexit.register(gc.freeze)  # a last collection at exit would take a second for nothing
GEOMETRY = ("speed", "contour", "dxf")
"""Options of `camopt cam` that need [geometry]."""
CARD = ("card", "card_csv", "lifts_mm", "centre_deg", "exhaust")
"""Options of `camopt cam` that require a cam card."""


def optimize(args: Namespace) -> int:
    scene = scene_of(args)
    folder = folder_of(args, scene.name)
    if not args.quiet:
        print(f"{scene.name}: designs a cam at accuracy {args.accuracy} into {folder}", file=sys.stderr, flush=True)
    from camopt.cam.read import read_cam
    from camopt.optimizer.run import optimize as run
    from camopt.report import write_report

    def designed(folder: Path) -> None:
        _print_outcome(folder)
        sys.stdout.flush()
        if args.accuracy != DRAFT:  # a draft's comparison takes hardly longer than the page
            write_report(folder)

    names = ("speeds", "accuracy", "gradient", "seed", "resume", "wanted_yield")
    settings: dict[str, Any] = {name: getattr(args, name) for name in names}
    settings["free"] = unique_values(args.free, "free {name} is given twice: give one range")
    settings["start"] = None if args.start is None else read_cam(args.start, scene)
    settings["compare"] = not args.no_compare
    result = run(scene, out=folder, progress=not args.quiet, designed=designed, **settings)
    page = write_report(result.folder)
    print(f"run folder: {result.folder}, report: {page}")
    return result.exit_code


def _print_outcome(folder: Path) -> None:
    """Prints the outcome of a run, from the files in its folder alone."""
    from camopt.report.folder import read_run_folder
    from camopt.report.outcome import outcome_lines

    print("\n".join(outcome_lines(read_run_folder(folder))))


def report(args: Namespace) -> int:
    folder = Path(args.run)
    from camopt.report.folder import read_run_folder
    from camopt.report.regenerated import differences, regenerate, stated_lines

    if args.check:
        print("\n".join(stated_lines(read_run_folder(folder))))
        sentences = differences(folder)
        print("\n".join(sentences or ["every number comes out as it is stated"]))
        return 3 if sentences else 0
    page = regenerate(folder)
    _print_outcome(folder)
    print(f"run folder: {folder}, report: {page}")
    return 0


def design(args: Namespace) -> int:
    """Serves the designer's page on this machine and prints its address; a keyboard interrupt ends it normally."""
    scene = load_scene(args.scene, need=SIMULATED)
    from camopt.designer.requests import RequestHandler
    from camopt.designer.server import DesignServer
    from camopt.designer.session import QUICK, Session
    from camopt.optimizer.first_run import SAYING, compile_programs, programs_missing

    requests = RequestHandler(Session(scene), Path.cwd())
    server = DesignServer(requests, args.port)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        if programs_missing():
            print(SAYING, file=sys.stderr, flush=True)
            compile_programs()
        requests.slow.start()
        for part in QUICK:  # loads the programs, so that the first answers are not slower than later ones
            requests.session.answer({}, part)
        gc.freeze()  # else a garbage collection may delay an answer
        print(f"{scene.name}: open {server.address} in a browser on this machine; Ctrl-C ends it", flush=True)
        server.serve_forever()
    except KeyboardInterrupt:
        print("the designer has ended", file=sys.stderr)
    finally:
        server.server_close()
        requests.stop()
    return 0


def verify(args: Namespace) -> int:
    run = run_named(args)
    if args.outside:
        from camopt.verifier.from_outside import require_outside

        require_outside()
    scene = scene_of(args)
    lift = cam_of(args, scene)
    from camopt.verifier.accuracy import verify as verdict_of

    say_compilation(args)
    settings = {"speeds_rpm": args.speeds, "methods": args.method, "accuracy": args.accuracy, "outside": args.outside}
    verdict = verdict_of(scene, lift, **settings, progress=not args.quiet)
    record, lines = verdict.as_dict(), []
    if args.energy or args.periodic:
        from camopt.study.settled_motion import settled_lines, settled_records

        settled = settled_records(lift, verdict, with_energy=args.energy, with_periodic=args.periodic)
        record["speeds"] = [entry | more for entry, more in zip(record["speeds"], settled, strict=True)]
        lines = settled_lines(verdict, settled)
    print_area_words(lift, scene)
    write_result(args, record, [verdict, *lines])
    if verdict.outside and run:
        from camopt.report import write_report

        write_json(run / "outside.json", list(verdict.outside))
        print(f"report: {write_report(run)}")
    return 0 if verdict.verdict == "confirmed" else 3


def simulate(args: Namespace) -> int:
    scene = scene_of(args)
    lift = cam_of(args, scene)
    from camopt.study.simulate.dataset import motion_lines, motion_table
    from camopt.study.simulate.motion import simulate as motion_of
    from camopt.verifier.verdict import methods_for

    say_compilation(args)
    method = args.method or ("event" if args.accuracy is None else methods_for(build_train(scene))[0])
    settings = {"revolutions": args.revolutions, "step_deg": args.step_deg, "accuracy": args.accuracy}
    motion = motion_of(scene, lift, args.speed, method, **settings, progress=not args.quiet)
    if args.csv:
        write_csv(args.csv, motion_table(motion))
    stated = [motion.attrs["accuracy_statement"]] if "accuracy_statement" in motion.attrs else []
    first = f"{scene.name}, {lift.family}, {args.speed:g} r/min, {method}, from rest"
    print("\n".join([first, *stated, *motion_lines(motion, scene)]))
    return 0


def compare(args: Namespace) -> int:
    scene = scene_of(args)
    folder = folder_of(args, scene.name)
    short = [Path(path).name or path for path in args.design]  # the names of designs; whole paths where two are equal
    names = [str(Path(path)) if short.count(n) > 1 else n for path, n in zip(args.design, short, strict=True)]
    designs = {name: cam_of(args, scene, Path(path)) for name, path in zip(names, args.design, strict=True)}
    from camopt.optimizer.baselines.comparison import compare as comparison
    from camopt.report.tables import comparison_lines

    say_compilation(args)
    notes: list[str] = []
    comparison(scene, designs, folder, baselines=args.baselines, progress=not args.quiet, note=notes.append)
    print("\n".join([*comparison_lines(folder), *(f"note: {sentence}" for sentence in notes)]))
    for name, lift in designs.items():
        print_area_words(lift, scene, f"{name}: ")
    print(f"comparison: {folder}")
    return 0


def cam(args: Namespace) -> int:
    """Writes the requested files and prints the cam against its limits, its contact, its card and its torque."""
    needs_motion = any(getattr(args, name) is not None for name in ("speed", "lobes_deg", "valve_lift"))
    scene = scene_of(args, SIMULATED if needs_motion else ("operation", "design"))
    _check_cam_options(args, scene)
    lift = cam_of(args, scene)
    from camopt.study.cam_exports import export
    from camopt.study.cam_sheet import sheet

    sentences = export(scene, lift, args)
    speed = args.speed if scene.geometry is not None else None
    print("\n".join([*sheet(scene, lift, speed), *sentences]))
    if any(getattr(args, name) for name in CARD):
        from camopt.cam.card import COLUMNS

        cards = _cards(args, scene, lift)
        if args.card_csv:
            write_csv_rows(args.card_csv, COLUMNS, [row for card in cards for row in card.cells()])
        print("\n".join(map(str, cards)))
    if args.lobes_deg is not None:
        from camopt.study.cam_force import camshaft_torque

        print(camshaft_torque(scene, lift, args.lobes_deg, args.speed))
    print_area_words(lift, scene)
    return 0


def _check_cam_options(args: Namespace, scene: Scene) -> None:
    """Raises InputError for options that the scene or the other options do not allow."""
    needing = [f"--{name}" for name in GEOMETRY if getattr(args, name) is not None]
    if (args.lobes_deg is not None or args.dynamic_lift is not None) and "--speed" in needing:
        needing.remove("--speed")
    if args.dynamic_lift is not None and args.speed is None:
        raise InputError("--dynamic-lift: is the valve's motion at a speed: add --speed RPM")
    if needing and scene.geometry is None:
        raise InputError(f"scene {scene.name}: {' and '.join(needing)} needs [geometry]: follower and base radius")
    if args.step_crank_deg is not None and args.csv is None:
        raise InputError("--step-crank-deg: is the step of the lift table: add --csv FILE")
    if args.exhaust is not None and (args.centre_deg is None or args.exhaust_centre_deg is None):
        raise InputError(
            "--exhaust: an overlap needs the crank angle of both cams: add --centre-deg and --exhaust-centre-deg"
        )
    if args.exhaust_centre_deg is not None and args.exhaust is None:
        raise InputError("--exhaust-centre-deg: belongs to --exhaust: give both, or leave it out")


def _cards(args: Namespace, scene: Scene, lift: "Lift") -> list["CamCard"]:
    """The card of the cam, and that of the exhaust cam if one is given."""
    from camopt.cam.card import LIFTS_MM, CrankTiming, cam_card

    per_crank, lifts = scene.required_operation.cam_per_crank, args.lifts_mm or LIFTS_MM
    settings = {"at_mm": lifts[0], "cam_per_crank": per_crank}
    timing = None if args.centre_deg is None else CrankTiming.of(lift, *args.centre_deg, **settings)
    if args.exhaust is None:
        return [cam_card(lift, lifts, timing=timing)]
    exhaust = cam_of(args, scene, args.exhaust)
    closing = args.exhaust_centre_deg[0] == "tdc-lift"
    exhaust_timing = CrankTiming.of(exhaust, *args.exhaust_centre_deg, closing=closing, **settings)
    exhaust_card = cam_card(exhaust, lifts, name=f"exhaust, {exhaust.family}", timing=exhaust_timing)
    return [cam_card(lift, lifts, name=f"intake, {lift.family}", timing=timing, other=exhaust_card), exhaust_card]
