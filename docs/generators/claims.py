"""The claims of `docs/claims.toml` as Markdown, with command, date and machine."""

import tomllib
from pathlib import Path

from docs.generators.tables import provenance

CLAIMS = Path(__file__).parents[1] / "claims.toml"


def stored_claims() -> list[dict]:
    """The claims: `group`, `title`, `measured` (Markdown, numbers by `{number}`), `commands`, and their `results`."""
    return tomllib.loads(CLAIMS.read_text(encoding="utf-8"))["claim"]


def claims(content: str) -> str:
    """An entry for each claim, or for each claim of the group that the block's content names."""
    group = content.strip()
    return "\n".join(_entry(claim) for claim in stored_claims() if group in ("", claim["group"]))


def _entry(claim: dict) -> str:
    commands = "\n".join(f"    {command}" for command in claim["commands"])
    origins = [provenance(name) for name in claim.get("results", [])]
    when = ", ".join(sorted({f"{o['date_utc']} on {o['machine']}" for o in origins}))
    measured = f"\nMeasured {when}.\n" if when else ""
    return f"### {claim['title']}\n\n{claim['measured'].strip()}\n{measured}\n{commands}\n"
