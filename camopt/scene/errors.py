"""Errors that a user causes. Their sentence states what is wrong, where, what was expected, and the remedy."""

from collections.abc import Iterable

LONGEST_LINE = 1000
"""Largest number of characters in a line of a message, because a library's sentence may quote a whole file."""


def brief(sentence: str) -> str:
    """The sentence without the middle of those lines that are longer than LONGEST_LINE."""
    half = LONGEST_LINE // 2
    lines = sentence.split("\n")
    return "\n".join(line if len(line) <= LONGEST_LINE else f"{line[:half]} ... {line[-half:]}" for line in lines)


class InputError(ValueError):
    """Wrong use or bad input. The command line prints it and exits with code 2."""

    def __str__(self) -> str:
        return brief(super().__str__())


class NoCamFound(InputError):
    """A search ended without a cam: none that it tried satisfies the limits, or its model cannot represent the train.

    The command line exits with code 3, as for a cam that is not confirmed.
    """


class MotionRefused(InputError):
    """A method refuses a motion (endless switching, loss of accuracy) rather than return wrong numbers."""


LONGEST_NAME = 80
"""Largest number of characters of a name for which a similar one is sought; no name of camopt is longer."""
SYNONYMS = {"peak": "max", "maximum": "max", "largest": "max", "minimum": "min", "least": "min", "smallest": "min"}
"""Words that users write in names -> the words of camopt."""


def did_you_mean(word: str, names: Iterable[str]) -> str:
    """`; did you mean 'kodama'?`, as the end of a sentence, or an empty text if no known name is similar."""
    from difflib import get_close_matches  # imported only for a misspelt name

    names = list(names)
    by_lower = {name.lower(): name for name in names}
    if len(word) > LONGEST_NAME or not by_lower:
        return ""
    close = get_close_matches(word.lower(), by_lower, n=1)
    in_other_words = {_words(name): name for name in names}.get(_words(word))
    if in_other_words is None and not close:
        return ""
    return f"; did you mean {in_other_words or by_lower[close[0]]!r}?"


def _words(name: str) -> tuple[str, ...]:
    """The words of a name in alphabetical order, each replaced by camopt's own."""
    return tuple(sorted(SYNONYMS.get(word, word) for word in name.lower().split("_")))
