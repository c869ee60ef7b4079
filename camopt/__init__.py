"""camopt: differentiable cam design for valve trains, re-checked by an independent non-smooth verifier."""

from importlib import import_module
from importlib.metadata import version

__version__ = version("camopt")

_PUBLIC = {
    "optimize": "camopt.optimizer.run",
    "verify": "camopt.verifier.accuracy",
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
    "differentiable": "camopt.differentiable.families",
    "read_cam": "camopt.cam.read",
    "read_lift_table": "camopt.cam.tables.lift_table",
    "simulate": "camopt.study.simulate.motion",
    "modes": "camopt.study.modes",
    "reduce": "camopt.study.reduce.reduction",
    "tradeoff": "camopt.study.tradeoff.tradeoff",
    "area_bound": "camopt.optimizer.bound.summary",
    "compare": "camopt.optimizer.baselines.comparison",
    "identify": "camopt.study.identify.identification",
    "MeasuredLift": "camopt.study.identify.identification",
    "pareto": "camopt.study.fronts",
    "joint_spring": "camopt.study.fronts",
}


def __getattr__(name: str):
    """Public names are imported on first use, so that `import camopt` loads neither JAX nor numba."""
    if name in _PUBLIC:
        return getattr(import_module(_PUBLIC[name]), name)
    raise AttributeError(f"module 'camopt' has no attribute {name!r}")


def __dir__():
    return sorted([*_PUBLIC, "__version__"])
