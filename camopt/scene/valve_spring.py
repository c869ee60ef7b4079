"""The valve spring of a scene: its elements, and its rate and preload multiplied."""

from camopt.scene.errors import InputError
from camopt.scene.schema import Scene


def valve_spring(scene: Scene) -> list[str]:
    """Names of the elements that make up the valve spring: all preloaded elements except the seat."""
    names = [e.name for e in scene.element if e.preload_N > 0 and e.name != scene.seat]
    if not names:
        raise InputError(
            f"{scene.name}: no element but the seat has preload_N > 0, so no valve spring is known: give one some"
        )
    return names


def with_spring(scene: Scene, rate: float = 1.0, preload: float = 1.0) -> Scene:
    """The scene with its valve spring's rate and preload multiplied by a factor each.

    The seat carries the spring's preload in the installed position, so it changes with it.
    """
    spring, elements = valve_spring(scene), []
    for e in scene.element:
        factors = {"stiffness_N_per_m": rate} if e.name in spring else {}
        factors |= {"preload_N": preload} if e.name in (*spring, scene.seat) else {}
        changed = {key: f * getattr(e, key) for key, f in factors.items() if getattr(e, key) is not None}
        elements.append(e.model_copy(update=changed))
    return scene.model_copy(update={"element": tuple(elements)})
