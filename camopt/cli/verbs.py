"""The verbs of the command line: each loads what it needs, calls one public function and prints the outcome.

Everything beyond the scene is imported inside the verb, so that bad input is answered before JAX or numba load.
"""

import sys
import tomllib
from argparse import Namespace
from pathlib import Path

from camopt.cli.cam_verb import cam as cam
from camopt.cli.design_verb import design as design
from camopt.cli.given import SIMULATED
from camopt.cli.given import cam_of as _cam_of
from camopt.cli.given import print_area_words as _print_area_words
from camopt.cli.given import say_compilation as _say_compilation
from camopt.cli.given import scene_of as _scene_of
from camopt.cli.rise_verb import rise as rise
from camopt.cli.sweep_verb import sweep as sweep
from camopt.cli.what_if_verb import what_if as what_if
from camopt.scene import InputError, build_train, builtin_scenes, load_scene, scene_text
from camopt.scene.spelling import did_you_mean
from camopt.scene.text_file import excerpt
from camopt.storage import check_run_folder, default_run_folder, write_csv, write_json


def optimize(args: Namespace) -> int:
    scene = _scene_of(args)
    folder = _run_folder(args, scene.name)
    if not args.quiet:
        print(f"{scene.name}: designs a cam at accuracy {args.accuracy} into {folder}", file=sys.stderr, flush=True)
    from camopt.cam.read import read_cam
    from camopt.optimizer.run import optimize as run
    from camopt.report import write_report

    def designed(folder: Path) -> None:
        _print_outcome(folder)
        sys.stdout.flush()
        if args.accuracy != "draft":  # whose comparison hardly takes longer than the page
            write_report(folder)

    result = run(
        scene,
        speeds=args.speeds,
        accuracy=args.accuracy,
        gradient=args.gradient,
        out=folder,
        seed=args.seed,
        resume=args.resume,
        progress=not args.quiet,
        designed=designed,
        compare=not args.no_compare,
        wanted_yield=args.wanted_yield,
        free=_once_each(args.free),
        start=None if args.start is None else read_cam(args.start, scene),
    )
    page = write_report(result.folder)
    print(f"run folder: {result.folder}, report: {page}")
    return result.exit_code


def _once_each(free: list[tuple[str, tuple[float, float]]]) -> dict[str, tuple[float, float]]:
    """The ranges of free numbers by their names; raises InputError for a name that comes twice."""
    found: dict[str, tuple[float, float]] = {}
    for name, ends in free:
        if name in found:
            raise InputError(f"free {excerpt(name)} is given twice: give one range")
        found[name] = ends
    return found


def _print_outcome(folder: Path) -> None:
    """What a run came to, from the files in its folder alone."""
    from camopt.report.folder import read_run_folder
    from camopt.report.outcome import outcome_lines

    print("\n".join(outcome_lines(read_run_folder(folder))))


def report(args: Namespace) -> int:
    folder = Path(args.run)
    from camopt.report.folder import read_run_folder
    from camopt.report.regenerated import differences, regenerate, stated_lines

    if args.check:
        print("\n".join(stated_lines(read_run_folder(folder))))
        found = differences(folder)
        print("\n".join(found or ["every number comes out as it is stated"]))
        return 3 if found else 0
    page = regenerate(folder)
    _print_outcome(folder)
    print(f"run folder: {folder}, report: {page}")
    return 0


