"""camopt: differentiable cam design for valve trains, re-checked by an independent non-smooth verifier."""

from importlib import import_module
from importlib.metadata import version

__version__ = version("camopt")

_PUBLIC = {
    "load_scene": "camopt.scene",
    "polydyne": "camopt.cam.families.polydyne",
    "multi_pol": "camopt.cam.families.multi_pol",
    "new_design": "camopt.cam.families.new_design",
    "exponent": "camopt.cam.families.exponent",
    "kurz": "camopt.cam.families.kurz",
    "trapezoid": "camopt.cam.families.trapezoid",
    "free_cam": "camopt.cam.families.free",
    "cycloidal": "camopt.cam.families.dwell",
    "polynomial_345": "camopt.cam.families.dwell",
    "polynomial_4567": "camopt.cam.families.dwell",
    "differentiable": "camopt.cam.families.gradients",
    "read_cam": "camopt.cam.read",
    "read_lift_table": "camopt.cam.tables",
    "simulate": "camopt.study.motion",
    "modes": "camopt.study.modes",
    "reduce": "camopt.study.reduce",
    "tradeoff": "camopt.study.tradeoff",
    "area_bound": "camopt.optimize.summary",
    "compare": "camopt.optimize.comparison",
    "identify": "camopt.study.identify",
    "MeasuredLift": "camopt.study.identify",
    "pareto": "camopt.study.pareto",
    "joint_spring": "camopt.study.pareto",
}
_CALLABLE_PACKAGES = ("optimize", "verify")


def __getattr__(name: str):
    """Public names are imported on first use, so that `import camopt` loads neither JAX nor numba."""
    if name in _CALLABLE_PACKAGES:
        return import_module(f"camopt.{name}")
    if name in _PUBLIC:
        return getattr(import_module(_PUBLIC[name]), name)
    raise AttributeError(f"module 'camopt' has no attribute {name!r}")


def __dir__():
    return sorted([*_PUBLIC, *_CALLABLE_PACKAGES, "__version__"])
