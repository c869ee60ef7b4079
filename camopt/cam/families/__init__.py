'''Cam families: one file each, the equations of its author, differentiable in its free parameters.

Adding a cam family
===================

One file here and one line in `camopt.cam.families.registry.FAMILIES`. The file holds a function and a record
(`camopt.cam.families.record.Family`), which tells the command line, the gradients, the search for baselines and the
figures what they need to know of the family. The function takes a scene and the family's own
parameters as keywords and returns a `camopt.cam.lift.Lift`: polynomial pieces from -pi to pi between the scene's ramps.
A flank in sections needs no more than its table of boundary conditions, (start, end) of lift, velocity, acceleration
and jerk, as the papers print them: a symbol, 0, or U for a condition that is not given. As many conditions as a section
has, so many terms its polynomial takes. `camopt/cam/families/two_parabolas.py` would be

    """Two parabolas of acceleration: one lifts the valve, the other brings it to rest at the nose."""

    from collections.abc import Sequence

    from camopt.cam.families.sectioned import member
    from camopt.cam.families.sectioned import sectioned_family
    from camopt.cam.families.sections import Section, SectionTable, U
    from camopt.cam.lift import Lift
    from camopt.scene import Scene

    TABLE = SectionTable(
        "two-parabolas",
        (
            Section(("y_r", U), ("v_r", "v12"), (0, 0), (U, U)),  # from the ramp's height and velocity
            Section(("y12", U), ("v12", 0), (0, U), (U, 0)),  # at rest at the nose, symmetric about it
        ),
        levels=("v12",),
        closed_by=("v12",),  # the level that the maximum lift determines
    )
    STARTS = ((0.3, 0.7),)  # section angles over half the duration that a search begins with


    def two_parabolas(scene: Scene, sections_deg: Sequence[float] | None = None, jerk: bool = True) -> Lift:
        """The two-parabola cam of a scene's duration, maximum lift and ramps.

        `sections_deg`: both section angles from the ramp to the nose; by default those of the largest area under the
        scene's limits, without the jerk limit where `jerk` is false. Raises InputError for unusable angles, a scene
        whose two ramps differ, or limits that no member meets.
        """
        return member(scene, TABLE, STARTS, sections_deg, {}, jerk)


    FAMILY = sectioned_family(two_parabolas, TABLE, STARTS, line=("#2F4B7C", (0, (7, 2, 1, 2))))  # colour and dashes

and its line in `FAMILIES`,

    "two-parabolas": "camopt.cam.families.two_parabolas:FAMILY",

With that it is known to every command (`camopt cam kodama --cam two-parabolas:sections_deg=22/50`), verified like any
other cam, differentiable (`camopt.differentiable`) and searched as a baseline (`camopt compare --baselines best`).
A family that is no table of sections has its own construction, as `polydyne.py` has, and ends in `with_ramps`. Its
record may leave out what the family does not have: without `construction` it is not differentiable, without `space`
its plain member stands for it among the baselines, without `line` figures give it a colour by its name.
`tests/test_guide.py` writes this very file and this line, and runs them.
'''
