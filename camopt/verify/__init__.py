"""The non-smooth verifier: independent methods, metrics, settling and the verdict (NumPy and numba, no JAX).

Every method (`rkg`, `tmm`, `houbolt`, `dop853`) assembles its own equations and has its own contact law: that
duplication is the independence. They share only the train's data, the lift pieces and the response record. Names are
imported on first use; only `verdict` reaches for the event-exact method, and only when asked to.
"""

import sys
from importlib import import_module
from types import ModuleType

_PUBLIC = {
    "energy": "energy",
    "Energy": "energy",
    "measure": "metrics",
    "periodic_state": "periodic",
    "settle": "settle",
    "Settled": "settle",
    "verify": "verdict",
    "Verdict": "verdict",
    "verify_cam": "effort",
    "broken_by_shape": "limits",
}


def __getattr__(name: str):
    if name in _PUBLIC:
        return getattr(import_module(f"camopt.verify.{_PUBLIC[name]}"), name)
    raise AttributeError(f"module 'camopt.verify' has no attribute {name!r}")


def __dir__():
    return sorted(_PUBLIC)


class _Callable(ModuleType):
    """This package is also the public function: `camopt.verify(scene, lift)` is `verify_cam`."""

    def __setattr__(self, name: str, value):
        """Keeps `settle` and `energy` the functions after the import system has bound the files of the same names."""
        if name in _PUBLIC and isinstance(value, ModuleType):
            value = getattr(value, name)
        super().__setattr__(name, value)

    def __call__(self, *args, **kwargs):
        return import_module("camopt.verify.effort").verify_cam(*args, **kwargs)


sys.modules[__name__].__class__ = _Callable
