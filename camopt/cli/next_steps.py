"""The last line of a command on standard error: the next step, or after a failure the files that are left."""

import json
import shlex
from argparse import Namespace
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from camopt.measure.yield_words import ADVISED, ENOUGH, HELD, standing
from camopt.scene.errors import InputError

if TYPE_CHECKING:
    from camopt.report.folder import RunFolder


def next_step(args: Namespace, code: int) -> str:
    """A sentence with a command to paste: the `next` of the table of commands, if any; `code` is the exit code."""
    if args.next is None:
        return _AFTER[args.command](args, code)
    sentences = {"otherwise": args.next} if isinstance(args.next, str) else args.next
    option = next((name for name in sentences if getattr(args, name, None) is not None), "otherwise")
    values = {name: f"{value:g}" if isinstance(value, float) else str(value) for name, value in vars(args).items()}
    quoted = {name: shlex.quote(word) for name, word in values.items()}
    cam = {"cam": shlex.join(map(str, _cam_of(args)))} if "table_angle" in values else {}
    return sentences[option].format(**quoted | cam)


def left_behind(args: Namespace) -> str:
    """The end of an error sentence, which states what a command that failed leaves in its folder and how to resume it.
    A folder that is still empty is deleted, so that the same command can be repeated."""
    if hasattr(args, "store"):  # only `sweep` has a store; it leaves nothing before it begins
        again = _camopt("sweep", args.plan, "--store", args.store, "--resume")
        left = f"; {args.store} is left, with a row for each task that ended: {again} goes on"
        return left if getattr(args, "begun", False) else ""
    folder: Path | None = getattr(args, "folder", None)
    if folder is None or not folder.is_dir():
        return ""
    names = sorted(path.name for path in folder.iterdir())
    if getattr(args, "resume", False):
        return f"; {folder} is kept, with {', '.join(names) or 'nothing in it'}"
    if not names:
        folder.rmdir()
        return ""
    left = f"; {folder} is left, with {', '.join(names)}"
    if not hasattr(args, "resume"):
        return f"{left}: delete it or name another --out"
    again = _camopt(args.command, *([args.scene] if args.scene else []), "--out", folder, "--resume")
    return f"{left}: {again} with the same options goes on there, or delete it"


def _camopt(*words: object) -> str:
    return f"`{shlex.join(['camopt', *map(str, words)])}`"


def _cam_of(args: Namespace) -> list[object]:
    """Scene and cam as they were given, with the options for reading a table."""
    options = {"--table-angle": args.table_angle, "--table-lift": args.table_lift, "--table-ratio": args.table_ratio}
    options["--table-probe-mm"] = "flat" if args.table_probe_mm == float("inf") else args.table_probe_mm
    options["--table-columns"] = None if args.table_columns is None else ",".join(args.table_columns)
    options["--table-first-line"] = args.table_first_line
    layout = [word for option, value in options.items() if value is not None for word in (option, value)]
    return [args.scene, "--cam", args.cam, *layout]


def _is_table(args: Namespace) -> bool:
    """Whether the cam is already a lift table, so that writing one need not be advised."""
    return Path(args.cam).is_file() and Path(args.cam).suffix != ".json"


def _lift_table(*cam: object) -> str:
    """The sentence on the command that writes a cam's lift table for the grinder."""
    command = _camopt("cam", *cam, "--csv", "lift.csv", "--digits", 5)
    return f"{command} writes the cam's lift table for the grinder"


def _run_at(folder: object) -> "RunFolder | None":
    """The run folder at a path; None where it cannot be read or has no verification."""
    from camopt.report.folder import read_run_folder

    with suppress(InputError):
        run = read_run_folder(Path(str(folder)))
        return run if run.verification else None
    return None


def _advised(scene: object, folder: object) -> str:
    """The first advice of the report on the run folder; empty where there is no run folder."""
    from camopt.report.advice import advice

    run = _run_at(folder)
    steps = advice(run, _scene_to_name(scene, run, folder), str(folder)) if run else []
    return _advice_line(steps[0]) if steps else ""


def _scene_to_name(scene: object, run: "RunFolder", folder: object) -> str:
    """The scene as it was given, or that of the folder where the design chose some of its numbers."""
    return str(Path(str(folder)) / "scene.toml" if run.design.get("free") or scene is None else scene)


def _advice_line(step: dict[str, str]) -> str:
    return f"{step['words'].rstrip('.')}: `{step['command']}`"