def verify(args: Namespace) -> int:
    run = Path(args.scene) if (Path(args.scene) / "scene.toml").is_file() else None
    args.cam = args.cam or (run and args.scene)
    if args.cam is None:
        raise InputError(
            f"verify {excerpt(args.scene)}: no cam: add --cam CAM, or give a run folder in the scene's place"
        )
    if args.outside:
        from camopt.verifier.from_outside import require_outside

        require_outside()
    scene = _scene_of(args)
    lift = _cam_of(args, scene)
    from camopt.verifier.accuracy import verify as verdict_of

    _say_compilation(args)
    asked = {"speeds_rpm": args.speeds, "methods": args.method, "accuracy": args.accuracy, "outside": args.outside}
    report = verdict_of(scene, lift, **asked, progress=not args.quiet)
    record, lines = report.as_dict(), []
    if args.energy or args.periodic:
        from camopt.study.settled_motion import settled_lines, settled_motions

        found = settled_motions(lift, report, with_energy=args.energy, with_periodic=args.periodic)
        record["speeds"] = [entry | more for entry, more in zip(record["speeds"], found, strict=True)]
        lines = settled_lines(report, found)
    if args.json:
        write_json(args.json, record)
    _print_area_words(lift, scene)
    print("\n".join([str(report), *lines]))
    if report.outside and run and args.cam == args.scene:
        from camopt.report import write_report

        write_json(run / "outside.json", list(report.outside))
        print(f"report: {write_report(run)}")
    return 0 if report.verdict == "confirmed" else 3


def simulate(args: Namespace) -> int:
    scene = _scene_of(args)
    lift = _cam_of(args, scene)
    from camopt.study.simulate.dataset import motion_lines, motion_table
    from camopt.study.simulate.motion import simulate as motion_of
    from camopt.verifier.verdict import methods_for

    _say_compilation(args)
    method = args.method or ("event" if args.accuracy is None else methods_for(build_train(scene))[0])
    motion = motion_of(
        scene, lift, args.speed, method, revolutions=args.revolutions, step_deg=args.step_deg, accuracy=args.accuracy,
        progress=not args.quiet,
    )  # fmt: skip
    if args.csv:
        write_csv(args.csv, motion_table(motion))
    print(f"{scene.name}, {lift.family}, {args.speed:g} r/min, {method}, from rest")
    if "accuracy_statement" in motion.attrs:
        print(motion.attrs["accuracy_statement"])
    print("\n".join(motion_lines(motion, scene)))
    return 0


def compare(args: Namespace) -> int:
    scene = _scene_of(args)
    folder = _run_folder(args, scene.name)
    from camopt.cli.comparison_lines import comparison_lines, distinct_names

    names = distinct_names(args.design)
    designs = {name: _cam_of(args, scene, Path(d)) for name, d in zip(names, args.design, strict=True)}
    from camopt.optimizer.baselines.comparison import compare as comparison

    _say_compilation(args)
    said: list[str] = []
    comparison(scene, designs, folder, baselines=args.baselines, progress=not args.quiet, note=said.append)
    print("\n".join([*comparison_lines(folder), *(f"note: {sentence}" for sentence in said)]))
    for name, lift in designs.items():
        _print_area_words(lift, scene, f"{name}: ")
    print(f"comparison: {folder}")
    return 0


def modes(args: Namespace) -> int:
    scene = _scene_of(args, ())
    from camopt.study.modes import mode_lines
    from camopt.study.modes import modes as modes_of

    found = modes_of(scene, args.state)
    if args.json:
        write_json(args.json, found.as_dict())
    lines = [f"{scene.name}, {args.state}; closed contacts: {', '.join(found.closed) or 'none'}", *mode_lines(found)]
    print("\n".join(lines))
    return 0


def bound(args: Namespace) -> int:
    scene = _scene_of(args)
    from camopt.cli.bound_lines import bound_lines
    from camopt.optimizer.bound.summary import area_bound

    content = area_bound(scene)
    if args.json:
        write_json(args.json, content)
    print("\n".join(bound_lines(content)))
    return 0


def reduce(args: Namespace) -> int:
    scene = _scene_of(args)
    lift = _cam_of(args, scene)
    from camopt.study.reduce.reduction import reduce as reduction_of
    from camopt.study.reduce.reduction import reduction_lines

    found = reduction_of(scene, lift, args.speeds, tolerance_mm=args.tolerance_mm)
    if args.json:
        write_json(args.json, found.as_dict())
    print("\n".join(reduction_lines(found)))
    return 0


