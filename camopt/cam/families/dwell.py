"""Rise functions between two dwells, used as both flanks of a cam: cycloidal, 3-4-5 and 4-5-6-7 polynomial.

Norton, Cam Design and Manufacturing Handbook, 2009, ch. 3: the 3-4-5 polynomial has zero acceleration at both ends of
the rise, the 4-5-6-7 polynomial also has zero jerk, and the acceleration of the cycloid is a sine. Since their
acceleration is zero at the nose they waste lift: these cams are test cases, whose derivatives are known in closed form.
They start with the ramp velocity of the scene, which the cycloid reduces by half a cosine wave, without acceleration at
the ends.
"""

from collections.abc import Callable

import numpy as np

from camopt.cam.families.kurz import sine_terms
from camopt.cam.families.record import Family
from camopt.cam.families.sectioned import sections_construction
from camopt.cam.families.sections import Section, SectionTable, U, close_flank, opening_flank
from camopt.cam.lift import Lift
from camopt.cam.ramps import symmetric_conditions
from camopt.scene import Scene
from camopt.scene.units import DEG, MM


def full_and_half_wave(_: int, u: np.ndarray, order: int) -> np.ndarray:
    """Terms of the cycloid: 1, u, sin(2 pi u), sin(pi u)."""
    return np.column_stack([sine_terms(2 * np.pi, u, order), sine_terms(np.pi, u, order)[:, 2]])


def _table(family: str, jerk: tuple, acceleration: tuple = (0, 0), **terms) -> SectionTable:
    section = Section(("y_r", "y_nose"), ("v_r", 0), acceleration, jerk, **terms)
    return SectionTable(family, (section,), levels=("y_nose",), closed_by=("y_nose",))


TABLES = {
    "cycloidal": _table("cycloidal", (U, U), (U, U), terms=full_and_half_wave),
    "3-4-5": _table("3-4-5", (U, U)),
    "4-5-6-7": _table("4-5-6-7", (0, 0)),
}


def cycloidal(scene: Scene) -> Lift:
    """The cycloidal cam of a scene's duration, maximum lift and ramps; InputError where its two ramps differ."""
    return _designed(scene, "cycloidal")


def polynomial_345(scene: Scene) -> Lift:
    """The 3-4-5 polynomial cam of a scene's duration, maximum lift and ramps; InputError where its two ramps differ."""
    return _designed(scene, "3-4-5")


def polynomial_4567(scene: Scene) -> Lift:
    """The 4-5-6-7 polynomial cam of a scene's duration, maximum lift and ramps; InputError where its ramps differ."""
    return _designed(scene, "4-5-6-7")


def _designed(scene: Scene, family: str) -> Lift:
    design, ramp = symmetric_conditions(scene, family)
    table = TABLES[family]
    flank = opening_flank(table, np.array([design.duration_deg * DEG / 2]))
    x = np.array([ramp.height, ramp.velocity, 0.0])
    x = close_flank(table, flank, x, design.max_lift_mm * MM, table.closed_by)
    return flank.lift(x, ramp, family, {})


def _family(name: str, design: Callable[[Scene], Lift], line: tuple[str, tuple]) -> Family:
    return Family(
        name, design, construction=lambda _, cam: sections_construction(cam, lambda _: TABLES[name]), line=line
    )


CYCLOIDAL = _family("cycloidal", cycloidal, ("#9A9A9A", (0, (2.2, 2.2))))
POLYNOMIAL_345 = _family("3-4-5", polynomial_345, ("#767676", (0, (9, 1.5, 3, 1.5))))
POLYNOMIAL_4567 = _family("4-5-6-7", polynomial_4567, ("#4D4D4D", (0, (1, 2.4))))
