"""Kurz-type cam ("ruckfreier Nocken"): half sine, quarter sine and a parabola of acceleration. A reconstruction.

Kurz's own definition (ATZ 56, 1954) was not available. This is the form that textbooks give, and the cam is therefore
called "Kurz-type" only. In each section, with its own angle phi and width Phi,
    1  s = H + c11 phi - c12 sin(pi phi / Phi)               acceleration a half sine, zero at both ends
    2  s = s1 + c21 phi + c22 sin(pi phi / (2 Phi))          deceleration a quarter sine from zero
    3  s = c31 (Phi - phi)^4 - c32 (Phi - phi)^2 + c33       deceleration a parabola about the nose
joined with continuous lift, velocity and acceleration. The scene's ramp of constant velocity replaces Kurz's cosine
ramp, so that all families have the same ramp.
"""

from collections.abc import Sequence

import numpy as np

from camopt.cam.families.sectioned import member, sectioned_family
from camopt.cam.families.sections import Section, SectionTable, U
from camopt.cam.lift import Lift
from camopt.cam.polynomials import power_derivatives
from camopt.scene import Scene


def sine_terms(wave: float, u: np.ndarray, order: int) -> np.ndarray:
    """The derivative `order` of 1, u, sin(wave u) at u (k), shape (k, 3)."""
    line = power_derivatives(np.arange(2), u, order)
    return np.column_stack([line, wave**order * np.sin(wave * u + order * np.pi / 2)])


def about_the_nose(_: int, u: np.ndarray, order: int) -> np.ndarray:
    """Terms of section 3: 1, (1 - u)^2, (1 - u)^4."""
    return (-1.0) ** order * power_derivatives(np.array([0, 2, 4]), 1.0 - u, order)


TABLE = SectionTable(
    "kurz",
    (
        Section(("y_r", U), ("v_r", "v12"), (U, U), (U, U), lambda _, u, order: sine_terms(np.pi, u, order)),
        Section(("y12", U), ("v12", U), (U, "a23"), (U, U), lambda _, u, order: sine_terms(np.pi / 2, u, order)),
        Section(("y23", U), ("v23", U), ("a23", U), (U, U), about_the_nose),
    ),
    levels=("v12", "a23"),
    closed_by=("v12",),
)
STARTS = ((0.338, 0.343, 0.319),)
"""Section angles, as shares of half the duration, of the member with the largest area under the paper's Table 4. A jerk
limit of 0.003 mm/deg^3 is not active there."""


def kurz(
    scene: Scene,
    sections_deg: Sequence[float] | None = None,
    a23: float | None = None,
    *,
    jerk: bool = True,
) -> Lift:
    """The Kurz-type cam, a reconstruction, of a scene's duration, maximum lift and ramps.

    `sections_deg`: the three section angles from the ramp to the nose; `a23` [mm/deg^2]: the acceleration where
    sections 2 and 3 meet, which with the maximum lift determines the largest velocity of the flank. Values that are
    left out are chosen as by `camopt.multi_pol`, and the same errors are raised.
    """
    return member(scene, TABLE, STARTS, sections_deg, {"a23": a23}, jerk)


FAMILY = sectioned_family(kurz, TABLE, STARTS, ["a23_mm_per_deg2"], ("#56B4E9", (0, (4, 1.2, 1.2, 1.2, 1.2, 1.2))))