def yield_(args: Namespace) -> int:
    scene = _scene_of(args)
    folder = _run_folder(args, scene.name)
    cam = _cam_of(args, scene)
    from camopt.study.yields.yields import manufacturing_yield, yield_lines

    _say_compilation(args)
    found = manufacturing_yield(
        scene, cam, args.trains, speeds_rpm=args.speeds, seed=args.seed, halve=args.halve, out=folder,
        resume=args.resume, progress=not args.quiet,
    )  # fmt: skip
    if args.json:
        write_json(args.json, found.as_dict())
    print("\n".join(yield_lines(found)))
    print(f"folder: {folder}")
    return 0


def tradeoff(args: Namespace) -> int:
    scene = _scene_of(args)
    folder = _run_folder(args, scene.name)
    cam = None if args.cam is None else _cam_of(args, scene)
    from camopt.study.tradeoff.tradeoff import tradeoff as measure

    found = measure(scene, folder, args.resume, size=args.size, progress=not args.quiet, cam=cam)
    print("\n".join(found.table))
    print(f"in words: {found.folder / 'tradeoff.txt'}, every row: {found.folder / 'tradeoff.csv'}")
    print(f"figures: {found.folder / 'figures'}")
    return 0


def extremes(args: Namespace) -> int:
    dynamic = (name for name, text in builtin_scenes().items() if "seat" in tomllib.loads(text))
    scenes = [_scene_of(args)] if args.scene else [load_scene(name, need=SIMULATED) for name in dynamic]
    folder = _run_folder(args, scenes[0].name if args.scene else "extremes")
    from camopt.plots import save
    from camopt.plots.verdicts import verdict_matrix
    from camopt.study.extremes.extremes import counts, defects, extremes

    rows = extremes(scenes, folder, args.resume, progress=not args.quiet)
    for scene in scenes:
        mine = [r for r in rows if r["case"].startswith(f"{scene.name}: ")]
        save(verdict_matrix(mine, scene.name), folder / "figures", f"extremes-{scene.name}")
    for method, by_verdict in counts(rows).items():
        print(f"{method:<44}" + ", ".join(f"{n} {v}" for v, n in by_verdict.items()))
    wrong = defects(rows)
    for row in wrong:
        print(f"wrong: {row['case']}, {row['method']}: {row['error_of']} off by {float(row['error']):.3g}")
    print(f"{len(rows)} rows, {len(wrong)} wrong without a warning: {folder}")
    return 3 if wrong else 0


def gradient(args: Namespace) -> int:
    scene = _scene_of(args)
    lift = _cam_of(args, scene)
    from camopt.study.gradient.report import gradient_report, report_lines

    report = gradient_report(scene, lift, args.speed, progress=not args.quiet)
    if args.json:
        write_json(args.json, report.as_dict())
    print(f"{scene.name}, {lift.family}, {args.speed:g} r/min")
    print("\n".join(report_lines(report)))
    return 0


def scenes(args: Namespace) -> int:
    if args.name is not None:
        if args.name not in builtin_scenes():
            meant = did_you_mean(args.name, builtin_scenes()) or f"; built in are {', '.join(builtin_scenes())}"
            raise InputError(f"scene {excerpt(args.name)}: not built in{meant}")
        print(scene_text(args.name), end="")
        return 0
    width = max(map(len, builtin_scenes()))
    for name, text in builtin_scenes().items():
        print(f"{name:<{width}} {tomllib.loads(text)['title']}")
    return 0


def _run_folder(args: Namespace, name: str) -> Path:
    """The folder that a command is to write, known to be free or to be resumed; `args.folder` from here on."""
    resume = getattr(args, "resume", False)
    if resume and args.out is None:
        raise InputError(f"{args.command}: --resume needs the folder to go on in: add --out DIR")
    folder = Path(args.out) if args.out else default_run_folder(name)
    check_run_folder(folder, resume)
    args.folder = folder
    return folder
