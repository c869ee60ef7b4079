"""The notebooks of the repository, plain percent scripts, as Sphinx reads them."""

import re

import jupytext


def notebook(text: str):
    """A percent script as a notebook of Python, with its links to pages as they are within the site."""
    found = jupytext.reads(re.sub(r"\]\(\.\./docs/", "](../", text), fmt="py:percent")
    found.metadata["kernelspec"] = {"name": "python3", "display_name": "Python 3", "language": "python"}
    found.metadata["language_info"] = {"name": "python", "pygments_lexer": "ipython3"}
    return found
