"""The options of every command, in the order of the help: a function a command, which adds it to the parser."""

import argparse
from collections.abc import Callable

from camopt.cli.cam_options import cam_options as _cam_options
from camopt.cli.cam_options import card_options, exchange_options
from camopt.cli.cam_options import table_options as _table_options
from camopt.cli.rise_verb import rise_options
from camopt.cli.values import ACCURACIES, accuracy, count, named_range, port, positive, seed, speeds, trains
from camopt.cli.what_if_verb import what_if_options
from camopt.verifier.methods import verdict_methods

PLAN = """a plan (the page "Sweeps" of the site tells all of it):
  format = 1
  verb = "settled"                  # settled, simulate, yield or rehearse
  scenes = ["motori-1"]             # built-in scenes or TOML files
  cams = ["polydyne"]
  speeds_rpm = [4000, 5000]         # left out: each scene's listed speeds
  [vary]                            # numbers of the scenes, every combination
  spring.preload_N = [240, 250]"""
Command = Callable[[str, str, str], argparse.ArgumentParser]


def _optimize(command: Command) -> None:
    c = command(
        "optimize",
        "design the cam of largest area within a scene's limits, verify it and compare it",
        "camopt optimize kodama --speeds nominal --out runs/first",
    )
    _scene(c, default="kodama")
    c.add_argument("--speeds", choices=("band", "nominal"), default="band", help="speeds the cam must hold at (band)")
    c.add_argument("--accuracy", choices=ACCURACIES, default="standard", help="speed against accuracy (standard)")
    c.add_argument(
        "--gradient",
        choices=("auto", "smooth", "exact", "none"),
        default="auto",
        help="slopes of the smoothed motion by JAX, of the exact one, or the first stage alone (auto: smooth)",
    )
    c.add_argument("--start", metavar="CAM", help="the cam that the search begins from (the calmest one)")
    words = "share of the trains as built, drawn within the scene's tolerances, in which the cam must hold, as in 0.99"
    c.add_argument("--yield", type=positive, dest="wanted_yield", metavar="SHARE", help=words)
    words = (
        "a number that the design may choose, repeatable: spring.preload_N=200:320, a tolerance's name, a ramp's key"
    )
    c.add_argument("--free", type=named_range, action="append", default=[], metavar="NAME=LOW:HIGH", help=words)
    c.add_argument("--no-compare", action="store_true", help="leave out the comparison with the literature's cams")
    c.add_argument("--out", metavar="DIR", help="run folder, refused if it exists (runs/<scene>-<UTC time>)")
    c.add_argument("--seed", type=seed, default=0, metavar="N", help="seed of the searches (0)")
    c.add_argument("--resume", action="store_true", help="go on in the run folder named by --out")


def _design(command: Command) -> None:
    c = command(
        "design",
        "a page on this machine that answers while a limit is dragged: cam, forces, bounce, area, yield",
        "camopt design kodama --port 8642",
    )
    _scene(c)
    c.add_argument("--port", type=port, default=0, metavar="N", help="port of the page's address (a free one)")


def _verify(command: Command) -> None:
    c = command(
        "verify",
        "check a cam at speeds with independent methods: own equations and contact laws, common metrics",
        "camopt verify kodama --cam polydyne --speeds 5000,6000 --json verification.json",
    )
    _scene(c)
    _cam_options(c, required=False)
    c.add_argument("--speeds", type=speeds, metavar="LIST", help="5000,6000 or 300:8000:100 crankshaft r/min (listed)")
    c.add_argument("--method", choices=("all", *verdict_methods()), default="all", help="which methods (all)")
    c.add_argument(
        "--accuracy", type=accuracy, default="standard", metavar="A", help="draft, standard, fine or micrometres"
    )
    c.add_argument("--energy", action="store_true", help="also the energy balance of the settled motions")
    words = "also whether each settled motion is the stable periodic solution, with its Floquet multipliers"
    c.add_argument("--periodic", action="store_true", help=words)
    words = "also the valve from rest by Exudyn (extra outside), which the report of a run folder then shows"
    c.add_argument("--outside", action="store_true", help=words)
    c.add_argument("--json", metavar="FILE", help="write the verification as JSON")


