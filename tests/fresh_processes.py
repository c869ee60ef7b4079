"""Runs each of several Python snippets in its own process, forked from a parent that has loaded the libraries."""

import json
import subprocess
import sys
from typing import NamedTuple

LIBRARIES = ("numpy", "scipy.optimize", "numba", "pandas", "xarray", "pydantic", "matplotlib.figure")
"""Libraries that take long to import and are not tested; each snippet imports `camopt` itself again."""
PARENT = """
import json, os, sys, traceback
libraries, snippets = json.load(sys.stdin)
for library in libraries:
    __import__(library)
assert not [name for name in sys.modules if name.partition(".")[0] == "camopt"]
codes = {}
for name, snippet in snippets.items():
    child = os.fork()
    if child == 0:
        code = 1
        try:
            os.dup2(2, 1)
            exec(snippet, {"__name__": "__main__"})
            code = 0
        except BaseException:
            traceback.print_exc()
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(code)
    codes[name] = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
print(json.dumps(codes))
"""


class Ended(NamedTuple):
    """Exit codes and messages of the snippets."""

    codes: dict[str, int]  # 0 if nothing was raised
    said: str  # output of all snippets, for the message of an assertion


def run_each(snippets: dict[str, str], libraries: tuple[str, ...] = LIBRARIES) -> Ended:
    """Runs every snippet in a fork of a new process that has imported the libraries and nothing of camopt."""
    words = [sys.executable, "-W", "ignore", "-c", PARENT]
    done = subprocess.run(
        words, input=json.dumps([libraries, snippets]), capture_output=True, text=True, timeout=280, check=False
    )
    assert done.returncode == 0, done.stderr
    return Ended(json.loads(done.stdout), done.stderr)
