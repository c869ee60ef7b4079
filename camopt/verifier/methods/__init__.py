"""The independent methods, one file each: they share only the train, the lift law and the record of the response.

Every method has its own assembly of the equations and its own contact law, and imports nothing else of camopt.
docs/how-to/add-a-method.md shows how to add one. A method that is too long for one file continues in `of_<method>`.
"""

INDEPENDENT = {
    "rkg": "camopt.verifier.methods.rkg",
    "tmm": "camopt.verifier.methods.tmm",
    "houbolt": "camopt.verifier.methods.houbolt",
    "dop853": "camopt.verifier.methods.dop853",
}
"""Every method of this package: its name on the command line, and the module that defines its `prepare`."""
METHOD_NAMES = {
    "event": "event-exact",
    "rkg": "Runge-Kutta-Gill",
    "tmm": "transition matrix",
    "houbolt": "Houbolt",
    "dop853": "DOP853",
    "smooth": "smooth",
}
"""Display name of every method by its name on the command line; a method without an entry is shown by the latter."""


def verdict_methods() -> tuple[str, ...]:
    """Names of the methods that a verdict can use: event-exact and those of this package."""
    return "event", *INDEPENDENT
