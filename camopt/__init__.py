"""camopt: differentiable cam design for valve trains, re-checked by an independent non-smooth verifier."""

from importlib import import_module
from importlib.metadata import version

__version__ = version("camopt")

_PUBLIC = {
    "load_scene": "camopt.scene",
}


def __getattr__(name: str):
    """Public names are imported on first use, so that `import camopt` loads neither JAX nor numba."""
    if name in _PUBLIC:
        return getattr(import_module(_PUBLIC[name]), name)
    raise AttributeError(f"module 'camopt' has no attribute {name!r}")


def __dir__():
    return sorted([*_PUBLIC, "__version__"])
