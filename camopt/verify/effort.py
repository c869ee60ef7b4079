"""What `--accuracy` means to the verifier, and the verdict as the command line asks for it."""

from dataclasses import dataclass

from camopt.cam.lift import Lift
from camopt.scene.errors import InputError
from camopt.scene.schema import Scene
from camopt.scene.train import build_train
from camopt.verify.verdict import METHODS, Verdict, methods_for, verify


@dataclass(frozen=True)
class Effort:
    """Methods that must agree, step of the band, and what halving a method's step may still move."""

    methods: tuple[str, ...]
    band_step_rpm: float
    tolerance_um: float


EFFORTS = {
    "draft": Effort(("event", "rkg"), 100.0, 5.0),
    "standard": Effort(("event", "rkg", "tmm"), 20.0, 2.0),
    "fine": Effort(METHODS, 5.0, 1.0),
}


def effort_of(accuracy: str | float) -> Effort:
    """The effort of a named accuracy, or of a tolerance in micrometres; raises InputError for an unknown one."""
    if isinstance(accuracy, str):
        if accuracy not in EFFORTS:
            raise InputError(f"accuracy {accuracy!r}: expected {', '.join(EFFORTS)} or a number of micrometres")
        return EFFORTS[accuracy]
    return Effort(EFFORTS["standard"].methods, EFFORTS["standard"].band_step_rpm, float(accuracy))


def verify_cam(
    scene: Scene,
    lift: Lift,
    speeds_rpm: tuple[float, ...] | None = None,
    methods: str = "all",
    accuracy: str | float = "standard",
) -> Verdict:
    """Judge a cam at `speeds_rpm` (crankshaft; the scene's by default) and over the scene's band.

    `methods` "all" (those that carry the scene's laws; for "draft" the first two) or one of "event", "rkg", "tmm",
    "houbolt", "dop853": one method alone gives figures but no agreement, and so never confirms. `accuracy`: a name of
    EFFORTS or micrometres. Raises InputError for what cannot be judged.
    """
    effort = effort_of(accuracy)
    every = methods_for(build_train(scene))[: 2 if accuracy == "draft" else None]
    asked = every if methods == "all" else (methods,)
    return verify(scene, lift, speeds_rpm, asked, effort.band_step_rpm, effort.tolerance_um)
