"""Why no cam was confirmed: the limit at fault, what the nearest cam has of it, and up to what speed that holds."""

from collections.abc import Sequence

import numpy as np

from camopt.measure.limits import MOTION_LIMITS
from camopt.optimizer.program.force_rows import Margins
from camopt.optimizer.program.no_jump import NoCamHoldsContact, NoJumpProgram
from camopt.optimizer.search.judge import Judged
from camopt.scene.design import Design

REMEDY = "allow more bounce and jump, raise the spring's preload, or lower the top speed"


def why_none_holds(judged: Sequence[Judged], program: NoJumpProgram) -> str:
    """A sentence on the cams that were judged, all of them refused, of a program that they came from."""
    nearest = min(judged, key=lambda one: float(one.share.max()))
    row, column = np.unravel_index(np.argmax(nearest.share), nearest.share.shape)
    metric = nearest.limited[row]
    key = next(key for key, limited in MOTION_LIMITS.items() if limited == metric)
    value, speed = nearest.figures[metric][column], nearest.speeds_rpm[column]
    reached = f"{metric} of {value:.3g}" if np.isfinite(value) else f"no {metric}"
    said = (
        f"no cam of the no-jump program holds the scene's limits on the motion at the judged speeds: the nearest one "
        f"has {reached} at {speed:.4g} r/min against {key} = {nearest.limit[row]:g}"
    )
    broken = nearest.speeds_rpm[nearest.share.max(axis=0) > 1.0]
    below = nearest.speeds_rpm[nearest.speeds_rpm < broken.min()]
    if below.size:
        said += f", and it holds every limit up to {below.max():.4g} r/min"
    return f"{said}{_most_force(program, program.design)}; {REMEDY}"


def _most_force(program: NoJumpProgram, design: Design) -> str:
    """The largest least contact force of any cam of the program, where it is less than the design's."""
    asked = design.contact_force_min_N
    if asked is None:
        return ""
    try:
        program.solve(Margins(asked, asked, -asked))  # the limit leaves the seat out
    except NoCamHoldsContact as short:
        most = asked - short.shortfall_N
        if not np.isfinite(most):
            return ""
        return f"; while closed, no cam of the program keeps more than {most:.3g} N on its contacts at all these speeds"
    return ""
