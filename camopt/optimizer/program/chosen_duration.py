"""Loading of a scene in which camopt may choose the duration between the ramps, from a duration at a lift such as
"250 crank degrees at 1 mm"."""

from pathlib import Path

from camopt.scene import load
from camopt.scene.design import FROM_DURATION_AT, Design
from camopt.scene.errors import InputError
from camopt.scene.schema import Part, Scene

ROOM = 0.02
"""Relative amount by which the chosen duration exceeds the shortest one. With the shortest duration the limits alone
determine the flanks, and the search has no freedom left to adapt the cam to the valve train."""


def load_scene(source: str | Path, need: tuple[Part, ...] = ()) -> Scene:
    """The scene of a built-in name or TOML file, fully checked; a duration that the scene leaves open is chosen.

    `need` names optional parts that the caller requires, out of "valve", "seat", "operation", "design", "geometry".
    Numbers keep the units of their keys (`_mm`, `_deg`, `_rpm`). Raises InputError with one line per fault.
    """
    return load.load_scene(source, need, chosen_duration_deg)


def chosen_duration_deg(design: Design) -> float:
    """The duration_deg of a design that leaves it to its `duration_at`: the shortest possible one plus `ROOM`. Raises
    InputError where no duration is possible, and where `duration_at` has no least duration."""
    from camopt.optimizer.program.kinematic import DURATION_STEP_DEG, longest_duration_deg, shortest_duration_deg

    if not any(least for _, least, _ in design.duration_at):
        raise InputError(
            f'design.duration_deg: "{FROM_DURATION_AT}" needs duration_at with a least duration, '
            "as in duration_at = [[1.0, 125, 126]]"
        )
    shortest = shortest_duration_deg(design)
    if shortest is None:
        raise InputError(
            f'design.duration_deg: "{FROM_DURATION_AT}": with these limits on the shape no duration has a cam that is '
            "open so long at these lifts: allow more acceleration or jerk, or ask for less in duration_at"
        )
    steps = -(-shortest * (1 + ROOM) // DURATION_STEP_DEG)
    return min(round(steps * DURATION_STEP_DEG, 9), longest_duration_deg(design))
