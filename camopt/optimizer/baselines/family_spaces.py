"""The search space of a cam family, from its record and from what the user fixes of it."""

from camopt.cam.families.record import Space, family_named
from camopt.cam.read import family_and_keywords, read_cam
from camopt.scene import InputError, Scene


def family_space(scene: Scene, family: str, jerk: bool) -> Space:
    """The search space of a family under a scene's limits, the jerk limit only with `jerk`.

    `family` is a name as of the command line, optionally with what tells its readings apart
    (`new-design:start_ratio=0,quintic=yes`). Raises InputError for an unknown family, for a parameter that the search
    chooses, and for a scene whose two ramps differ.
    """
    name, given = family_and_keywords(family)
    record = family_named(name)
    chosen = sorted(p.keyword for p in record.parameters.values() if p.searched and p.keyword in given)
    if chosen:
        raise InputError(f"baseline {family!r}: the search chooses {', '.join(chosen)}: leave it out")
    if record.space is None:
        return Space([], lambda _: read_cam(family, scene))
    return record.space(scene, jerk, **given)
