"""Tries drawn mutants and prints how many were caught; it goes on where its journal stops.

`python -m tests.mutation --mutants 500 --journal mutants.jsonl` needs the extra `mutation`. The order is drawn from the
seed, so that more mutants are the same ones and further ones. `--minutes` ends it earlier.
"""

import argparse
import difflib
import json
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from tqdm import tqdm

from tests.mutation.mutants import ROOT, Mutant, mutants
from tests.mutation.trial import copied, outcome, prepared


def main() -> int:
    """0 where at least 95 in 100 were caught, else 3."""
    ask = argparse.ArgumentParser(prog="python -m tests.mutation", description=__doc__)
    ask.add_argument("--mutants", type=int, default=500)
    ask.add_argument("--seed", type=int, default=0)
    ask.add_argument("--journal", type=Path, required=True, help="one line of JSON for each mutant")
    ask.add_argument("--minutes", type=float, default=float("inf"))
    args = ask.parse_args()
    prepared()
    tried(args.journal, args.seed, args.mutants, time.monotonic() + 60 * args.minutes)
    found = rows(args.journal)[: args.mutants]
    print(table(found))
    return 0 if sum(row["outcome"] != "survived" for row in found) >= 0.95 * len(found) else 3


def rows(journal: Path) -> list[dict]:
    """What a journal says so far."""
    return [json.loads(line) for line in journal.read_text(encoding="utf-8").splitlines()] if journal.exists() else []


def tried(journal: Path, seed: int, wanted: int, end: float) -> None:
    """Tries mutants that the journal lacks, until it has so many or the clock [s] says `end`."""
    known = {row["mutant"] for row in rows(journal)}
    with tempfile.TemporaryDirectory() as folder, journal.open("a", encoding="utf-8") as lines:
        copy = copied(Path(folder))
        for mutant in tqdm(mutants(seed)[:wanted], disable=None):
            if time.monotonic() > end:
                return
            if mutant.key in known:
                continue
            changed = mutant.text()
            row = {"mutant": mutant.key, "outcome": outcome(mutant, changed, copy), "difference": diff(mutant, changed)}
            print(json.dumps(row), file=lines, flush=True)


def diff(mutant: Mutant, changed: str) -> str:
    """The lines that differ."""
    known = (ROOT / mutant.file).read_text(encoding="utf-8")
    lines = difflib.unified_diff(known.splitlines(), changed.splitlines(), n=0, lineterm="")
    return "\n".join(line for line in lines if line[:3] not in ("---", "+++"))


def table(found: list[dict]) -> str:
    """Counts by folder, and every survivor."""
    counts = Counter(("/".join(r["mutant"].split("/")[1:-1]), r["outcome"].split()[0]) for r in found)
    lines = [f"{folder:28s} {what:10s} {count:5d}" for (folder, what), count in sorted(counts.items())]
    left = [f"{r['mutant']}\n{r['difference']}" for r in found if r["outcome"] == "survived"]
    return "\n".join([*lines, *left, f"{len(found)} mutants, {len(found) - len(left)} caught"])


if __name__ == "__main__":
    sys.exit(main())
