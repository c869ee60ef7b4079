"""The reference of the commands, generated from the parser."""

import argparse
import re

from camopt.cli.parser import parser


def commands(content: str) -> str:
    """A section for each command: purpose, usage, a table of arguments, example."""
    top = parser()
    (choices,) = [a for a in top._actions if isinstance(a, argparse._SubParsersAction)]
    return "\n".join(_section(name, verb) for name, verb in choices.choices.items())


def _section(name: str, verb: argparse.ArgumentParser) -> str:
    formatter = argparse.HelpFormatter(prog=verb.prog, width=100)
    formatter.add_usage(verb.usage, verb._actions, verb._mutually_exclusive_groups, prefix="")
    rows = [f"| {_called(a)} | {_text(a.help)} |" for a in verb._actions if a.dest not in ("help", "debug", "quiet")]
    note, _, example = (verb.epilog or "").rpartition("example: ")
    plan = f"```text\n{note.strip()}\n```\n" if note.strip() else ""
    return (
        f"(command-{name})=\n## `camopt {name}`\n\n{_text(verb.description)}\n\n"
        f"```text\n{formatter.format_help().strip()}\n```\n\n"
        + ("| argument | meaning |\n|---|---|\n" + "\n".join(rows) + "\n\n" if rows else "")
        + f"{plan}\nExample: `{example.strip()}`\n"
    )


def _called(action: argparse.Action) -> str:
    metavar = action.metavar if isinstance(action.metavar, str) else None
    if not action.option_strings:
        return f"`{metavar or action.dest}`"
    value = metavar or ("\\|".join(map(str, action.choices)) if action.choices else "")
    return ", ".join(
        f"`{option}{' ' + value if value and action.nargs != 0 else ''}`" for option in action.option_strings
    )


def _text(words: str | None) -> str:
    """A help text as one line of Markdown, with characters that are special in tables or HTML escaped."""
    line = re.sub(r"\s+", " ", words or "").replace("%%", "%").replace("|", "\\|")
    line = re.sub(r"(?<![\w`-])(--[a-z][a-z-]*)", r"`\1`", line)
    return re.sub(r"(?<![`<])([\w/.-]*(?:<[^>`]+>[\w/.-]*)+)(?!`)", r"`\1`", line)