def _simulate(command: Command) -> None:
    c = command(
        "simulate",
        "simulate the motion from rest at one speed",
        "camopt simulate kodama --cam polydyne --speed 6000 --csv motion.csv",
    )
    _scene(c)
    _cam_options(c)
    c.add_argument("--speed", type=positive, required=True, metavar="RPM", help="crankshaft r/min")
    c.add_argument(
        "--method",
        choices=(*verdict_methods(), "smooth"),
        help="method (event; with --accuracy the most accurate one for the scene's laws)",
    )
    c.add_argument(
        "--accuracy", type=accuracy, metavar="A", help="draft, standard, fine or micrometres of the valve's position"
    )
    c.add_argument("--revolutions", type=count, default=2, metavar="N", help="cam revolutions from rest (2)")
    c.add_argument("--step-deg", type=positive, default=0.1, metavar="DEG", help="step of the table, cam degrees (0.1)")
    c.add_argument("--csv", metavar="FILE", help="write the motion as a table")


def _compare(command: Command) -> None:
    c = command(
        "compare",
        "compare designs with the literature's cams under the same limits",
        "camopt compare kodama --design runs/first --out runs/comparison",
    )
    _scene(c, default="kodama")
    c.add_argument(
        "--design", action="append", default=[], metavar="RUN", help="run folder, design or table; repeatable"
    )
    _table_options(c)
    c.add_argument(
        "--baselines",
        choices=("plain", "best"),
        default="plain",
        help="the literature's cams of largest area, or every family searched within the bounce limit, minutes (plain)",
    )
    words = "compare the designs alone"
    c.add_argument("--no-literature", dest="baselines", action="store_const", const="none", help=words)
    c.add_argument("--out", metavar="DIR", help="folder of the comparison (runs/<scene>-<UTC time>)")


def _cam(command: Command) -> None:
    c = command(
        "cam",
        "show a cam against the scene's limits, its contact with the follower, and write lift table and contour",
        "camopt cam kodama --cam polydyne --csv lift.csv",
    )
    _scene(c)
    _cam_options(c)
    c.add_argument("--speed", type=positive, metavar="RPM", help="with [geometry]: Hertz stress at crankshaft r/min")
    exchange_options(c)
    card_options(c)


def _modes(command: Command) -> None:
    c = command("modes", "natural frequencies and mode shapes", "camopt modes kodama --state seated")
    _scene(c)
    c.add_argument("--state", choices=("lifted", "seated"), default="lifted", help="valve off or on its seat (lifted)")
    c.add_argument("--json", metavar="FILE", help="write the modes as JSON")


def _bound(command: Command) -> None:
    c = command("bound", "how much area any cam can have within a scene's limits", "camopt bound kodama")
    _scene(c)
    c.add_argument("--json", metavar="FILE", help="write the bounds as JSON")


def _reduce(command: Command) -> None:
    c = command(
        "reduce",
        "smaller models of a scene, with what each gets wrong and saves",
        "camopt reduce kodama --speeds 5000 --tolerance-mm 0.02",
    )
    _scene(c)
    _cam_options(c, default="polydyne")
    c.add_argument("--speeds", type=speeds, metavar="LIST", help="5000,6000 or 300:8000:100 crankshaft r/min (listed)")
    c.add_argument(
        "--tolerance-mm", type=positive, default=0.01, metavar="MM", help="error of bounce, jump and lift (0.01)"
    )
    c.add_argument("--json", metavar="FILE", help="write every model's errors and times, and the proposed scene")


def _report(command: Command) -> None:
    c = command(
        "report",
        "write comparison, figures and page of a run folder again, or check every number that it states",
        "camopt report runs/first --check",
    )
    c.add_argument("run", metavar="RUN", help="run folder of `camopt optimize`")
    words = "write nothing: list stated numbers with their source, judge the cam anew, say what differs (exit code 3)"
    c.add_argument("--check", action="store_true", help=words)


