"""Multi-Pol as Kodama et al. tabulate it (Table 1): five polynomial sections from the ramp to the nose.

As tabulated, acceleration and jerk are continuous at every border inside the flank; the jerk has a step only where the
ramp meets section 1. The paper's text contradicts the table for section 2; the table is followed. The table states no
lift at the nose, so the maximum lift is added as the condition that determines one level.
"""

from collections.abc import Sequence

from camopt.cam.families.sectioned import member, sectioned_family
from camopt.cam.families.sections import Section, SectionTable, U
from camopt.cam.lift import Lift
from camopt.scene import Scene

TABLE_1 = SectionTable(
    "multi-pol",
    (
        Section(("y_r", U), ("v_r", U), (0, "a12"), (U, 0)),
        Section(("y12", U), ("v12", U), ("a12", "a12"), (0, 0)),
        Section(("y23", U), ("v23", U), ("a12", 0), (0, "j34")),
        Section(("y34", U), ("v34", U), (0, "a45"), ("j34", "j45")),
        Section(("y45", U), ("v45", 0), ("a45", U), ("j45", 0)),
    ),
    levels=("a12", "a45", "j34", "j45"),
    closed_by=("a45",),
)
STARTS = (
    (0.028, 0.218, 0.028, 0.339, 0.387),
    (0.139, 0.095, 0.095, 0.381, 0.290),
)
"""Section angles, as shares of half the duration, of the members with the largest area under the paper's Table 4,
without and with a jerk limit of 0.003 mm/deg^3. The search of experiments/cam_families.py finds 2e-4 more at most."""


def multi_pol(
    scene: Scene,
    sections_deg: Sequence[float] | None = None,
    a12: float | None = None,
    *,
    a45: float | None = None,
    j34: float | None = None,
    j45: float | None = None,
    jerk: bool = True,
) -> Lift:
    """The Multi-Pol cam of a scene's duration, maximum lift and ramps (Kodama et al., Eq. (4) and Table 1).

    `sections_deg`: the five section angles from the ramp to the nose; `a12`, `a45` [mm/deg^2], `j34`, `j45` [mm/deg^3]:
    the levels of Table 1, of which the maximum lift determines the one left out. Further values that are left out are
    chosen for the largest area under the scene's limits, without the jerk limit if `jerk` is false. Raises InputError
    for unusable angles or levels, a scene whose two ramps differ, or limits that no member satisfies.
    """
    levels = {"a12": a12, "a45": a45, "j34": j34, "j45": j45}
    return member(scene, TABLE_1, STARTS, sections_deg, levels, jerk)


LEVELS = ("a12_mm_per_deg2", "a45_mm_per_deg2", "j34_mm_per_deg3", "j45_mm_per_deg3")
FAMILY = sectioned_family(multi_pol, TABLE_1, STARTS, LEVELS, ("#009E73", (0, (6, 1.5, 1.2, 1.5))))
