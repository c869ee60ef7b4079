"""The knife's edge: what makes a cam that is confirmed as designed break its limits when something small differs.

Each finding is one sentence that ends with what would mend it.
"""

from camopt.measure.yield_words import ENOUGH, HELD, standing
from camopt.report.folder import RunFolder
from camopt.report.wording import in_words, shown
from camopt.scene.quantities import is_number

NARROW_PERCENT = 2.0
"""A reserve of speed that counts as narrow. Frequencies follow the root of stiffness, so that a spring whose rate is
twice as much softer in per cent meets in the band what this one meets beyond it; 2 to 4 % is what springs scatter."""
LONG_OPEN_DEG = 10.0
"""A contact that is open over more of the cam than this is sensitive to small changes, however little it opens."""


def edge_sentences(run: RunFolder) -> list[str]:
    """The findings on a confirmed cam: too little reserve of speed, a contact that is open for long, a motion that does
    not settle; none for another verdict, which says worse."""
    if run.verdict != "confirmed":
        return []
    return [*_narrow_reserve(run), *_long_open(run), *_unsettled(run)]


def _narrow_reserve(run: RunFolder) -> list[str]:
    """That a limit breaks just above the band, unless the trains as built hold all the same: softer springs are among
    them."""
    if standing(run.built) in (HELD, ENOUGH):
        return []
    starts, band = run.verification.get("limits"), run.band_rpm
    if not starts or band is None:
        return []
    above = [speed for speed in starts.values() if is_number(speed) and speed > band[1]]
    reserve = 100 * (min(above) / band[1] - 1) if above else NARROW_PERCENT
    if reserve >= NARROW_PERCENT:
        return []
    return [
        f"The limits hold only {shown(reserve, 2)} % beyond the band's top speed, which a spring "
        f"{shown(2 * reserve, 2)} % softer uses up: a band_rpm that reaches further{_or_yield(run)} makes room."
    ]


def _long_open(run: RunFolder) -> list[str]:
    """That a contact is open over tens of degrees and nothing in the scene forbids it."""
    angle, jump = run.verification.worst("jump_deg"), run.verification.worst("jump_mm")
    limited = "jump_max_deg" in run.demands or "contact_force_min_N" in run.demands
    if limited or angle is None or angle.value is None or angle.value <= LONG_OPEN_DEG:
        return []
    little = f" though by {shown(jump.value, 2)} mm at most" if jump is not None and is_number(jump.value) else ""
    return [
        f"A contact is open over {shown(angle.value, 3)} deg of the cam {angle.where}{little}: jump_max_deg or "
        f"contact_force_min_N in [design] would keep it closed."
    ]


def _unsettled(run: RunFolder) -> list[str]:
    """That the motion does not settle at some of the judged speeds."""
    speeds = [s.get("speed_rpm") for s in run.verification.by_speed if s.get("periodic") is False]
    if not speeds:
        return []
    return [
        f"The motion at {in_words(speeds)} r/min does not settle, so that another revolution may be worse than those "
        f"that were judged: a lower jump_max_mm{_or_yield(run)} calms it."
    ]


def _or_yield(run: RunFolder) -> str:
    """The other remedy, for a scene that says how trains differ, and for a run that has not been asked so."""
    return ", or --yield," if run.scatters and not is_number(run.built.get("wanted")) else ""