def _yield(command: Command) -> None:
    c = command(
        "yield",
        "the share of trains as built, drawn within the scene's tolerances, that hold the limits on the motion",
        "camopt yield kodama --cam runs/first --trains 200",
    )
    _scene(c)
    _cam_options(c)
    c.add_argument("--trains", type=trains, default=1000, metavar="N", help="trains drawn (1000)")
    c.add_argument(
        "--speeds", type=speeds, metavar="LIST", help="5000,6000 or 300:8000:100 crankshaft r/min (11 over the band)"
    )
    c.add_argument("--seed", type=seed, default=0, metavar="N", help="seed of the draws (0)")
    words = "also what half of each tolerance would buy: the same trains once more for each of them"
    c.add_argument("--halve", action="store_true", help=words)
    c.add_argument("--json", metavar="FILE", help="write the share and what spoils it as JSON")
    c.add_argument("--out", metavar="DIR", help="folder, refused if it exists (runs/<scene>-<UTC time>)")
    c.add_argument(
        "--resume", action="store_true", help="go on in the folder named by --out, with more trains if asked"
    )


def _sweep(command: Command) -> None:
    c = command(
        "sweep",
        "compute many tasks, on all cores or on a cluster, with a row for each in a store that resumes",
        "camopt sweep plan.toml --store plan.sqlite --csv plan.csv",
    )
    c.epilog = f"{PLAN}\n\n{c.epilog}"
    c.add_argument("plan", metavar="PLAN", help="TOML file that says which tasks there are")
    c.add_argument("--store", metavar="FILE", required=True, help="SQLite file of the rows, refused if it exists")
    c.add_argument("--workers", type=count, metavar="N", help="worker processes (one for each core)")
    c.add_argument("--scheduler", metavar="ADDRESS", help="dask scheduler, tcp://HOST:PORT or tls://HOST:PORT")
    c.add_argument("--insecure", action="store_true", help="allow a scheduler beyond this machine without TLS")
    c.add_argument("--resume", action="store_true", help="go on in the store")
    c.add_argument("--retry-failed", action="store_true", help="with --resume: compute failed tasks once more")
    c.add_argument("--csv", metavar="FILE", help="write the rows as a table")


def _tradeoff(command: Command) -> None:
    c = command("tradeoff", "measure what accuracy costs on a scene: methods and job", "camopt tradeoff kodama")
    _scene(c)
    c.add_argument("--cam", metavar="CAM", help="the cam whose motions are measured (one that keeps its contacts)")
    _table_options(c)
    c.add_argument("--out", metavar="DIR", help="folder, refused if it exists (runs/<scene>-<UTC time>)")
    c.add_argument("--resume", action="store_true", help="go on in the folder named by --out")
    c.add_argument("--size", choices=("small", "full"), default="full", help="how many settings (full, minutes)")


def _extremes(command: Command) -> None:
    c = command(
        "extremes",
        "put every method to the extremes: no case may end in a wrong number without a warning",
        "camopt extremes motori-1 --out runs/extremes",
    )
    c.add_argument("scene", metavar="SCENE", nargs="?", help="built-in scene or TOML file (every built-in scene)")
    c.add_argument(
        "--out", metavar="DIR", help="folder of extremes.csv, refused if it exists (runs/<scene>-<UTC time>)"
    )
    c.add_argument("--resume", action="store_true", help="go on in the folder named by --out")


def _gradient(command: Command) -> None:
    c = command(
        "gradient",
        "may the gradient be trusted here: both paths against differences of the truth, metric by metric",
        "camopt gradient kodama --cam polydyne --speed 6000",
    )
    _scene(c)
    _cam_options(c)
    c.add_argument("--speed", type=positive, required=True, metavar="RPM", help="crankshaft r/min")
    c.add_argument("--json", metavar="FILE", help="write the comparison as JSON")


def _scenes(command: Command) -> None:
    c = command("scenes", "list the built-in scenes, or print one to edit", "camopt scenes kodama > mine.toml")
    c.add_argument("name", nargs="?", metavar="NAME", help="built-in scene to print")


def _scene(c: argparse.ArgumentParser, default: str | None = None) -> None:
    text = "built-in scene (`camopt scenes`) or TOML file"
    if default is None:
        c.add_argument("scene", metavar="SCENE", help=text)
    else:
        c.add_argument("scene", metavar="SCENE", nargs="?", default=default, help=f"{text} ({default})")


DESIGNING = (_optimize, _design, _verify, _simulate, _compare, _cam, _modes)
STUDYING = (
    _bound,
    rise_options,
    _yield,
    what_if_options,
    _sweep,
    _gradient,
    _tradeoff,
    _extremes,
    _reduce,
    _report,
    _scenes,
)
COMMANDS = (*DESIGNING, *STUDYING)
