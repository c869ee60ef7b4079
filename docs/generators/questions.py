"""The questions of the experiments, read from their pages."""

import re
from pathlib import Path

from docs.generators.tables import markdown

PAGES = Path(__file__).parents[1] / "results"


def questions(content: str) -> str:
    """A table of pages with title and question; the block's content names the experiments."""
    return markdown(("experiment", "question"), [_row(name) for name in content.split()])


def _row(name: str) -> tuple[str, str]:
    title, question = re.split(r"\n\n", (PAGES / f"{name}.md").read_text(encoding="utf-8"), maxsplit=2)[:2]
    return f"[{title.removeprefix('# ')}]({name}.md)", " ".join(question.strip("*").split())
