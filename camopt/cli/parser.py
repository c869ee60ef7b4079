"""The command line: it parses the arguments, calls one verb of `camopt.cli.verbs`, and returns an exit code.

0: done and, if the result had to be confirmed, confirmed; 2: wrong use or bad input; 3: done, but not confirmed; 130:
interrupted; 1: a defect of camopt. Heavy modules are imported only after the arguments have been checked.
"""

import argparse
import errno
import gc
import os
import sys
import tomllib
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib import import_module
from io import TextIOWrapper
from keyword import iskeyword
from pathlib import Path
from typing import Any

from camopt import __version__
from camopt.cli import values
from camopt.cli.next_steps import left_behind, next_step
from camopt.memory import give_memory_back
from camopt.scene.errors import InputError, NoCamFound, brief, did_you_mean
from camopt.scene.text_file import excerpt
from camopt.storage import check_file
from camopt.verifier.methods import verdict_methods

TABLE = Path(__file__).with_name("commands.toml")
"""Every command with its purpose, its example and its arguments."""
DONE, DEFECT, BAD_INPUT, NOT_CONFIRMED, INTERRUPTED = 0, 1, 2, 3, 130
REFUSALS = (errno.ENOSPC, errno.EDQUOT, errno.EACCES, errno.EPERM, errno.EROFS, errno.EMFILE, errno.EIO)
"""Errors of the system for a full disk or a folder without write access, which are no defects of camopt."""
WRITTEN = ("json", "csv", "contour", "dxf", "figure", "valve_lift", "dynamic_lift", "card_csv", "store")
"""Options that name a file to write; `--out` names a folder, which each command checks together with its scene."""
READ = ("scene", "cam", "exhaust", "plan")
"""Options and arguments that may name a file to read, by their names in the parsed arguments."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command and returns its exit code; `--help`, `--version` and misspelt options exit directly."""
    for stream in (sys.stdout, sys.stderr):  # a file name may contain characters that the terminal cannot show
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    args = parser().parse_args(arguments)
    prepare_process()
    try:
        check_outputs(args)
        code = getattr(import_module("camopt.cli.verbs"), verb_named(args.command))(args)
        if sys.stdout is not None:  # None where the shell closed it
            sys.stdout.flush()
        if not args.quiet:
            print(f"next: {next_step(args, code)}", file=sys.stderr)
        return code
    except KeyboardInterrupt:
        remedy = "; --out with --resume continues" if hasattr(args, "resume") else ""
        print(f"camopt: interrupted{left_behind(args) or remedy}", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:  # the reader closed the pipe; the flush at exit must not fail
        assert sys.stdout is not None, "its pipe broke"
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return DONE
    except Exception as error:
        return _failed(error, args)


OBJECTS, YOUNG, MIDDLE = 20_000, 20, 100
"""Thresholds of Python's garbage collector: allocations between two collections of the youngest generation, and
collections of one generation per collection of the next. With Python's defaults, 700, 10 and 10, a draft of `kodama`
spends a thirtieth of its processor time there, mostly while it imports modules that stay in memory."""


def prepare_process() -> None:
    """Makes garbage collections rarer, and returns freed memory to the system."""
    gc.set_threshold(OBJECTS, YOUNG, MIDDLE)
    give_memory_back(one_heap=True)


def verb_named(command: str) -> str:
    """The name of a command's function in `camopt.cli.verbs`; a Python keyword gets an underscore."""
    return f"{command}_" if iskeyword(command) else command.replace("-", "_")


def check_outputs(args: argparse.Namespace) -> None:
    """Raises InputError for an output file that cannot be written, that is read too, or that two options name."""
    written: dict[str, str] = {}
    read = {name: path for name in READ if os.path.isfile(path := getattr(args, name, None) or "")}
    for option in WRITTEN:
        path = getattr(args, option, None)
        if path is None:
            continue
        check_file(path)
        is_device = os.path.exists(path) and not os.path.isfile(path)
        if not is_device and (first := written.setdefault(os.path.realpath(path), option)) != option:
            both = " and ".join(f"--{name.replace('_', '-')}" for name in (first, option))
            raise InputError(f"{both} name the same file, {path}, which holds one of them: name another file")
        for name, source in read.items():
            if os.path.exists(path) and os.path.samefile(path, source):
                raise InputError(
                    f"--{option.replace('_', '-')} {path}: this command reads that file as its {name}, and would "
                    f"overwrite it: name another file"
                )


def _failed(error: Exception, args: argparse.Namespace) -> int:
    if args.debug:
        traceback.print_exc()
    left = left_behind(args)
    if isinstance(error, InputError):
        print(f"camopt: {error}{left}", file=sys.stderr)
        return NOT_CONFIRMED if isinstance(error, NoCamFound) else BAD_INPUT
    if isinstance(error, OSError) and error.errno in REFUSALS:
        where = f"{error.filename}: " if error.filename else ""
        remedy = "free disk space or grant write access"
        print(f"camopt: {where}the system refuses ({error.strerror}): {remedy}{left}", file=sys.stderr)
        return BAD_INPUT
    kind = f"{type(error).__name__}: {brief(str(error))}" if str(error) else type(error).__name__
    remedy = "" if args.debug else "; --debug shows where"
    print(f"camopt: a defect of camopt, not of your input ({kind}){remedy}{left}", file=sys.stderr)
    return DEFECT


def parser() -> argparse.ArgumentParser:
    """Builds the parser of all commands from the table."""
    table = tomllib.loads(TABLE.read_text(encoding="utf-8"))
    formatted: dict[str, Any] = {"formatter_class": argparse.RawDescriptionHelpFormatter, "allow_abbrev": False}
    top = SuggestingParser(
        prog="camopt",
        description="Designs cams for valve trains that neither bounce nor jump; independent methods confirm it.",
        epilog="example: camopt optimize kodama --accuracy draft\n`camopt COMMAND --help` explains a command.",
        **formatted,
    )
    top.add_argument("--version", action="version", version=f"camopt {__version__}")
    commands = top.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name, entry in table["commands"].items():
        purpose = entry["purpose"]
        command = commands.add_parser(
            name,
            help=purpose,
            description=purpose[0].upper() + purpose[1:] + ".",
            epilog="\n\n".join([*([entry["notes"]] if "notes" in entry else []), f"example: {entry['example']}"]),
            **formatted,
        )
        command.add_argument("--debug", action="store_true", help="show the traceback of an error")
        command.add_argument("--quiet", action="store_true", help="no progress bar and no hint of what to do next")
        command.set_defaults(next=entry.get("next"))
        for argument, settings in _arguments(entry["arguments"], table["shared"]):
            command.add_argument(argument, **settings)
    top.verbs = list(commands.choices)
    return top


def _arguments(listed: Mapping[str, Any], shared: Mapping[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Names and argparse settings of a command's arguments; "shared" stands for a group of the shared ones."""
    for name, settings in listed.items():
        if settings == "shared":
            yield from _arguments(shared[name], shared)
            continue
        settings = settings | {"help": settings["help"].replace("%", "%%")}  # argparse formats help texts with %
        if "type" in settings:
            settings["type"] = getattr(values, settings["type"])
        if words := settings.pop("choices", None):  # an error of the type suggests a choice, argparse's does not
            choices = [w for c in words for w in (verdict_methods() if c == "METHODS" else (c,))]
            settings |= {"type": one_of(choices), "metavar": f"{{{','.join(choices)}}}"}
        yield name, settings


class SuggestingParser(argparse.ArgumentParser):
    """An argparse parser that reports unknown commands and options, with a suggestion, before missing ones."""

    verbs: Sequence[str] = ()
    """The names of the commands, in the top parser only."""

    def parse_known_args(self, args=None, namespace=None):  # pyright: ignore[reportIncompatibleMethodOverride]
        """As in argparse; the parser of every command calls it, too."""
        for word in sys.argv[1:] if args is None else args:
            name = word.partition("=")[0]
            if word == "--":
                break
            if word.startswith("--"):
                options = self._option_string_actions
                if name not in options:
                    self.error(f"no option {excerpt(name)}{did_you_mean(name, options)}")
            elif self.verbs and not word.startswith("-"):
                if word not in self.verbs:
                    expected = did_you_mean(word, self.verbs) or f": expected one of {', '.join(self.verbs)}"
                    self.error(f"no command {excerpt(word)}{expected}")
                break
        return super().parse_known_args(args, namespace)


def one_of(choices: Sequence[str]) -> Callable[[str], str]:
    """The argparse type of a word that must be one of the choices."""

    def word(text: str) -> str:
        if text not in choices:
            expected = f"{', '.join(choices[:-1])} or {choices[-1]}" if len(choices) > 1 else choices[0]
            raise argparse.ArgumentTypeError(f"{excerpt(text)}: expected {expected}{did_you_mean(text, choices)}")
        return text

    return word
