"""The valve spring of a scene: its elements, and its rate and preload multiplied."""

from camopt.scene.errors import InputError
from camopt.scene.row_numbers import PRELOAD, RATE, number_of, with_number
from camopt.scene.schema import Scene


def valve_spring(scene: Scene) -> list[str]:
    """Names of the elements that make up the valve spring: all preloaded elements except the seat."""
    names = [e.name for e in scene.element if (number_of(e, PRELOAD) or 0.0) > 0 and e.name != scene.seat]
    if not names:
        raise InputError(
            f"{scene.name}: no element but the seat pushes with the valve closed, so no valve spring is known: give "
            "one a preload_N, or the one with a force_table its installed_mm"
        )
    return names


def with_spring(scene: Scene, rate: float = 1.0, preload: float = 1.0) -> Scene:
    """The scene with its valve spring's rate and preload multiplied by a factor each.

    The seat carries the spring's preload in the installed position, so it changes with it.
    """
    spring, elements = valve_spring(scene), []
    for e in scene.element:
        factors = {RATE: rate} if e.name in spring else {}
        factors |= {PRELOAD: preload} if e.name in (*spring, scene.seat) else {}
        for key, factor in factors.items():
            if (number := number_of(e, key)) is not None and factor != 1.0:
                e = with_number(e, key, factor * number)
        elements.append(e)
    return scene.model_copy(update={"element": tuple(elements)})
