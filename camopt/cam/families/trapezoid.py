"""Jerk-limited trapezoid: the acceleration rises to a level, is held, falls to another level and is held to the nose.

The jerk limit shapes this flank: the acceleration rises and falls at constant jerk and stays constant at two levels,
which are determined by the maximum lift and zero velocity at the nose (Norton, Cam Design and Manufacturing Handbook,
2009, on trapezoidal acceleration). The jerk has a step at every border.
"""

from collections.abc import Sequence

from camopt.cam.families.sectioned import member, sectioned_family
from camopt.cam.families.sections import Section, SectionTable, U
from camopt.cam.lift import Lift
from camopt.scene import Scene

TABLE = SectionTable(
    "trapezoid",
    (
        Section(("y_r", U), ("v_r", U), (0, "a12"), (U, U)),
        Section(("y12", U), ("v12", U), ("a12", "a12"), (U, U)),
        Section(("y23", U), ("v23", U), ("a12", "a34"), (U, U)),
        Section(("y34", U), ("v34", U), ("a34", "a34"), (U, U)),
    ),
    levels=("a12", "a34"),
    closed_by=("a12", "a34"),
)
STARTS = (
    (0.028, 0.198, 0.028, 0.746),
    (0.069, 0.150, 0.092, 0.689),
)
"""Section angles, as shares of half the duration, of the members with the largest area under the paper's Table 4,
without and with a jerk limit of 0.003 mm/deg^3."""


def trapezoid(scene: Scene, sections_deg: Sequence[float] | None = None, jerk: bool = True) -> Lift:
    """The trapezoidal cam of a scene's duration, maximum lift and ramps.

    `sections_deg` has the four section angles from the ramp to the nose, which determine both levels; by default they
    are chosen as by `camopt.multi_pol`, and the same errors are raised.
    """
    return member(scene, TABLE, STARTS, sections_deg, {}, jerk)


FAMILY = sectioned_family(trapezoid, TABLE, STARTS, line=("#7A5C2E", (0, (9, 2))))
