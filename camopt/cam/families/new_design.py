"""New Design of Kodama et al. (Table 2): four polynomial sections from the ramp to the nose.

The paper is ambiguous in two places, and both readings can be chosen. Section II is quartic in the text and has six
conditions in the table: a quartic takes five, so its end jerk j23 = -2 a12 / theta_II is a result; as a quintic, j23 is
free. Section I starts at a12* = 50 to 95 % of a12: with the ramp of a scene that is a step in acceleration, and the
jerk limit cannot hold there; a ratio of 0 repairs it. As in Table 1, the maximum lift is added.
"""

from collections.abc import Sequence
from dataclasses import replace

from camopt.cam.families.member import member
from camopt.cam.families.sections import Section, SectionTable, U
from camopt.cam.lift import Lift
from camopt.scene import InputError, Scene

TABLE_2 = SectionTable(
    "new-design",
    (
        Section(("y_r", U), ("v_r", U), ("a12*", "a12"), (0, U)),
        Section(("y12", U), ("v12", U), ("a12", 0), (0, "j23")),
        Section(("y23", U), ("v23", U), (0, "a34"), ("j23", "j34")),
        Section(("y34", U), ("v34", 0), ("a34", U), ("j34", 0)),
    ),
    levels=("a12", "a34", "j23", "j34"),
    closed_by=("a34",),
)
LITERAL_RATIO = 0.95
"""Upper end of the range of 50 to 95 % in Table 2; it gives the largest area."""
STARTS = (
    (0.114, 0.193, 0.264, 0.429),
    (0.028, 0.323, 0.352, 0.297),
    (0.139, 0.274, 0.345, 0.242),
    (0.243, 0.028, 0.338, 0.391),
)
"""Section angles, in shares of half the duration, of the members with the largest area under the paper's Table 4. They
belong to a ratio of 0.95, to 0, to 0 with a jerk limit of 0.003 mm/deg^3, and to a quintic section II with 0.95.
Without any start, the search of experiments/cam_families.py finds at most 2e-4 more area ratio."""


def table_2(quintic: bool, start_ratio: float) -> SectionTable:
    """Table 2 in one of its readings: section II has degree five, or degree four with its end jerk as a result."""
    multiples = {"a12*": (start_ratio, "a12")}
    if quintic:
        return replace(TABLE_2, multiples=multiples)
    first, second, *others = TABLE_2.sections
    sections = (first, replace(second, jerk=(0, U)), *others)
    return replace(TABLE_2, sections=sections, levels=("a12", "a34", "j34"), multiples=multiples)


def new_design(
    scene: Scene,
    sections_deg: Sequence[float] | None = None,
    a12: float | None = None,
    a34: float | None = None,
    j34: float | None = None,
    j23: float | None = None,
    start_ratio: float | None = None,
    quintic: bool = False,
    jerk: bool = True,
) -> Lift:
    """The New Design cam of a scene's duration, maximum lift and ramps (Kodama et al., Eq. (4) and Table 2).

    `sections_deg`: the four section angles from the ramp to the nose; `a12`, `a34` [mm/deg^2], `j34` and, where
    section II is `quintic`, `j23` [mm/deg^3]: the levels of Table 2, of which the maximum lift determines the one left
    out. What is left out beyond that is chosen for the largest area under the scene's limits, without the jerk limit
    where `jerk` is false. `start_ratio` = a12* / a12 in [0, 1]; by default 0.95, but 0 where a jerk limit must hold,
    as no step in acceleration meets one. Raises InputError for unusable angles or levels, a scene whose two ramps
    differ, or limits that no member meets.
    """
    if start_ratio is None:
        limited = jerk and scene.design is not None and scene.design.jerk_max_mm_per_deg3 is not None
        start_ratio = 0.0 if limited and a12 is None else LITERAL_RATIO
    if not 0 <= start_ratio <= 1:
        raise InputError(f"new-design: start_ratio {start_ratio}: a number from 0 to 1 is needed")
    if j23 is not None and not quintic:
        raise InputError("new-design: j23 is a level only where section II is quintic; leave it out or set quintic")
    levels = {"a12": a12, "a34": a34, "j34": j34, "j23": j23}
    reading = {"start_ratio": start_ratio, "section_II": "quintic" if quintic else "quartic"}
    return member(scene, table_2(quintic, start_ratio), STARTS, sections_deg, levels, jerk, **reading)
