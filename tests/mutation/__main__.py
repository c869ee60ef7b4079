"""Tries random mutants and prints how many were caught; an existing journal is continued.

`python -m tests.mutation --mutants 500 --journal mutants.jsonl` needs the extra `mutation`. The order is drawn from the
seed, so that a larger number includes the smaller one. `--minutes` limits the time, `--again` repeats the mutants that
survived, and `--survivors` only tries those with a stored reason (`survivors.toml`). The lines that each test runs are
determined first and stored beside the journal (`mutants.map.jsonl`): remove that file after a change of tests or
sources. `--store` writes a summary of the outcomes (`tests.mutation.summary`).
"""

import argparse
import json
import sys
import tempfile
import time
from functools import partial
from pathlib import Path

from tqdm import tqdm

from camopt.storage import write_json
from tests.mutation.choice import Choice
from tests.mutation.mutants import Mutant, difference, mutants
from tests.mutation.summary import STORED, reasons, summary, table
from tests.mutation.trial import copied, outcome, prepared, warmed, watched


def main() -> int:
    """Exit code: 0 if at least 95 % of the mutants that are not equivalent were caught or for --survivors, else 3."""
    ask = argparse.ArgumentParser(prog="python -m tests.mutation", description=__doc__)
    ask.add_argument("--mutants", type=int, default=500)
    ask.add_argument("--seed", type=int, default=0)
    ask.add_argument("--journal", type=Path, required=True, help="one line of JSON for each mutant")
    ask.add_argument("--minutes", type=float, default=float("inf"))
    ask.add_argument("--again", action="store_true", help="ask those that survived once more")
    ask.add_argument("--survivors", action="store_true", help="try those whose reasons are kept")
    ask.add_argument("--store", action="store_true", help=f"write {STORED.name}")
    args = ask.parse_args()
    known = reasons()
    drawn = [one["mutant"] for one in known.values()] if args.survivors else mutants(args.seed)[: args.mutants]
    if args.minutes > 0:
        prepared()
        tried(args.journal, drawn, time.monotonic() + 60 * args.minutes, args.again)
    found = summary(rows(args.journal), drawn, args.seed, known)
    print(table(found))
    if args.survivors:
        return 0
    if args.store:
        write_json(STORED, found)
    return 0 if found["caught"] >= 0.95 * (found["tried"] - found["equivalent"]) else 3


def rows(journal: Path) -> dict[str, dict]:
    """The rows of a journal by mutant; the last row of a mutant is used."""
    lines = journal.read_text(encoding="utf-8").splitlines() if journal.exists() else []
    return {row["mutant"]: row for row in map(json.loads, lines)}


def tried(journal: Path, drawn: list[Mutant], end: float, again: bool) -> None:
    """Tries the mutants that are not in the journal, until all are tried or the monotonic clock reaches `end` [s]."""
    known = {key for key, row in rows(journal).items() if not (again and row["outcome"] == "survived")}
    with tempfile.TemporaryDirectory() as folder, journal.open("a", encoding="utf-8") as lines:
        copy = copied(Path(folder))
        warmed(copy)
        choice = Choice(journal.with_suffix(".map.jsonl"), partial(watched, copy))
        for mutant in tqdm([m for m in drawn if m.key not in known], disable=None):
            if time.monotonic() > end:
                return
            print(json.dumps(row(mutant, choice, copy)), file=lines, flush=True)


def row(mutant: Mutant, choice: Choice, copy: Path) -> dict:
    """The journal row of one mutant: its outcome, processor time [s] of the trial, and the lines that differ."""
    changed = mutant.text()
    said, lines = difference(mutant, changed)
    found, spent = outcome(mutant.file, changed, choice.stages(mutant.file, lines), copy)
    return {"mutant": mutant.key, "outcome": found, "seconds": round(spent, 2), "difference": said}


if __name__ == "__main__":
    sys.exit(main())
