"""Warnings about a cam's area ratio: a longer duration, a ratio above one, a ratio above the certified bound."""

from camopt.cam.lift import Lift
from camopt.measure.limits import broken_by_shape, duration_words
from camopt.optimizer.bound.certificate import area_ratio_bound
from camopt.scene.design import Design
from camopt.scene.errors import InputError


def area_words(lift: Lift, design: Design) -> list[str]:
    """Sentences on a cam's duration, where it is not the design's, and on an area ratio beyond one or beyond the bound.

    The ratio is that of the design's duration. The certified bound holds for cams that keep the limits and join the
    ramps exactly, without acceleration; a cam called legal may exceed it only by joining them otherwise.
    """
    ratio, said = lift.area_ratio_in(design), []
    if words := duration_words(lift, design):
        said.append(words)
    if ratio > 1:
        said.append(f"the area ratio of {ratio:.4f} exceeds one: the lift exceeds max_lift_mm = {design.max_lift_mm:g}")
    try:
        bound = area_ratio_bound(design).bound
    except InputError:
        return said  # limits that no cam keeps bound nothing
    if bound < ratio <= 1:
        broken = broken_by_shape(lift, design)
        because = (
            f"it breaks {', '.join(broken)}"
            if broken
            else "it keeps the limits, but does not join the ramps as the bound assumes: at their height and velocity "
            "and without acceleration"
        )
        said.append(f"the area ratio of {ratio:.4f} exceeds the certified bound of {bound:.4f}: {because}")
    return said
