"""What came of the mutants that were tried, as it is stored: counts, and every survivor with its reason."""

import tomllib
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

from tests.mutation.mutants import Mutant

STORED = Path(__file__).parents[1] / "data/mutants.json"
REASONS = Path(__file__).parent / "survivors.toml"
"""What is known of survivors: kind `equivalent`, the same behaviour, or `harmless`, another that no one would call
wrong, with the reason. The lines that differ tell a mutant from another one of its name after a change of its file."""


def reasons(file: Path = REASONS) -> dict[tuple[str, str], dict]:
    """What is known of survivors, by name and lines that differ."""
    found = tomllib.loads(file.read_text(encoding="utf-8")).get("survivor", [])
    return {(one["mutant"], _bare(one["difference"])): one for one in found}


def summary(rows: dict[str, dict], drawn: Iterable[Mutant], seed: int, known: dict | None = None) -> dict:
    """Counts of the drawn mutants that were tried, by folder too, and those that no test noticed."""
    drawn, known = list(drawn), reasons() if known is None else known
    found = [rows[m.key] for m in drawn if m.key in rows]
    left = []
    for row in found:
        if row["outcome"] == "survived":
            why = known.get((row["mutant"], _bare(row["difference"])), {})
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


def table(found: dict) -> str:
    """A summary as lines."""
    lines = [
        f"{folder:32s} {kind:10s} {n:4d}" for folder, kinds in found["folders"].items() for kind, n in kinds.items()
    ]
    for one in found["survivors"]:
        lines += [f"{one['mutant']}: {one['kind']} {one['reason']}".rstrip(), one["difference"]]
    counts = f"{found['tried']} of {found['drawn']} mutants tried, {found['caught']} caught"
    return "\n".join([*lines, f"{counts}, {found['equivalent']} equivalent, {found['seconds_mean']} s each"])


def _bare(difference: str) -> str:
    """The lines that differ without their numbers, which move."""
    return "\n".join(line for line in difference.splitlines() if not line.startswith("@@"))
