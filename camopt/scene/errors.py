"""The one error a user causes: a sentence that says what, where, what was expected, and the remedy."""

LONGEST_LINE = 1000
"""Characters of a line of a message; a library's sentence may quote whatever a file has."""


def brief(sentence: str) -> str:
    """The sentence, each of its lines without the middle where nobody would read it to its end."""
    half = LONGEST_LINE // 2
    lines = sentence.split("\n")
    return "\n".join(one if len(one) <= LONGEST_LINE else f"{one[:half]} ... {one[-half:]}" for one in lines)


class InputError(ValueError):
    """Wrong use or bad input; the command line prints it and ends with exit code 2."""

    def __str__(self) -> str:
        return brief(super().__str__())


class NoCamFound(InputError):
    """A search that ends without a cam: none that it tried holds the limits, or its model cannot carry the train.

    The command line ends with exit code 3, as for a cam that is not confirmed.
    """


class MotionRefused(InputError):
    """A motion that a method will not follow (endless switching, loss of accuracy): a refusal, never a wrong number."""
