"""Where a result comes from: the command, the versions, the machine, the date."""

import platform
import time
from importlib.metadata import version
from pathlib import Path

PACKAGES = ("camopt", "numpy", "scipy", "numba", "jax")


def provenance(script: str, size: str) -> dict:
    """What a results file says of its origin."""
    return {
        "command": f"python -m experiments.{Path(script).stem} {size}",
        "versions": {name: version(name) for name in PACKAGES} | {"python": platform.python_version()},
        "machine": platform.machine(),
        "date_utc": time.strftime("%Y-%m-%d", time.gmtime()),
    }
