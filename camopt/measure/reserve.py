"""How far beyond its band a cam keeps its limits, in sentences: the same for the terminal and for the report."""

from collections.abc import Mapping

from camopt.measure.sweep import STARTS_MM
from camopt.scene.quantities import QUANTITIES, is_number

STARTS = {"first_jump_rpm": "jump_mm", "first_bounce_rpm": "bounce_mm"}
"""By key of a verdict's `limits` the metric whose limit is exceeded from that speed on."""


def reserve_sentences(starts: Mapping, design: Mapping, band_rpm: tuple[float, float]) -> list[str]:
    """A sentence for each of the speeds `starts` [r/min], by their keys, at which jump and bounce exceed their limits.

    `design` holds the scene's limits by their keys [mm]; where it has none, `STARTS_MM` counts. None stands for a speed
    that was not found below 1.5 times the band's top.
    """
    sentences = []
    for key, name in STARTS.items():
        if key not in starts:
            continue
        given = design.get(QUANTITIES[name].limit)
        limit, word, at = given if is_number(given) else STARTS_MM, name.removesuffix("_mm").capitalize(), starts[key]
        if is_number(at):
            sentences.append(f"{word} exceeds {limit:g} mm from {at:.5g} r/min on, {_beside(at, *band_rpm)}.")
        else:
            sentences.append(f"{word} does not exceed {limit:g} mm below 1.5 times the band's top.")
    return sentences


def _beside(at_rpm: float, low_rpm: float, high_rpm: float) -> str:
    if at_rpm < low_rpm:
        return "below the band"
    return f"{100 * (at_rpm / high_rpm - 1):.1f} % above the band" if at_rpm > high_rpm else "within the band"
