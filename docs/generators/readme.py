"""The table of the README, which Sphinx does not fill in: `python -m docs.generators.readme` writes it there."""

import re
from pathlib import Path

from docs.generators.tables import rows_table

README = Path(__file__).parents[2] / "README.md"
TABLE = """
of = "real_trains"
columns = [
    ["train", "'`' + key + '`' | s"],
    ["area ratio, confirmed", "row.area_ratio | .4f"],
    ["certified bound", "row.bound | .4f"],
]
"""
BLOCK = re.compile(r"(<!-- generated -->\n).*?(?=<!-- end -->)", re.DOTALL)
"""The text between two HTML comments, which a reader does not see."""


def with_table(text: str) -> str:
    """The README with its table generated from the stored results."""
    return BLOCK.sub(lambda block: f"{block[1]}\n{rows_table(TABLE)}\n", text)


if __name__ == "__main__":
    README.write_text(with_table(README.read_text(encoding="utf-8")), encoding="utf-8")
