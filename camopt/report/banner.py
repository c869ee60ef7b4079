"""The banner of a report: whether the cam holds as it is designed, and as it is built."""

from typing import Any

from camopt.measure.yield_words import ENOUGH, HELD, MISSED, NOT_ASKED, asked_sentence, share_sentence, standing
from camopt.report.folder import RunFolder
from camopt.report.outcome import as_built_words
from camopt.report.wording import NO_VERDICT, VERDICTS

KINDS = ("good", "doubt", "bad")
"""From best to worst: the banner has the worse one of its two lines."""
BUILT = {
    HELD: ("good", "✓"),
    ENOUGH: ("good", "✓"),
    NOT_ASKED: ("doubt", "!"),
    MISSED: ("bad", "✗"),
}
"""By how the share of trains stands to what was asked: its class in the page and its mark."""


def banner(run: RunFolder) -> dict[str, Any]:
    """The two lines with their words, the banner's class, and what the page's title begins with.

    It is green only where both hold what was asked, which is not known of the trains as built where the scene does not
    say how they differ.
    """
    verdict = run.verification.get("verdict")
    kind, mark, meaning = VERDICTS.get(verdict, NO_VERDICT) if isinstance(verdict, str) else NO_VERDICT
    designed = {"which": "as designed", "kind": kind, "mark": mark, "word": verdict or "not verified"}
    lines = [designed | {"meaning": meaning}, *_as_built(run)]
    worst = max((line["kind"] for line in lines), key=KINDS.index)
    return {"kind": worst, "lines": lines, "title": verdict or "not verified"}


def _as_built(run: RunFolder) -> list[dict[str, str]]:
    """The line on the trains as built; none where the scene is not known."""
    record, words = run.built, as_built_words(run)
    stands = standing(record)
    if not words:
        return []
    if not stands:
        unknown = {"which": "as built", "kind": "doubt", "mark": "?", "word": "not known"}
        return [unknown | {"meaning": _sentence(words.removeprefix("not known: "))}]
    kind, mark = BUILT[stands]
    word = f"{100 * record['share']:.3g} % of trains"
    meaning = f"{_sentence(share_sentence(record))} {_sentence(asked_sentence(record))}"
    return [{"which": "as built", "kind": kind, "mark": mark, "word": word, "meaning": meaning}]


def _sentence(words: str) -> str:
    return f"{words[:1].upper()}{words[1:]}."
