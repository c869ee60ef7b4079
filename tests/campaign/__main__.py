"""Runs the robustness tests at any size and prints a table of the outcomes.

`python -m tests.campaign inputs --cases 100000` runs numbered hostile inputs, `kills --cases 200` kills and resumes
commands that write files, `soak --cases 10000` computes that many verdicts in one process, and
`messages --cases 20000` sends hostile messages to the designer's server.
"""

import argparse
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from tqdm import tqdm

from camopt.storage import write_json
from tests.campaign import fuzz, messages
from tests.campaign.kills import COMMANDS, killings
from tests.campaign.soak import grown, soaked

SHOWN = 20
"""Largest number of faults that are printed; `--json` stores all of them."""


def main() -> int:
    """Exit code: 0 if there was no fault, else 3."""
    arguments = argparse.ArgumentParser(prog="python -m tests.campaign", description=__doc__)
    arguments.add_argument("part", choices=tuple(PARTS))
    arguments.add_argument("--cases", type=int, default=1000)
    arguments.add_argument("--seed", type=int, default=0, help="number of the first case")
    arguments.add_argument("--workers", type=int, default=2)
    arguments.add_argument("--json", type=Path, help="write what was wrong")
    args = arguments.parse_args()
    rows = list(tqdm(PARTS[args.part](args), disable=None))
    for (kind, ended), count in sorted(Counter((row["kind"], row["wrong"] or row["ended"]) for row in rows).items()):
        print(f"{kind:10s} {ended:40s} {count:7d}")
    wrong = [row for row in rows if row["wrong"]]
    print(f"{len(rows)} cases, {len(wrong)} wrong", *wrong[:SHOWN], sep="\n")
    if args.json:
        write_json(args.json, wrong)
    return 3 if wrong else 0


def inputs(args: argparse.Namespace) -> list[dict]:
    return fuzz.outcomes(range(args.seed, args.seed + args.cases), args.workers, progress=True)


def kills(args: argparse.Namespace) -> Iterator[dict]:
    """The kills are distributed evenly over the commands."""
    with tempfile.TemporaryDirectory() as folder:
        for number, name in enumerate(COMMANDS):
            share = args.cases // len(COMMANDS) + (number < args.cases % len(COMMANDS))
            yield from killings(name, Path(folder), share, args.seed)


def soak(args: argparse.Namespace) -> Iterator[dict]:
    """The resources of the process after each tenth of the verdicts; growth after the first tenth is a fault."""
    first = None
    for held in soaked(args.cases, max(args.cases // 10, 1)):
        first = first or held
        yield {"kind": "soak", "ended": str(held), "wrong": f"grown: {held}" if grown(first, held) else ""}


def asked(args: argparse.Namespace) -> Iterator[dict]:
    return messages.outcomes(range(args.seed, args.seed + args.cases))


PARTS: dict[str, Callable[[argparse.Namespace], Iterable[dict]]] = {
    "inputs": inputs,
    "kills": kills,
    "soak": soak,
    "messages": asked,
}

if __name__ == "__main__":
    sys.exit(main())
