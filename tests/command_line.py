"""Runs commands of camopt within the process of a test, and reads what they left in a folder."""

from pathlib import Path

from camopt.cli import parser

VERBS = (
    "optimize design verify simulate compare cam modes bound rise yield what-if sweep gradient tradeoff extremes "
    "reduce report scenes"
).split()


def run(capsys, *words: str) -> tuple[int, str, str]:
    """Exit code, stdout and stderr of one command, also if argparse exits."""
    try:
        code = parser.main(words)
    except SystemExit as stop:
        code = stop.code
    out = capsys.readouterr()
    return code, out.out, out.err


def refused(capsys, *words: str) -> str:
    """The stderr of a command that must end with exit code 2, without other output and not as an internal error."""
    code, out, err = run(capsys, *words)
    assert (code, out) == (2, "") and "Traceback" not in err and "a defect of camopt" not in err
    return err


def contents(folder: Path) -> dict[str, bytes]:
    """The bytes of every file below a folder, by relative path."""
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}
