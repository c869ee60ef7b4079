"""The one error a user causes: a sentence that says what, where, what was expected, and the remedy."""

from collections.abc import Iterable

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


LONGEST_NAME = 80
"""Characters of a name that is compared at all; no name of camopt is longer."""
MEANT = {"peak": "max", "maximum": "max", "largest": "max", "minimum": "min", "least": "min", "smallest": "min"}
"""Words of a name that others use for those of camopt."""


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """`; did you mean 'kodama'?`, to end a sentence with, or nothing where no known name is close to the word."""
    from difflib import get_close_matches  # only what is misspelt pays for it

    known = list(known)
    by_lower = {name.lower(): name for name in known}
    if len(word) > LONGEST_NAME or not by_lower:
        return ""
    close = get_close_matches(word.lower(), by_lower, n=1)
    in_other_words = {_words(name): name for name in known}.get(_words(word))
    if in_other_words is None and not close:
        return ""
    return f"; did you mean {in_other_words or by_lower[close[0]]!r}?"


def _words(name: str) -> tuple[str, ...]:
    """The words of a name in the order of the alphabet, each in camopt's own."""
    return tuple(sorted(MEANT.get(word, word) for word in name.lower().split("_")))
