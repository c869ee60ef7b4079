"""The command line: it parses, calls one verb of `camopt.cli.verbs`, and turns what happened into an exit code.

0 done and, where something was to be confirmed, confirmed; 2 wrong use or bad input; 3 ran, but not confirmed;
130 interrupted; 1 a defect of camopt. Nothing heavy is imported before the arguments are known to be usable.
"""

import argparse
import errno
import os
import sys
import traceback
from collections.abc import Sequence
from importlib import import_module
from io import TextIOWrapper
from keyword import iskeyword

from camopt import __version__
from camopt.cli import options
from camopt.cli.collecting import collecting_rarely
from camopt.cli.next_steps import left_behind, next_step
from camopt.cli.outputs import check_outputs
from camopt.cli.suggesting_parser import SuggestingParser

DONE, DEFECT, BAD_INPUT, NOT_CONFIRMED, INTERRUPTED = 0, 1, 2, 3, 130
REFUSALS = (errno.ENOSPC, errno.EDQUOT, errno.EACCES, errno.EPERM, errno.EROFS, errno.EMFILE, errno.EIO)
"""What the system answers where a disk is full or a folder may not be written to: no defect of camopt."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command and returns its exit code; `--help`, `--version` and misspelt options exit on their own."""
    for stream in (sys.stdout, sys.stderr):  # a file's name may hold what the terminal cannot show
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    args = parser().parse_args(arguments)
    try:
        check_outputs(args)
        with collecting_rarely():
            commands = import_module("camopt.cli.verbs")
            code = getattr(commands, verb_named(args.command))(args)
        if sys.stdout is not None:  # where a shell closed it, there is none
            sys.stdout.flush()
        if not args.quiet:
            print(f"next: {next_step(args, code)}", file=sys.stderr)
        return code
    except KeyboardInterrupt:
        remedy = "; --out with --resume continues" if hasattr(args, "resume") else ""
        print(f"camopt: interrupted{left_behind(args) or remedy}", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:  # the reader of a pipe has seen enough; the flush at exit must not fail on it
        assert sys.stdout is not None, "its pipe broke"
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return DONE
    except Exception as error:
        return _failed(error, args)


def verb_named(command: str) -> str:
    """The function in `camopt.cli.verbs` of a command; one that is a word of Python has an underscore behind it."""
    return f"{command}_" if iskeyword(command) else command.replace("-", "_")


def _failed(error: Exception, args: argparse.Namespace) -> int:
    from camopt.scene.errors import InputError, NoCamFound, brief

    if args.debug:
        traceback.print_exc()
    left = left_behind(args)
    if isinstance(error, InputError):
        print(f"camopt: {error}{left}", file=sys.stderr)
        return NOT_CONFIRMED if isinstance(error, NoCamFound) else BAD_INPUT
    if isinstance(error, OSError) and error.errno in REFUSALS:
        where = f"{error.filename}: " if error.filename else ""
        print(f"camopt: {where}the system refuses ({error.strerror}): give it room or rights{left}", file=sys.stderr)
        return BAD_INPUT
    kind = f"{type(error).__name__}: {brief(str(error))}" if str(error) else type(error).__name__
    remedy = "" if args.debug else "; --debug shows where"
    print(f"camopt: a defect of camopt, not of your input ({kind}){remedy}{left}", file=sys.stderr)
    return DEFECT


def parser() -> argparse.ArgumentParser:
    """The parser of all commands."""
    top = SuggestingParser(
        prog="camopt",
        description="Designs cams for valve trains that neither bounce nor jump; independent methods confirm it.",
        epilog="example: camopt optimize kodama --accuracy draft\n`camopt COMMAND --help` explains a command.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    top.add_argument("--version", action="version", version=f"camopt {__version__}")
    commands = top.add_subparsers(dest="command", metavar="COMMAND", required=True)

    def command(name: str, purpose: str, example: str) -> argparse.ArgumentParser:
        one = commands.add_parser(
            name,
            help=purpose,
            description=purpose[0].upper() + purpose[1:] + ".",
            epilog=f"example: {example}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
            allow_abbrev=False,
        )
        one.add_argument("--debug", action="store_true", help="show the traceback of an error")
        one.add_argument("--quiet", action="store_true", help="no progress bar and no hint of what to do next")
        return one

    for add in options.COMMANDS:
        add(command)
    top.verbs = list(commands.choices)
    return top
