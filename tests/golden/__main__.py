"""Writes the stored answers anew: `python -m tests.golden [NAME]...`, after a change that is meant.

Without a name it writes those of all commands, which takes some minutes.
"""

import sys
import tempfile
import time
from pathlib import Path

from tests.golden.commands import HERE, LONG, QUICK, answer

for name in sys.argv[1:] or (QUICK | LONG):
    start = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        (HERE / f"{name}.txt").write_text(answer((QUICK | LONG)[name], Path(folder)), encoding="utf-8")
    print(f"{name:<28} {time.monotonic() - start:6.1f} s", flush=True)
