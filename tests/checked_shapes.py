"""The modules whose array shapes are checked in all tests, by jaxtyping's import hook and beartype.

The hook wraps every function of a module. Compiled functions cannot be wrapped; therefore `camopt.exact.kernel` and
the modules of `camopt.exact` that also contain compiled functions are left out (adjoint.seeds, adjoint.sweep,
adjoint.integrals, adjoint.metrics). Modules without annotated shapes are left out as well.
"""

from beartype import beartype

MODULES = [
    "camopt.cam.card",
    "camopt.cam.contact",
    "camopt.cam.conversion",
    "camopt.cam.exports",
    "camopt.cam.followers",
    "camopt.cam.geometry",
    "camopt.cam.hertz",
    "camopt.cam.lift",
    "camopt.cam.polynomials",
    "camopt.exact.adjoint.motion",
    "camopt.exact.engine",
    "camopt.measure.energy",
    "camopt.measure.hermite",
    "camopt.measure.metrics",
    "camopt.measure.periodic",
    "camopt.measure.resonance",
    "camopt.measure.settling",
    "camopt.measure.sweep",
    "camopt.smooth.exact_rule",
    "camopt.smooth.families",
    "camopt.smooth.grid",
    "camopt.smooth.metrics",
    "camopt.smooth.rest",
    "camopt.smooth.scan",
    "camopt.smooth.simulate",
    "camopt.smooth.system",
    "camopt.smooth.varying_motion",
    "camopt.study.gradient.paths",
]


def checked(function):
    """Beartype for annotations with a shape only: many tests pass stand-ins for other arguments."""
    shaped = {name: hint for name, hint in function.__annotations__.items() if "Float[" in str(hint)}
    function.__annotations__ = shaped
    return beartype(function)
