"""The modules whose array shapes every test checks, by jaxtyping's import hook and beartype.

The hook wraps every function of a module. A compiled function cannot be wrapped, which leaves out `camopt.exact.kernel`
and those modules of `camopt.exact` that hold compiled functions beside others (adjoint.seeds, adjoint.sweep,
adjoint.integrals, adjoint.metrics). What has no shapes to check is left out as well.
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
    """Beartype for the annotations that state a shape and for no others: many tests put stand-ins in other places."""
    shaped = {name: hint for name, hint in function.__annotations__.items() if "Float[" in str(hint)}
    function.__annotations__ = shaped
    return beartype(function)
