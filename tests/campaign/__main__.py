"""The campaign at any size, with a table of what came of it.

`python -m tests.campaign inputs --cases 100000` runs hostile inputs by number, `kills --cases 200` kills commands that
write, in turn, and lets them go on, `soak --cases 10000` gives that many verdicts in one process, and
`messages --cases 20000` sends hostile messages to the designer's server.
"""

import argparse
import sys
import tempfile
from collections import Counter
from pathlib import Path

from tqdm import tqdm

from camopt.storage import write_json
from tests.campaign import messages
from tests.campaign.fuzz import outcomes, table
from tests.campaign.kills import COMMANDS, killings
from tests.campaign.soak import grown, soaked


def main() -> int:
    """0 where nothing was wrong, else 3."""
    ask = argparse.ArgumentParser(prog="python -m tests.campaign", description=__doc__)
    ask.add_argument("part", choices=tuple(PARTS))
    ask.add_argument("--cases", type=int, default=1000)
    ask.add_argument("--seed", type=int, default=0, help="number of the first case")
    ask.add_argument("--workers", type=int, default=2)
    ask.add_argument("--json", type=Path, help="write what was wrong")
    args = ask.parse_args()
    wrong = PARTS[args.part](args)
    if args.json:
        write_json(args.json, wrong)
    return 3 if wrong else 0


def inputs(args: argparse.Namespace) -> list[dict]:
    """The cases that ended wrongly."""
    cases = range(args.seed, args.seed + args.cases)
    found = []
    for one in tqdm(outcomes(cases, args.workers), total=args.cases, disable=None):
        found.append(one)
        if one["wrong"]:
            parts = (one["seed"], one["kind"], one["wrong"], " ".join(one["words"]), one.get("said", ""))
            tqdm.write(" | ".join(map(str, parts)))
    print(table(found))
    return [f for f in found if f["wrong"]]


def kills(args: argparse.Namespace) -> list[dict]:
    """The kills after which something was torn or came out differently; the commands share them evenly."""
    found = []
    with tempfile.TemporaryDirectory() as folder, tqdm(total=args.cases, disable=None) as progress:
        for number, name in enumerate(COMMANDS):
            share = args.cases // len(COMMANDS) + (number < args.cases % len(COMMANDS))
            for kill in killings(name, Path(folder), share, args.seed):
                found.append(kill)
                progress.update()
    counts = Counter((kill["command"], "wrong" if kill["wrong"] else "the same") for kill in found)
    for (name, what), count in sorted(counts.items()):
        print(f"{name:10s} {what:10s} {count:5d}")
    wrong = [kill for kill in found if kill["wrong"]]
    for kill in wrong[:20]:
        print(kill)
    return wrong


def soak(args: argparse.Namespace) -> list[dict]:
    """What the process held at its end, where that is more than a tenth over what it held after a tenth of its way."""
    found = list(tqdm(soaked(args.cases, max(args.cases // 10, 1)), total=10, disable=None))
    for one in found:
        print(one)
    return [found[-1]] if grown(found[0], found[-1]) else []


def asked(args: argparse.Namespace) -> list[dict]:
    """The messages to the designer that got no answer or a wrong one."""
    found = list(tqdm(messages.outcomes(range(args.seed, args.seed + args.cases)), total=args.cases, disable=None))
    for status, count in sorted(Counter(one["status"] for one in found).items()):
        print(f"status {status} {count:7d}")
    wrong = [one for one in found if one["wrong"]]
    for one in wrong[:20]:
        print(one)
    return wrong


PARTS = {"inputs": inputs, "kills": kills, "soak": soak, "messages": asked}

if __name__ == "__main__":
    sys.exit(main())
