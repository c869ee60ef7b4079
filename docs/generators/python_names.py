"""The public names of camopt with their signatures and docstrings, as objects that Sphinx can link and index."""

import inspect
import re
from textwrap import dedent

import camopt


def python_names(content: str) -> str:
    """An entry for each name of the block's content, or for every public name where it is empty."""
    return "\n".join(_entry(name) for name in content.split() or camopt.__all__)


def _entry(name: str) -> str:
    what = getattr(camopt, name)
    kind = "class" if inspect.isclass(what) else "function"
    return f"````{{py:{kind}}} camopt.{name}{_signature(what)}\n{_body(what)}\n````\n"


def _signature(what) -> str:
    """Parameters and defaults; the docstring describes the types."""
    bare = [p.replace(annotation=inspect.Parameter.empty) for p in inspect.signature(what).parameters.values()]
    text = str(inspect.Signature(bare))
    return re.sub(r"<function .*? at 0x[0-9a-f]+>", "<function>", text)


def _body(what) -> str:
    return _markdown(inspect.getdoc(what) or "")


def _markdown(text: str) -> str:
    """A docstring as Markdown: sentences unchanged, indented blocks as code."""

    def fenced(block: re.Match) -> str:
        return f"\n```text\n{dedent(block[1]).strip()}\n```\n"

    return re.sub(r"\n((?: {4}.*\n|\n+(?= {4}))+)", fenced, f"{text}\n")
