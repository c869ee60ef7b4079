"""Prints the lower ends of the ranges in pyproject.toml as constraints."""

import re
import tomllib
from itertools import chain
from pathlib import Path

project = tomllib.loads(Path(__file__).parents[1].joinpath("pyproject.toml").read_text(encoding="utf-8"))["project"]
for line in chain(project["dependencies"], project["optional-dependencies"]["test"]):
    print(re.sub(r"^([\w.-]+)(\[.*\])?[>=]=([\w.]+).*$", r"\1==\3", line))
