"""Scenes that experiments make from the built-in ones."""

from camopt.scene.schema import Scene

COILS = "spring_"
"""Names of `kodama`'s coil masses begin so."""


def heavier_spring(scene: Scene, factor: float = 1.25) -> Scene:
    """The scene with the masses of its spring's coils times a factor."""
    masses = tuple(
        m.model_copy(update={"mass_kg": factor * m.mass_kg}) if m.name.startswith(COILS) else m for m in scene.mass
    )
    if masses == scene.mass:
        raise ValueError(f"{scene.name}: no mass named {COILS}...")
    return scene.model_copy(update={"mass": masses, "name": f"{scene.name}-heavy-spring"})
