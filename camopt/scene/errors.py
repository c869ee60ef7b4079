"""The one error a user causes: a sentence that says what, where, what was expected, and the remedy."""


class InputError(ValueError):
    """Wrong use or bad input; the command line prints it and ends with exit code 2."""


class MotionRefused(InputError):
    """A motion that a method will not follow (endless switching, loss of accuracy): a refusal, never a wrong number."""
