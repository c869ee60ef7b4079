"""The stored summary of the tried mutants: counts, and every survivor with its reason."""

import tomllib
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

from tests.mutation.mutants import Mutant, bare, mutants_with

STORED = Path(__file__).parents[1] / "data/mutants.json"
REASONS = Path(__file__).parent / "survivors.toml"
"""The known survivors with their reasons. The kind is `equivalent` (the same behaviour) or `harmless` (a different but
acceptable behaviour). A mutant is identified by file, operator and difference; if a file has the same lines several
times, `which` is the number of the occurrence, from 0."""


def reasons(file: Path = REASONS) -> dict[str, dict]:
    """The known survivors by the mutant's key in the current sources, without those whose lines no longer exist."""
    survivors = {}
    for entry in tomllib.loads(file.read_text(encoding="utf-8")).get("survivor", []):
        places, which = mutants_with(entry["file"], entry["operator"], entry["difference"]), entry.get("which", 0)
        if which < len(places):
            survivors[places[which].key] = entry | {"mutant": places[which]}
    return survivors


def summary(rows: dict[str, dict], drawn: Iterable[Mutant], seed: int, known: dict[str, dict]) -> dict:
    """Counts of the drawn mutants that were tried, in total and by folder, and the mutants that no test detected."""
    drawn = list(drawn)
    found = [rows[m.key] for m in drawn if m.key in rows]
    left = []
    for row in found:
        if row["outcome"] == "survived":
            why = known.get(row["mutant"], {})
            why = why if bare(why.get("difference", "")) == bare(row["difference"]) else {}
            kind, reason = why.get("kind", "survived"), why.get("reason", "")
            left.append({"mutant": row["mutant"], "difference": row["difference"], "kind": kind, "reason": reason})
    kinds = {one["mutant"]: one["kind"] for one in left}
    counts = Counter(
        (row["mutant"].split(":")[0].rsplit("/", 1)[0], kinds.get(row["mutant"], "caught")) for row in found
    )
    folders: dict[str, dict[str, int]] = {}
    for (folder, kind), count in sorted(counts.items()):
        folders.setdefault(folder, {})[kind] = count
    return {
        "command": f"python -m tests.mutation --seed {seed} --mutants {len(drawn)} --journal mutants.jsonl --store",
        "drawn": len(drawn),
        "tried": len(found),
        "caught": len(found) - len(left),
        "equivalent": sum(one["kind"] == "equivalent" for one in left),
        "seconds_mean": round(sum(row["seconds"] for row in found) / max(len(found), 1), 2),
        "folders": folders,
        "survivors": left,
    }


def table(content: dict) -> str:
    """A summary as text."""
    lines = [
        f"{folder:32s} {kind:10s} {n:4d}" for folder, kinds in content["folders"].items() for kind, n in kinds.items()
    ]
    for survivor in content["survivors"]:
        lines += [f"{survivor['mutant']}: {survivor['kind']} {survivor['reason']}".rstrip(), survivor["difference"]]
    counts = f"{content['tried']} of {content['drawn']} mutants tried, {content['caught']} caught"
    return "\n".join([*lines, f"{counts}, {content['equivalent']} equivalent, {content['seconds_mean']} s each"])
