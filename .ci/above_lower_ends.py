"""Prints which dependencies are installed above the lower ends of their ranges in pyproject.toml.

The oldest Python must have none, or a lower end promises what no test has seen; a new one may lack the old wheels.
"""

import re
import sys
import tomllib
from importlib.metadata import version
from itertools import chain
from pathlib import Path

from packaging.version import Version

project = tomllib.loads(Path(__file__).parents[1].joinpath("pyproject.toml").read_text(encoding="utf-8"))["project"]
above = []
for line in chain(project["dependencies"], project["optional-dependencies"]["test"]):
    name, least = re.findall(r"^([\w.-]+)(?:\[.*\])?[>=]=([\w.]+)", line)[0]
    if Version(version(name)) > Version(least):
        above.append(f"{name} {version(name)} above {least}")
print("\n".join(above))
oldest = project["requires-python"].removeprefix(">=") == "{}.{}".format(*sys.version_info)
sys.exit(1 if above and oldest else 0)
