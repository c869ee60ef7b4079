"""The files that a command is to write: each can be written, and none is a file that the command reads."""

import os
from argparse import Namespace

from camopt.scene.errors import InputError
from camopt.storage import check_file

WRITTEN = ("json", "csv", "contour", "dxf", "figure", "valve_lift", "dynamic_lift", "card_csv", "store")
"""Options that name a file which a command writes; `--out` names a folder, which each command checks with its scene."""
READ = ("scene", "cam", "exhaust", "plan")
"""Options and arguments that may name a file, as a parsed command has them."""


def check_outputs(args: Namespace) -> None:
    """Raises InputError for a file that cannot be written, and for one that the command reads: it would be lost."""
    read = {name: path for name in READ if os.path.isfile(path := getattr(args, name, None) or "")}
    for option in WRITTEN:
        path = getattr(args, option, None)
        if path is None:
            continue
        check_file(path)
        for name, source in read.items():
            if os.path.exists(path) and os.path.samefile(path, source):
                raise InputError(
                    f"--{option.replace('_', '-')} {path}: this command reads that file as its {name}, and would "
                    f"overwrite it: name another file"
                )
