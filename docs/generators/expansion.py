"""The text of a page with its numbers and generated blocks filled in."""

import re
from collections.abc import Callable

from docs.generators.claims import claims
from docs.generators.commands import commands
from docs.generators.python_names import python_names
from docs.generators.questions import questions
from docs.generators.results import filled_numbers
from docs.generators.scene_keys import scene_keys
from docs.generators.source import source
from docs.generators.tables import origin, result_table, rows_table
from docs.generators.terminal import terminal

KINDS: dict[str, Callable[[str], str]] = {
    "claims": claims,
    "commands": commands,
    "origin": origin,
    "python": python_names,
    "questions": questions,
    "scene-keys": scene_keys,
    "result-table": result_table,
    "rows": rows_table,
    "source": source,
    "terminal": terminal,
}
"""Kind of a generated block -> the function that makes Markdown from its content."""
BLOCK = re.compile(r"^```\{generated\} ([\w-]+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def expanded(text: str) -> str:
    """A page's Markdown with every generated block and number filled in; KeyError or NameError for unknown ones."""
    return filled_numbers(BLOCK.sub(lambda block: KINDS[block[1]](block[2]), text))
