"""Misspelt names: which known one was probably meant."""

from collections.abc import Iterable

LONGEST = 80
"""Characters of a name that is compared at all; no name of camopt is longer."""
MEANT = {"peak": "max", "maximum": "max", "largest": "max", "minimum": "min", "least": "min", "smallest": "min"}
"""Words of a name that others use for those of camopt."""


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """`; did you mean 'kodama'?`, to end a sentence with, or nothing where no known name is close to the word."""
    from difflib import get_close_matches  # only what is misspelt pays for it

    known = list(known)
    by_lower = {name.lower(): name for name in known}
    if len(word) > LONGEST or not by_lower:
        return ""
    close = get_close_matches(word.lower(), by_lower, n=1)
    in_other_words = {_words(name): name for name in known}.get(_words(word))
    if in_other_words is None and not close:
        return ""
    return f"; did you mean {in_other_words or by_lower[close[0]]!r}?"


def _words(name: str) -> tuple[str, ...]:
    """The words of a name in the order of the alphabet, each in camopt's own."""
    return tuple(sorted(MEANT.get(word, word) for word in name.lower().split("_")))
