"""Cams that keep their limits when the train or the grinding is a little off: perturbations, and the judge of them."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from camopt.cam.grinding import ground
from camopt.cam.lift import Lift
from camopt.optimizer.search.judge import Judge, Judged
from camopt.scene.element import Element
from camopt.scene.errors import InputError
from camopt.scene.schema import Scene

PERTURBED_SHARE = 0.1
"""Share by which the spring's rate, its preload and the contacts' stiffness are off, one at a time."""
LASH_MM = 0.05
"""Length by which the lash is off; it is less where the lash would vanish."""
STRIDE = 4
"""A perturbed train is judged at one in so many of the search's speeds."""


@dataclass(frozen=True)
class Perturbation:
    """The scene under a perturbation, and the seed of the grinding error added to every lift, if there is one."""

    scene: Scene
    grinding_seed: int | None = None

    def applied(self, lift: Lift) -> Lift:
        """The lift as it is ground."""
        return lift if self.grinding_seed is None else ground(lift, self.grinding_seed)


def perturbations(scene: Scene, share: float = PERTURBED_SHARE, lash_mm: float = LASH_MM, seeds: int = 20) -> dict:
    """Everything that may be off, one at a time, by name: `Perturbation`s of spring, contacts, lash and grinding.

    Spring rate, preload and contact stiffness are off by the `share` [], the lash by `lash_mm`, each to both sides;
    there are `seeds` grinding errors.
    """
    found = {}
    for sign, word in ((-1, "less"), (1, "more")):
        found[f"spring rate {word}"] = Perturbation(with_spring(scene, rate=1 + sign * share))
        found[f"preload {word}"] = Perturbation(with_spring(scene, preload=1 + sign * share))
        found[f"contact stiffness {word}"] = Perturbation(with_contacts(scene, 1 + sign * share))
        found[f"lash {word}"] = Perturbation(with_lash(scene, sign * lash_mm))
    return found | {f"grinding {seed}": Perturbation(scene, seed) for seed in range(seeds)}


def valve_spring(scene: Scene) -> list[str]:
    """Names of the elements that make up the valve spring: all preloaded elements except the seat."""
    names = [e.name for e in scene.element if e.preload_N > 0 and e.name != scene.seat]
    if not names:
        raise InputError(
            f"{scene.name}: no element but the seat has preload_N > 0, so no valve spring is known: give one some"
        )
    return names


def with_spring(scene: Scene, rate: float = 1.0, preload: float = 1.0) -> Scene:
    """The scene with its valve spring's rate and preload multiplied by a factor each.

    The seat carries the spring's preload in the installed position, so it changes with it.
    """
    spring = valve_spring(scene)

    def changed(e: Element) -> dict:
        factors = {"stiffness_N_per_m": rate} if e.name in spring else {}
        return factors | ({"preload_N": preload} if e.name in (*spring, scene.seat) else {})

    return _scaled(scene, changed)


def with_contacts(scene: Scene, factor: float) -> Scene:
    """The scene with the stiffness of every contact multiplied by a factor, except of a spring that is a contact."""
    spring = valve_spring(scene)
    return _scaled(
        scene, lambda e: {"stiffness_N_per_m": factor} if e.kind == "contact" and e.name not in spring else {}
    )


def with_lash(scene: Scene, change_mm: float) -> Scene:
    """The scene with `change_mm` added to its largest gap, which is at least zero then."""
    widest = max(scene.element, key=lambda e: e.gap_mm)
    wider = widest.model_copy(update={"gap_mm": max(0.0, widest.gap_mm + change_mm)})
    return scene.model_copy(update={"element": tuple(wider if e is widest else e for e in scene.element)})


def _scaled(scene: Scene, factors) -> Scene:
    """The scene with `factors(element)`, a factor by key, applied to every element that has the key."""
    elements = []
    for e in scene.element:
        wanted = {k: f * getattr(e, k) for k, f in factors(e).items() if getattr(e, k) is not None}
        elements.append(e.model_copy(update=wanted))
    return scene.model_copy(update={"element": tuple(elements)})


@dataclass
class RobustJudge:
    """Judges a cam in its scene, then under each perturbation until one fails; the answer is the worst of them."""

    first: Judge
    perturbations: Mapping[str, Perturbation]
    worst: str = "as designed"  # name of the perturbation that the last answer belongs to
    _others: dict[str, Judge] = field(init=False)

    def __post_init__(self):
        speeds = self.first.speeds_rpm[::STRIDE]
        self._others = {name: Judge(p.scene, speeds) for name, p in self.perturbations.items()}

    @property
    def scene(self) -> Scene:
        """The scene as designed."""
        return self.first.scene

    @property
    def calls(self) -> int:
        """Number of cams that were judged."""
        return self.first.calls

    def __call__(self, lift: Lift, briefly: bool = False) -> Judged:
        worst, self.worst = self.first(lift, briefly), "as designed"
        for name, judge in self._others.items():
            if not worst.holds:
                break
            judged = judge(self.perturbations[name].applied(lift), briefly)
            if judged.share.max() > worst.share.max():
                worst, self.worst = judged, name
        return worst

    def remember(self, judged: Judged) -> None:
        """Lets the next settling start from these states."""
        self.first.remember(judged)
