"""The largest area a scene's limits allow: certified bounds, the no-jump program, the gradient stage, the run.

Also the public function: `camopt.optimize(scene, speeds, accuracy, gradient, out, seed, resume, progress)` is
`camopt.optimize.run.optimize`. It designs the cam of largest area for a scene's listed speeds (k) or its band [r/min],
writes the run folder `out`, and returns a `Run`: folder, lift law (pieces (p, q) [m/rad^k]), verdict and the figures of
design.json. Raises InputError for contradictory limits, an unusable folder, or a scene without a confirmed cam.
"""

import sys
from importlib import import_module
from types import ModuleType


class _Callable(ModuleType):
    """A package and a function share the name `camopt.optimize`: design.md section 7 asks for both."""

    def __call__(self, *args, **kwargs):
        return import_module("camopt.optimize.run").optimize(*args, **kwargs)


sys.modules[__name__].__class__ = _Callable
