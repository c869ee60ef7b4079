"""Misspelt names: which known one was probably meant."""

from collections.abc import Iterable

LONGEST = 80
"""Characters of a name that is compared at all; no name of camopt is longer."""


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """`; did you mean 'kodama'?`, to end a sentence with, or nothing where no known name is close to the word."""
    from difflib import get_close_matches  # only what is misspelt pays for it

    by_lower = {name.lower(): name for name in known}
    if len(word) > LONGEST or not by_lower:
        return ""
    close = get_close_matches(word.lower(), by_lower, n=1)
    return f"; did you mean {by_lower[close[0]]!r}?" if close else ""
