"""The largest area a scene's limits allow: certified bounds, the no-jump program, the gradient stage, the run.

Also the public function: `camopt.optimize(scene)` is `camopt.optimize.run.optimize`.
"""

import sys
from importlib import import_module
from types import ModuleType


class _Callable(ModuleType):
    """A package and a function share the name `camopt.optimize`: design.md section 7 asks for both."""

    def __call__(self, *args, **kwargs):
        return import_module("camopt.optimize.run").optimize(*args, **kwargs)


sys.modules[__name__].__class__ = _Callable
