"""What `--accuracy` means to the verifier, and the verdict as the command line asks for it.

Choosing an accuracy
====================

- **draft** while you try things: the band in steps of 100 r/min and a verdict within seconds. Event-exact looks at
  every speed, a second method where a limit is nearest: at the worst speed of each limited figure and of the peak
  force, and at both ends; its step is halved once. The verdict says at which speeds. A cam that draft rejects is
  rejected; one that draft confirms may still be caught between its speeds.
- **standard** for what you keep: every method (the optimiser asks three), 20 r/min, halved steps may move 2 um.
- **fine** before anything is ground: every method, 5 r/min, 1 um. Minutes.
- A number of micrometres, for `verify`, is `standard` with that tolerance: below 1 it takes long where
  the cam bounces, because methods that locate no switching converge with the first power of their step there.

The name also sets the optimiser's effort (`camopt.optimizer.accuracy`: knots, speeds, steps, margins). What was asked
and what was delivered stand side by side in every verification: each figure has its error, estimated from the last
halvings, and a figure whose error is large says so instead of being wrong. Beyond the jump the motion does not settle
and no accuracy helps: there the answer is a range.

Where time matters more, use a smaller model (`camopt reduce`, which tells its error) or fewer speeds rather than a
looser tolerance: with event-exact the price of an accurate motion is a fraction of a millisecond. Prices on a scene of
your own: `camopt tradeoff SCENE`. How often what is delivered is what was asked (534 of 535 promises kept over 200
drawn scenes, cams and speeds; 2.6 % of the good answers flagged): `python -m experiments.accuracy_promise`.
"""

import math
from dataclasses import dataclass, replace

from camopt.cam.lift import Lift
from camopt.scene.errors import InputError
from camopt.scene.schema import Scene
from camopt.scene.settled import SETTLED_POSITION
from camopt.scene.train import Train, build_train
from camopt.scene.units import MM, UM
from camopt.verifier.convergence import FINEST, Demand
from camopt.verifier.from_outside import from_outside, require_outside
from camopt.verifier.stored_curves import stored_curves
from camopt.verifier.verdict import METHODS, Verdict, methods_for, verdict_on


@dataclass(frozen=True)
class Effort:
    """The effort of a verdict: the methods that must agree, and the step with which the band is swept.

    `tolerance_um` is how far halving a method's step may still move bounce and jump; `settled_um` is how far the state
    of a settled motion may still move over a revolution.
    """

    methods: tuple[str, ...]
    band_step_rpm: float
    tolerance_um: float
    settled_um: float = SETTLED_POSITION / UM
    everywhere: bool = True
    stands: int = 2

    def methods_of(self, train: Train) -> tuple[str, ...]:
        """As many methods for a train as the effort has: its own, or those that carry the train's laws."""
        return methods_for(train)[: len(self.methods)]

    @property
    def demand(self) -> Demand:
        """What is asked of every method: no more than the least error that is ever stated, which would be in vain."""
        tolerance_um, settled_um = (
            max(um, FINEST["bounce_mm"] * MM / UM) for um in (self.tolerance_um, self.settled_um)
        )
        return Demand(tolerance_um, position=settled_um * UM, everywhere=self.everywhere, stands=self.stands)


EFFORTS = {
    "draft": Effort(("event", "rkg"), 100.0, 5.0, everywhere=False, stands=1),
    "standard": Effort(("event", "rkg", "tmm"), 20.0, 2.0),
    "fine": Effort(METHODS, 5.0, 1.0),
}


def effort_of(accuracy: str | float) -> Effort:
    """The effort of a named accuracy, or of a tolerance in micrometres; raises InputError for an unknown one.

    For a number, the stored curves choose the band's step and the settling. They are the coarsest with which, in nine
    draws out of ten, the largest bounce was right within that number and the settled bounce within half of it; neither
    is coarser than that of "draft".
    """
    if isinstance(accuracy, str):
        if accuracy not in EFFORTS:
            raise InputError(f"accuracy {accuracy!r}: expected {', '.join(EFFORTS)} or a number of micrometres")
        return EFFORTS[accuracy]
    asked, draft, curves = float(accuracy), EFFORTS["draft"], stored_curves()
    if not (math.isfinite(asked) and asked > 0):
        raise InputError(f"accuracy {accuracy}: a number of micrometres above 0 is needed")
    band_step = min(draft.band_step_rpm, round(curves["band_step"].coarsest(asked)))
    settled = min(draft.settled_um, curves["settling"].coarsest(0.5 * asked), asked)
    return Effort(EFFORTS["standard"].methods, band_step, asked, settled)


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

    `methods` is "all", which means those that can simulate the scene's laws (for "draft" the first two of them), or one
    of "event", "rkg", "tmm", "houbolt" and "dop853". One method alone gives figures but no agreement, and so never
    confirms. `accuracy` is a name of EFFORTS or a number of micrometres; the verdict says what was asked and what error
    is estimated for what was delivered, at best where it was not reached: every method halves its step so many times at
    most (`camopt.verifier.convergence.Demand`). With `progress` bars count the speeds that have been judged. With
    `outside` Exudyn moves the valve from rest too, at the same speeds (`camopt.verifier.from_outside`): it decides
    nothing, but where it disagrees beyond the stated errors the verdict is "not converged". Raises InputError for what
    cannot be judged, and where Exudyn is asked for and missing.
    """
    if outside:
        require_outside()
    if not isinstance(lift, Lift):
        raise InputError(f"verify: {lift!r} in place of a cam: expected one, as camopt.read_cam or a family gives it")
    effort = effort_of(accuracy)
    every = methods_for(build_train(scene))[: 2 if accuracy == "draft" else None]
    asked = every if methods == "all" else (methods,)
    verdict = verdict_on(scene, lift, speeds_rpm, asked, effort.band_step_rpm, effort.demand, progress=progress)
    verdict = replace(verdict, asked=accuracy)
    if not outside:
        return verdict
    found = from_outside(scene, lift, [s.speed_rpm for s in verdict.speeds])
    agreed = verdict.verdict if all(one.agrees for one in found) else "not converged"
    return replace(verdict, outside=found, verdict=agreed)
