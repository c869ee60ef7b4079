"""Checks of a request for a yield, which run before anything is loaded or computed."""

from camopt.measure.limits import motion_limits
from camopt.scene.errors import InputError
from camopt.scene.schema import Scene


def has_a_yield(scene: Scene) -> bool:
    """Whether a scene has both scatter (tolerances or a grinding error) and limits on the motion."""
    return bool(scene.tolerance or scene.grinding) and bool(motion_limits(scene.design))


def check_scatter(scene: Scene) -> None:
    """Raises InputError for a scene without scatter, whose trains as built would all be the same."""
    if not scene.tolerance and scene.grinding is None:
        raise InputError(
            f"{scene.name}: a yield needs [[tolerance]] or [grinding], which say how the trains as built scatter: "
            "without either, every train would be the same"
        )


def check_wanted(scene: Scene, wanted: float, speeds: str) -> None:
    """Raises InputError where no search for the yield is possible: the share `wanted` is out of range, the scene has no
    scatter or no limits on the motion, or the speeds are the nominal ones alone."""
    if not 0.5 <= wanted <= 0.999:
        raise InputError(f"yield {wanted:g}: expected a share from 0.5 to 0.999, such as 0.99")
    check_scatter(scene)
    if not motion_limits(scene.design):
        raise InputError(
            f"{scene.name}: a yield needs limits on the motion in [design]: without any, every train holds"
        )
    if speeds != "band":
        raise InputError("a yield is that of the whole band: leave out --speeds nominal")
