"""Compiled functions run by Python, where a test can give them anything, and reach those that only they call.

Those that only compiled code calls have no entry for Python, so that what calls them must be run by Python too.
"""

import sys

from numba.core.dispatcher import Dispatcher


def interpret(monkeypatch, *modules: str) -> None:
    """Has Python run all functions that stand in loaded modules whose names begin so, wherever they come from."""
    for name, module in list(sys.modules.items()):
        if name.startswith(modules):
            for own, value in list(vars(module).items()):
                if isinstance(value, Dispatcher):
                    monkeypatch.setattr(module, own, value.py_func)
