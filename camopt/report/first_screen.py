"""What the page shows first: the banner, which says whether the cam holds as designed and as built, and its figures."""

from typing import Any

import numpy as np

from camopt.cam.lift import Lift
from camopt.measure.yield_words import ENOUGH, HELD, MISSED, NOT_ASKED, asked_sentence, share_sentence, standing
from camopt.plots.style import DESIGN
from camopt.report.folder import RunFolder
from camopt.report.motion import RunCams
from camopt.report.outcome import as_built_words
from camopt.report.tables import comparison_groups
from camopt.report.wording import NO_VERDICT, VERDICTS, shown
from camopt.scene.quantities import is_number
from camopt.scene.units import DEG, MM

KINDS = ("good", "doubt", "bad")
"""From best to worst: the banner has the worse one of its two lines."""
BUILT = {HELD: ("good", "✓"), ENOUGH: ("good", "✓"), NOT_ASKED: ("doubt", "!"), MISSED: ("bad", "✗")}
"""By how the share of trains stands to what was asked: its class in the page and its mark."""
WIDTH, HEIGHT = 300.0, 96.0
"""Size of the sketch of the lift [px]."""
POINTS = 241


def banner(run: RunFolder) -> dict[str, Any]:
    """The two lines with their words, the banner's class, and what the page's title begins with.

    It is green only where both hold what was asked, which is not known of the trains as built where the scene does not
    say how they differ.
    """
    verdict = run.verdict
    kind, mark, meaning = VERDICTS.get(verdict, NO_VERDICT) if isinstance(verdict, str) else NO_VERDICT
    designed = {"which": "as designed", "kind": kind, "mark": mark, "word": verdict or "not verified"}
    lines = [designed | {"meaning": meaning}, *_as_built(run)]
    worst = max((line["kind"] for line in lines), key=KINDS.index)
    return {"kind": worst, "lines": lines, "title": verdict or "not verified"}


def _as_built(run: RunFolder) -> list[dict[str, str]]:
    """The line on the trains as built; none where the scene is not known."""
    record, words = run.built, as_built_words(run)
    if not words:
        return []
    kind, mark, word = "doubt", "?", "not known"
    meaning = _sentence(words.removeprefix("not known: "))
    if stands := standing(record):
        (kind, mark), word = BUILT[stands], f"{100 * record['share']:.3g} % of trains"
        meaning = f"{_sentence(share_sentence(record))} {_sentence(asked_sentence(record))}"
    return [{"which": "as built", "kind": kind, "mark": mark, "word": word, "meaning": meaning}]


def _sentence(words: str) -> str:
    return f"{words[:1].upper()}{words[1:]}."


def sketch(lift: Lift, duration_deg: float) -> dict[str, Any]:
    """The cam's lift as the path of an SVG, over its event with the ramps."""
    lifted = [angle for angle in lift.borders if lift(np.array(angle)) > 0]
    reach = max([duration_deg / 2 * DEG, *np.abs(lifted)]) * 1.1
    theta = np.linspace(-reach, reach, POINTS)
    x, y = WIDTH * (theta / reach + 1) / 2, HEIGHT * (1 - 0.92 * lift(theta) / lift.max_lift)
    path = "M" + "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(x, y, strict=True))
    ends = [round(WIDTH * (sign * duration_deg / 2 * DEG / reach + 1) / 2, 1) for sign in (-1, 1)]
    words = f"Lift of the cam, {shown(lift.max_lift / MM)} mm at most over a duration of {shown(duration_deg)} deg"
    return {"path": path, "width": WIDTH, "height": HEIGHT, "ends": ends, "words": words}


def facts(run: RunFolder, cams: RunCams) -> list[tuple[str, str]]:
    """The cam's figures by their names: area, bound, lift, and the best other cam that is confirmed."""
    d, lift, figures = run.design, cams.lifts.get(DESIGN), []
    if is_number(d.get("area_ratio")):
        figures.append(("area ratio", shown(d["area_ratio"])))
    if is_number(d.get("area_gap_percent")):
        figures.append(("below the bound", f"{shown(d['area_gap_percent'], 3)} %"))
    if lift is not None:
        figures.append(("largest lift", f"{shown(lift.max_lift / MM)} mm"))
        figures.append(("duration", f"{shown(2 * lift.half_duration / DEG)} deg"))
    groups = comparison_groups(run)
    others = [g for g in groups if g["cam"] != DESIGN and g["within"] and g["verdict"] == "confirmed" and g["area"]]
    if others and is_number(d.get("area_ratio")):
        best = max(others, key=lambda g: g["area"])
        more = 100 * (d["area_ratio"] / best["area"] - 1)
        figures.append((f"area against {best['cam']}", f"{'+' if more >= 0 else '−'}{shown(abs(more), 3)} %"))
    elif groups:
        figures.append(("other cams under these limits", "none confirmed"))
    return figures
