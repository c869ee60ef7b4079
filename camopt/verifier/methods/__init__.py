"""The independent methods, one file each: own assembly, own contact law, nothing shared but train, lift law and record.

Nothing of camopt is imported but what they share: the method's own assembly is the point. docs/how-to/add-a-method.md
adds one; what of a method is too long for one file stands in a file `of_<method>` beside it.
"""

INDEPENDENT = {
    "rkg": "camopt.verifier.methods.rkg",
    "tmm": "camopt.verifier.methods.tmm",
    "houbolt": "camopt.verifier.methods.houbolt",
    "dop853": "camopt.verifier.methods.dop853",
}
"""Every method of this package by its name on the command line, and the module whose `prepare` it is."""
METHOD_NAMES = {
    "event": "event-exact",
    "rkg": "Runge-Kutta-Gill",
    "tmm": "transition matrix",
    "houbolt": "Houbolt",
    "dop853": "DOP853",
    "smooth": "smooth",
}
"""What readers are shown for a method's name on the command line; a method without an entry is shown by that one."""


def verdict_methods() -> tuple[str, ...]:
    """Names of the methods that a verdict can ask: event-exact, and those of this package."""
    return "event", *INDEPENDENT
