"""The command-line verbs that study a scene: bounds, modes, yields, sweeps and measurements of accuracy."""

import sys
import tomllib
from argparse import Namespace
from contextlib import nullcontext
from pathlib import Path

from camopt.cli.arguments import cam_of, folder_of, run_named, say_compilation, scene_of, unique_values, write_result
from camopt.optimizer.program.chosen_duration import load_scene
from camopt.scene import InputError, builtin_scenes, scene_text
from camopt.scene.errors import did_you_mean
from camopt.scene.schema import SIMULATED
from camopt.scene.text_file import excerpt
from camopt.storage import write_csv


def modes(args: Namespace) -> int:
    scene = scene_of(args, ())
    from camopt.study import modes as study

    result = study.modes(scene, args.state)
    first = f"{scene.name}, {args.state}; closed contacts: {', '.join(result.closed) or 'none'}"
    return write_result(args, result.as_dict(), [first, *study.mode_lines(result)])


def bound(args: Namespace) -> int:
    scene = scene_of(args)
    from camopt.optimizer.bound.summary import area_bound, bound_lines

    content = area_bound(scene)
    return write_result(args, content, bound_lines(content))


def rise(args: Namespace) -> int:
    """Prints the least peak and its bound, and writes the motion."""
    from camopt.study import rise as study

    if args.least and args.jerk_max_mm_per_deg3:
        raise InputError("--jerk-max-mm-per-deg3: what is least is then the acceleration: leave --least out")
    motion = study.rise(args.rise_mm, args.over_deg, study.ORDERS[args.least or "jerk"], args.jerk_max_mm_per_deg3)
    if args.csv:
        write_csv(args.csv, motion.table(args.step_deg))
    return write_result(args, motion.as_dict(), [motion])


def reduce(args: Namespace) -> int:
    scene = scene_of(args)
    lift = cam_of(args, scene)
    from camopt.study.reduce import reduction as study

    reduction = study.reduce(scene, lift, args.speeds, tolerance_mm=args.tolerance_mm)
    return write_result(args, reduction.as_dict(), study.reduction_lines(reduction))


def yield_(args: Namespace) -> int:
    run = run_named(args)
    scene = scene_of(args)
    folder = folder_of(args, scene.name)
    cam = cam_of(args, scene)
    from camopt.study.yields import manufacturing_yield, yield_lines

    say_compilation(args)
    settings = {"speeds_rpm": args.speeds, "seed": args.seed, "halve": args.halve, "price": args.price}
    storage = {"out": folder, "resume": args.resume}
    result = manufacturing_yield(scene, cam, args.trains, **settings, **storage, progress=not args.quiet)
    lines = [*yield_lines(result), f"folder: {folder}"]
    if result.prices and run:
        from camopt.plots import save
        from camopt.report import write_report

        save(result.prices.plot(), run / "figures", "prices")
        lines.append(f"report: {write_report(run)}")
    return write_result(args, result.as_dict(), lines)


def what_if(args: Namespace) -> int:
    """Prints the verdict, area, speed limits and yield of a cam before and after the change."""
    scene = scene_of(args)
    cam = cam_of(args, scene)
    changes = unique_values(args.set, "--set {name}: is given twice: give one value")
    from camopt.study import what_if as study

    say_compilation(args)
    content = study.what_if(scene, cam, changes, redesign=args.redesign, trains=args.trains)
    return write_result(args, content, study.what_if_lines(content))


def sweep(args: Namespace) -> int:
    """Computes the tasks of a plan and prints how many ended in each state; returns 3 where some failed."""
    from camopt.tasks.engines import cluster
    from camopt.tasks.plan import load_plan

    store = Path(args.store)
    if store.exists() and not args.resume:
        raise InputError(f"{store}: exists already: --resume goes on in it with the same plan; or name another --store")
    if args.resume and not store.exists():
        raise InputError(f"{store}: is not there, so there is nothing to go on with: leave --resume out")
    if args.insecure and args.scheduler is None:
        raise InputError("--insecure: belongs to --scheduler: give both, or leave it out")
    if args.retry_failed and not args.resume:
        raise InputError("--retry-failed: computes the failed tasks of a store once more: add --resume")
    plan = load_plan(args.plan)
    from camopt.tasks.sweep import sweep as sweep_tasks

    with cluster(args.scheduler, args.insecure) if args.scheduler else nullcontext((None, None)) as (executor, threads):
        if not args.quiet:
            print(f"{args.plan}: {len(plan)} tasks into {store}", file=sys.stderr, flush=True)
        args.begun = True
        settings = {"retry_failed": args.retry_failed, "progress": not args.quiet}
        try:
            rows = sweep_tasks(plan, store, executor, args.workers or threads, **settings)
        except InputError:
            args.begun = False  # the error sentence states what happened to the store
            raise
    if args.csv:
        rows.write_csv(args.csv)
    print("\n".join(rows.lines()))
    return 3 if "failed" in rows.counts else 0


def tradeoff(args: Namespace) -> int:
    scene = scene_of(args)
    folder = folder_of(args, scene.name)
    cam = None if args.cam is None else cam_of(args, scene)
    from camopt.study.tradeoff.tradeoff import tradeoff as measure

    measured = measure(scene, folder, args.resume, size=args.size, progress=not args.quiet, cam=cam)
    print("\n".join(measured.table))
    print(f"the job's dials: {measured.folder / 'tradeoff.txt'}, every row: {measured.folder / 'tradeoff.csv'}")
    print(f"figures: {measured.folder / 'figures'}")
    return 0


def extremes(args: Namespace) -> int:
    dynamic = (name for name, text in builtin_scenes().items() if "seat" in tomllib.loads(text))
    scenes = [scene_of(args)] if args.scene else [load_scene(name, need=SIMULATED) for name in dynamic]
    folder = folder_of(args, scenes[0].name if args.scene else "extremes")
    from camopt.plots import save
    from camopt.plots.studies import verdict_matrix
    from camopt.study.extremes import extremes as study

    rows = study.extremes(scenes, folder, args.resume, progress=not args.quiet)
    for scene in scenes:
        of_scene = [r for r in rows if r["case"].startswith(f"{scene.name}: ")]
        save(verdict_matrix(of_scene, scene.name), folder / "figures", f"extremes-{scene.name}")
    for method, by_verdict in study.counts(rows).items():
        print(f"{method:<44}" + ", ".join(f"{n} {v}" for v, n in by_verdict.items()))
    wrong = study.defects(rows)
    for row in wrong:
        print(f"wrong: {row['case']}, {row['method']}: {row['error_of']} off by {float(row['error']):.3g}")
    print(f"{len(rows)} rows, {len(wrong)} wrong without a warning: {folder}")
    return 3 if wrong else 0


def gradient(args: Namespace) -> int:
    scene = scene_of(args)
    lift = cam_of(args, scene)
    from camopt.study.gradient.report import gradient_report, report_lines

    report = gradient_report(scene, lift, args.speed, progress=not args.quiet)
    return write_result(args, report, [f"{scene.name}, {lift.family}, {args.speed:g} r/min", *report_lines(report)])


def scenes(args: Namespace) -> int:
    if args.name is not None:
        if args.name not in builtin_scenes():
            expected = did_you_mean(args.name, builtin_scenes()) or f"; built in are {', '.join(builtin_scenes())}"
            raise InputError(f"scene {excerpt(args.name)}: not built in{expected}")
        print(scene_text(args.name), end="")
        return 0
    width = max(map(len, builtin_scenes()))
    for name, text in builtin_scenes().items():
        print(f"{name:<{width}} {tomllib.loads(text)['title']}")
    return 0
