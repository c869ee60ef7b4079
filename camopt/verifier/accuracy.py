"""What `--accuracy` means to the verifier, and the public function `camopt.verify`.

docs/explanation/accuracy.md explains which accuracy to choose; `camopt.optimizer.accuracy` is the optimiser's effort.
Every metric has an error estimate from the last halvings. If the motion does not settle, the answer is a range.
"""

import json
import math
from dataclasses import dataclass, field, replace
from functools import cache
from importlib import resources

import numpy as np

from camopt.cam.lift import Lift
from camopt.scene.errors import InputError
from camopt.scene.schema import Scene
from camopt.scene.settled import SETTLED_POSITION
from camopt.scene.train import Train, build_train
from camopt.scene.units import MM, UM
from camopt.verifier import DRAFT, FINE, STANDARD
from camopt.verifier.convergence import FINEST, Tolerances
from camopt.verifier.from_outside import from_outside, require_outside
from camopt.verifier.verdict import METHODS, Verdict, methods_for, verdict_on

FILE = "accuracy_curves.json"
"""File of the stored work-precision curves, which `python -m experiments.accuracy_curves` measures and writes."""


@dataclass(frozen=True)
class Effort:
    """The methods that must agree, the step with which the band is swept, and the tolerances of convergence."""

    methods: tuple[str, ...]
    band_step_rpm: float
    tolerances: Tolerances = field(default_factory=Tolerances)

    def methods_of(self, train: Train) -> tuple[str, ...]:
        """The methods for a train: as many as the effort has, out of those that can simulate the train's laws."""
        return methods_for(train)[: len(self.methods)]


EFFORTS = {
    DRAFT: Effort(("event", "rkg"), 100.0, Tolerances(5.0, unchanged_halvings=1, spot_checks=True)),
    STANDARD: Effort(("event", "rkg", "tmm"), 20.0),
    FINE: Effort(METHODS, 5.0, Tolerances(1.0)),
}


def effort_of(accuracy: str | float) -> Effort:
    """The effort of a named accuracy, or of a tolerance in micrometres; raises InputError for an unknown name.

    For a number, the step of the band and the settling tolerance are the coarsest for which the largest bounce was
    right within that number, and the settled bounce within half of it, in nine out of ten scenes of the stored curves,
    but not coarser than those of "draft". No tolerance is below the smallest stated error.
    """
    if isinstance(accuracy, str):
        if accuracy not in EFFORTS:
            raise InputError(f"accuracy {accuracy!r}: expected {', '.join(EFFORTS)} or a number of micrometres")
        return EFFORTS[accuracy]
    tolerance_um, curves = float(accuracy), stored_curves()
    if not (math.isfinite(tolerance_um) and tolerance_um > 0):
        raise InputError(f"accuracy {accuracy}: a number of micrometres above 0 is needed")
    band_step = min(EFFORTS[DRAFT].band_step_rpm, round(curves["band_step"].coarsest(tolerance_um)))
    settled_um = min(SETTLED_POSITION / UM, curves["settling"].coarsest(0.5 * tolerance_um), tolerance_um)
    tolerance_um, settled_um = (max(um, FINEST["bounce_mm"] * MM / UM) for um in (tolerance_um, settled_um))
    return Effort(EFFORTS[STANDARD].methods, band_step, Tolerances(tolerance_um, position=settled_um * UM))


@dataclass(frozen=True)
class Curve:
    """Errors [um] at k ascending settings: the median and the 90th percentile over scenes drawn at random.

    A curve only chooses the first setting of a run; the delivered error is estimated on the run itself.
    """

    setting: np.ndarray
    median_um: np.ndarray
    p90_um: np.ndarray

    def coarsest(self, error_um: float, typical: bool = False) -> float:
        """The coarsest setting with an error of at most `error_um` in nine scenes out of ten, or in half if `typical`.

        It is interpolated between the measured settings on logarithmic scales, and never lies outside their range.
        """
        # where the curve is not monotonic, the error of a setting is the largest one at this setting or a finer one
        error = np.maximum.accumulate(self.median_um if typical else self.p90_um)
        least = np.finfo(float).tiny
        rising = np.log(np.maximum(error, least)) + 1e-9 * np.arange(len(error))
        return float(np.exp(np.interp(np.log(error_um), rising, np.log(self.setting))))


@cache
def stored_curves() -> dict[str, Curve]:
    """The stored curves by the setting that is varied: a method's steps, "settling" or "band_step"."""
    text = (resources.files("camopt.verifier") / FILE).read_text(encoding="utf-8")
    curves, keys = json.loads(text)["curves"], ("setting", "median_um", "p90_um")
    return {name: Curve(*(np.array(curve[key], dtype=float) for key in keys)) for name, curve in curves.items()}


def verify(
    scene: Scene,
    lift: Lift,
    speeds_rpm: tuple[float, ...] | None = None,
    methods: str = "all",
    accuracy: str | float = "standard",
    progress: bool = False,
    outside: bool = False,
) -> Verdict:
    """Judges a cam at `speeds_rpm` (k) [r/min of the crankshaft; the scene's by default] and over the scene's band.

    `methods` is "all", which means all methods that can simulate the scene's laws (for "draft" the first two of them),
    or one of "event", "rkg", "tmm", "houbolt" and "dop853". A single method gives metrics, but no agreement, and
    therefore never confirms a cam. `accuracy` is "draft", "standard", "fine" or a number of micrometres; the verdict
    states it together with the error estimated for the result, whether or not the accuracy was reached. With
    `progress`, progress bars count the judged speeds. With `outside`, Exudyn simulates the valve's motion from rest as
    well (`camopt.verifier.from_outside`); if it disagrees beyond the stated errors, the verdict is "not converged".
    Raises InputError for a scene or cam that cannot be judged, and if Exudyn is requested but not installed.
    """
    if outside:
        require_outside()
    if not isinstance(lift, Lift):
        raise InputError(f"verify: {lift!r} in place of a cam: expected one, as camopt.read_cam or a family gives it")
    effort = effort_of(accuracy)
    available = methods_for(build_train(scene))[: 2 if accuracy == DRAFT else None]
    names = available if methods == "all" else (methods,)
    verdict = verdict_on(scene, lift, speeds_rpm, names, effort.band_step_rpm, effort.tolerances, progress=progress)
    verdict = replace(verdict, asked=accuracy)
    if not outside:
        return verdict
    entries = from_outside(scene, lift, [s.speed_rpm for s in verdict.speeds])
    agreed = verdict.verdict if all(entry["agrees"] for entry in entries) else "not converged"
    return replace(verdict, outside=entries, verdict=agreed)
