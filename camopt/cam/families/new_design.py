"""New Design of Kodama et al. (Table 2): four polynomial sections from the ramp to the nose.

The paper is ambiguous in two places, and both readings can be chosen. Section II is quartic in the text but has six
conditions in the table. A quartic satisfies five, so that its end jerk j23 = -2 a12 / theta_II is a result; with a
quintic, j23 is free. Section I starts at a12* = 50 to 95 % of a12, which after the ramp of a scene is a step in
acceleration, where no jerk limit holds; a ratio of 0 avoids the step. The maximum lift is added, as in Table 1.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from camopt.cam.families.record import Family, Parameter, Space, number, yes_or_no
from camopt.cam.families.sectioned import member, section_parameters, sections_construction, sections_space
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
START_RATIOS = 0.5, 0.95
"""Range of a12* / a12 in Table 2; its upper end gives the largest area."""
STARTS = (
    (0.114, 0.193, 0.264, 0.429),
    (0.028, 0.323, 0.352, 0.297),
    (0.139, 0.274, 0.345, 0.242),
    (0.243, 0.028, 0.338, 0.391),
)
"""Section angles, as shares of half the duration, of the members with the largest area under the paper's Table 4. They
belong to a ratio of 0.95, to 0, to 0 with a jerk limit of 0.003 mm/deg^3, and to a quintic section II with 0.95.
Without any start, the search of experiments/cam_families.py finds at most 2e-4 more area ratio."""


def table_2(reading: Mapping[str, Any]) -> SectionTable:
    """Table 2 with a `start_ratio` and a `section_II`, a quintic or a quartic with its end jerk as a result."""
    multiples = (("a12*", reading["start_ratio"], "a12"),)
    if reading["section_II"] == "quintic":
        return replace(TABLE_2, multiples=multiples)
    first, second, *others = TABLE_2.sections
    sections = (first, replace(second, jerk=(0, U)), *others)
    return replace(TABLE_2, sections=sections, levels=("a12", "a34", "j34"), multiples=multiples)


def new_design(
    scene: Scene,
    sections_deg: Sequence[float] | None = None,
    a12: float | None = None,
    *,
    a34: float | None = None,
    j34: float | None = None,
    j23: float | None = None,
    start_ratio: float | None = None,
    quintic: bool = False,
    jerk: bool = True,
) -> Lift:
    """The New Design cam of a scene's duration, maximum lift and ramps (Kodama et al., Eq. (4) and Table 2).

    `sections_deg`: the four section angles from the ramp to the nose; `a12`, `a34` [mm/deg^2], `j34` and, if section II
    is `quintic`, `j23` [mm/deg^3]: the levels of Table 2, of which the maximum lift determines the one left out.
    Further values that are left out are chosen as by `camopt.multi_pol`, and the same errors are raised. `start_ratio`
    = a12* / a12 in [0, 1] is 0.95 by default, but 0 under a jerk limit, which a step in acceleration would violate.
    """
    if start_ratio is None:
        start_ratio = 0.0 if _jerk_limited(scene, jerk) and a12 is None else START_RATIOS[1]
    if not 0 <= start_ratio <= 1:
        raise InputError(f"new-design: start_ratio {start_ratio}: a number from 0 to 1 is needed")
    if j23 is not None and not quintic:
        raise InputError("new-design: j23 is a level only where section II is quintic; leave it out or set quintic")
    levels = {"a12": a12, "a34": a34, "j34": j34, "j23": j23}
    reading = {"start_ratio": start_ratio, "section_II": "quintic" if quintic else "quartic"}
    return member(scene, table_2(reading), STARTS, sections_deg, levels, jerk, **reading)


def _jerk_limited(scene: Scene, jerk: bool) -> bool:
    return jerk and scene.design is not None and scene.design.jerk_max_mm_per_deg3 is not None


def _space(scene: Scene, jerk: bool, start_ratio: float | None = None, quintic: bool = False) -> Space:
    """The search space: the start ratio varies in the range of Table 2; under a jerk limit it can only be 0."""
    if start_ratio is None and _jerk_limited(scene, jerk):
        start_ratio = 0.0
    reading = {"start_ratio": start_ratio, "section_II": "quintic" if quintic else "quartic"}
    free_settings = {"start_ratio": START_RATIOS} if start_ratio is None else {}
    return sections_space(scene, jerk, table_2, STARTS, reading, free_settings)


FAMILY = Family(
    "new-design",
    new_design,
    section_parameters(["a12_mm_per_deg2", "a34_mm_per_deg2", "j34_mm_per_deg3", "j23_mm_per_deg3"])
    | {
        "start_ratio": Parameter("start_ratio", number, searched=False),
        "quintic": Parameter("quintic", yes_or_no, searched=False),
    },
    lambda _, cam: sections_construction(cam, table_2, ["start_ratio"]),
    space=_space,
    line=("#B0518E", (0, (1.3, 1.1))),
)
