"""Commands of a page with the output that `python -m docs.record` recorded."""

import json
import re
from pathlib import Path

RECORDED = Path(__file__).parents[1] / "tutorials" / "recorded.json"
BLOCK = re.compile(r"^```\{generated\} terminal\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def terminal(content: str) -> str:
    """The commands of a block, one on each line, with their output."""
    printed = json.loads(RECORDED.read_text(encoding="utf-8"))["printed"]
    lines = [line for command in content.strip().splitlines() for line in (f"$ {command}", *printed[command]["output"])]
    return "```text\n" + "\n".join(lines) + "\n```"
