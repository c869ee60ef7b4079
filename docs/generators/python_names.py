"""The public names of camopt with their signatures and docstrings, as objects that Sphinx can link and index."""

import inspect
import re

import camopt


def python_names(content: str) -> str:
    """An entry for each name of the block's content, or for every public name where it is empty."""
    return "\n".join(_entry(name) for name in content.split() or camopt.__all__)


def _entry(name: str) -> str:
    what = getattr(camopt, name)
    kind = "class" if inspect.isclass(what) else "function"
    return f"````{{py:{kind}}} camopt.{name}{_signature(what)}\n{_body(what)}\n````\n"


def _signature(what) -> str:
    """Parameters and defaults; types stand in the words below."""
    bare = [p.replace(annotation=inspect.Parameter.empty) for p in inspect.signature(what).parameters.values()]
    text = str(inspect.Signature(bare))
    return re.sub(r"<function .*?>", "<function>", text)


def _body(what) -> str:
    """A docstring as Markdown: sentences as they stand, its indented blocks as code."""
    text = inspect.getdoc(what) or ""
    return re.sub(
        r"(?:^ {4}.*\n?)+", lambda block: f"```text\n{inspect.cleandoc(block[0])}\n```\n", text, flags=re.MULTILINE
    )