def _after_optimize(args: Namespace, code: int) -> str:
    if advised := _advised(args.scene, args.folder):
        return advised
    if code:
        return f"{_camopt('verify', args.scene, '--cam', args.folder)} shows at which speeds it breaks which limit"
    return f"{_lift_table(args.scene, '--cam', args.folder)}; the run folder has one with every digit"


def _after_verify(args: Namespace, code: int) -> str:
    if code:
        from camopt.report.advice import further

        run = _run_at(args.cam)
        if run:
            return _advice_line(further(run, _scene_to_name(args.scene, run, args.cam), str(args.cam)))
        return f"{_camopt('optimize', args.scene)} designs a cam that holds the limits"
    if _is_table(args):
        yield_command = _camopt("yield", *_cam_of(args), "--trains", 200)
        return f"{yield_command} counts the trains as built that hold, if the scene has tolerances"
    advised = _advised(args.scene, args.cam)
    if advised and "`camopt verify" not in advised:  # `verify` has just been run
        return advised
    return _lift_table(*_cam_of(args))


def _after_compare(args: Namespace, code: int) -> str:
    cams = args.folder / "cams"
    first = min(cams.glob("*.json"), default=None) if cams.is_dir() else None
    if first is None:
        return f"{_camopt('optimize', args.scene)} designs a cam to compare"
    return f"{_camopt('cam', args.scene, '--cam', first)} shows one of the cams; {args.folder / 'figures'} shows all"


def _after_cam(args: Namespace, code: int) -> str:
    if _is_table(args):
        return f"{_camopt('verify', *_cam_of(args))} says whether the valve train follows it"
    if args.csv is None:
        return _advised(args.scene, args.cam) or _lift_table(*_cam_of(args))
    return f"{_camopt('verify', args.scene, '--cam', args.csv)} judges the table as it was written, with its rounding"


def _after_rise(args: Namespace, code: int) -> str:
    rise = "rise", "--rise-mm", f"{args.rise_mm:g}", "--over-deg", f"{args.over_deg:g}"
    if not args.csv:
        least = ["--least", args.least] if args.least else []
        return f"{_camopt(*rise, *least, '--csv', 'rise.csv')} writes the motion of least {args.least or 'jerk'}"
    if args.least:
        return f"{args.csv} is the table of the motion"
    return f"{_camopt(*rise, '--least', 'acceleration')} says how much lower its acceleration may be"


def _after_yield(args: Namespace, code: int) -> str:
    if _enough_trains_hold(args):
        if _is_table(args):
            return f"{args.cam} can go to the grinder: so many trains hold with the cam as it is written there"
        return _lift_table(*_cam_of(args))
    if not args.halve:
        drawn = ["--trains", args.trains, "--seed", args.seed, "--out", args.folder, "--resume", "--halve"]
        return f"{_camopt('yield', *_cam_of(args), *drawn)} adds what half of each tolerance would buy"
    return f"{_camopt('optimize', args.scene, '--yield', ADVISED)} designs a cam that more trains as built hold with"


def _enough_trains_hold(args: Namespace) -> bool:
    """Whether the yield reaches the share that the cam's run asked for, or the advised one where it asked for none."""
    run, record = _run_at(args.cam), {}
    with suppress(OSError, ValueError):
        record = json.loads((Path(args.folder) / "yield.json").read_text(encoding="utf-8"))
    return standing(record) == ENOUGH or (run is not None and standing(run.built) == HELD)


def _after_report(args: Namespace, code: int) -> str:
    if code:
        return f"{_camopt('report', args.run)} makes comparison, figures and page again from the folder"
    check = f"{_camopt('report', args.run, '--check')} judges every stated number anew"
    return _advised(None, args.run) or check


def _after_sweep(args: Namespace, code: int) -> str:
    again = _camopt("sweep", args.plan, "--store", args.store, "--resume", "--csv", f"{args.store}.csv")
    if args.csv is None:
        return f"{again} writes the rows as a table" + (", with the reasons of those that failed" if code else "")
    return f"{_camopt('scenes')} lists scenes for another plan"


_AFTER = {
    "optimize": _after_optimize,
    "verify": _after_verify,
    "compare": _after_compare,
    "cam": _after_cam,
    "rise": _after_rise,
    "yield": _after_yield,
    "report": _after_report,
    "sweep": _after_sweep,
    "extremes": lambda args, code: (
        f"a wrong row without a warning is a defect of camopt: report it with {args.folder / 'extremes.csv'}"
        if code
        else f"{_camopt('tradeoff', args.scene or 'kodama')} measures what accuracy costs"
    ),
}
"""By command without a `next` in the table: the next step, from its arguments and its exit code."""
