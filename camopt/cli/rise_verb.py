"""The verb `rise` of the command line, and its options: a motion between two dwells."""

import argparse
from collections.abc import Callable

from camopt.cli.values import positive
from camopt.scene.errors import InputError
from camopt.storage import write_csv, write_json

ORDERS = {"acceleration": 2, "jerk": 3, "snap": 4, "crackle": 5}


def rise(args: argparse.Namespace) -> int:
    """Prints the least peak and the bound, and writes the motion."""
    from camopt.study.rise import rise as least_rise

    if args.least and args.jerk_max_mm_per_deg3:
        raise InputError("--jerk-max-mm-per-deg3: what is least is then the acceleration: leave --least out")
    order = ORDERS[args.least or "jerk"]
    found = least_rise(args.rise_mm, args.over_deg, order, args.jerk_max_mm_per_deg3)
    if args.json:
        write_json(args.json, found.as_dict())
    if args.csv:
        write_csv(args.csv, found.table(args.step_deg))
    print(found)
    return 0


def rise_options(command: Callable[[str, str, str], argparse.ArgumentParser]) -> None:
    c = command(
        "rise",
        "a rise between two dwells with the least peak of a derivative, beside a bound that no motion is below",
        "camopt rise --rise-mm 10 --over-deg 60 --jerk-max-mm-per-deg3 0.003 --csv rise.csv",
    )
    c.add_argument("--rise-mm", type=positive, required=True, metavar="MM", help="how far the follower rises")
    c.add_argument("--over-deg", type=positive, required=True, metavar="DEG", help="cam degrees of the rise")
    c.add_argument("--least", choices=tuple(ORDERS), help="derivative of least peak (jerk)")
    words = "the least acceleration under this largest jerk, in place of --least"
    c.add_argument("--jerk-max-mm-per-deg3", type=positive, metavar="J", help=words)
    c.add_argument("--step-deg", type=positive, default=0.1, metavar="DEG", help="step of the table (0.1)")
    c.add_argument("--csv", metavar="FILE", help="write lift, velocity, acceleration and jerk by cam angle")
    c.add_argument("--json", metavar="FILE", help="write peak and bound")
