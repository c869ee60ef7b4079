"""The fixed list of extremes as data: what is changed in a scene, one change at a time and two at a time."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np

from camopt.scene import Scene, build_train
from camopt.scene.parameters import RATE, SceneNumber, matching, with_numbers

Change = Callable[[Scene], Scene]
HEAVY = 30.0
"""Factor of every damping constant in the case of heavy damping: the seats of the built-in scenes are over-damped then.
"""
DAMPING = "damping_N_s_per_m"
AS_IT_IS = "as it is"
COMBINED = "kodama"
"""The scene on which every two changes of different kinds are combined."""


@dataclass(frozen=True)
class ExtremeCase:
    """One extreme: its name, the changed scene and the crankshaft speed [r/min]."""

    name: str
    scene: Scene
    speed_rpm: float


def contacts(stiffness_N_per_m: float) -> Change:
    """Gives one stiffness to every contact with a linear law, except preloaded contacts that stand for springs."""

    def changed(scene: Scene) -> Scene:
        stiff = max(e.stiffness_N_per_m or 0.0 for e in scene.element)
        for i, e in enumerate(scene.element):
            if e.kind == "contact" and e.law == "linear" and (e.stiffness_N_per_m or 0.0) > 1e-2 * stiff:
                scene = with_numbers(scene, {SceneNumber("element", i, RATE): stiffness_N_per_m})
        return scene

    return changed


def times(key: str, factor: float) -> Change:
    """Multiplies a number of every mass and element that has it."""

    def changed(scene: Scene) -> Scene:
        return with_numbers(scene, {number: factor * number.of(scene) for number in matching(scene, f"*.{key}")})

    return changed


def clearance(gap_mm: float) -> Change:
    """Puts all the clearance between cam and valve into one contact: where the scene has it, or else at the cam."""

    def changed(scene: Scene) -> Scene:
        train = build_train(scene)
        holds = max(train.cam_side, key=lambda e: (train.gap[e], -train.cam_side.index(e)))
        gaps = {e: gap_mm if e == holds else 0.0 for e in train.cam_side}
        return with_numbers(scene, {SceneNumber("element", e, "gap_mm"): gap for e, gap in gaps.items()})

    return changed


def fast_mode(frequency_Hz: float) -> Change:
    """Makes the mass with the highest frequency on its own elements as light as the given frequency requires."""

    def changed(scene: Scene) -> Scene:
        i, stiffness = _stiffest(scene)
        return _with_mass(scene, i, stiffness / (2 * np.pi * frequency_Hz) ** 2)

    return changed


def mass_ratio(ratio: float) -> Change:
    """Makes the same mass lighter than the heaviest one by a ratio; a scene of one mass stays as it is."""

    def changed(scene: Scene) -> Scene:
        if len(scene.mass) == 1:
            return scene
        return _with_mass(scene, _stiffest(scene)[0], max(m.mass_kg for m in scene.mass) / ratio)

    return changed


def pushing(factor: float) -> Change:
    """Multiplies every force by the cam angle."""

    def changed(scene: Scene) -> Scene:
        tables = [tuple((angle, factor * force) for angle, force in f.table) for f in scene.force]
        forces = [f.model_copy(update={"table": t}) for f, t in zip(scene.force, tables, strict=True)]
        return scene.model_copy(update={"force": tuple(forces)})

    return changed


def _stiffest(scene: Scene) -> tuple[int, float]:
    """The mass with the highest k/m, and the sum of its elements' stiffnesses [N/m]."""
    train = build_train(scene)
    total = np.zeros(len(train.mass) + 1)  # the last is the ground
    np.add.at(total, train.a, train.stiffness)
    np.add.at(total, train.b, train.stiffness)
    i = int(np.argmax(total[:-1] / train.mass))
    return i, float(total[i])


def _with_mass(scene: Scene, i: int, mass_kg: float) -> Scene:
    return with_numbers(scene, {SceneNumber("mass", i, "mass_kg"): mass_kg})


CHANGES: dict[str, dict[str, Change | float]] = {
    "stiffness": {"contacts 1e9 N/m": contacts(1e9), "contacts 1e10 N/m": contacts(1e10)},
    "damping": {"no damping": times(DAMPING, 0.0), "heavy damping": times(DAMPING, HEAVY)},
    "speed": {"300 r/min": 300.0, "15000 r/min": 15_000.0},
    "clearance": {"no clearance": clearance(0.0), "clearance 1 mm": clearance(1.0)},
    "mass": {"72 kHz mode": fast_mode(72e3), "mass ratio 1e4": mass_ratio(1e4)},
}
"""Changes of the scene, or crankshaft speeds [r/min], by their kind; two of a kind are not combined."""

OF_ELEMENTS: dict[str, dict[str, Change]] = {
    "leak_N_s_per_m": {
        "leaks a thousand times as fast": times("leak_N_s_per_m", 1e-3),
        "hardly leaks": times("leak_N_s_per_m", 1e3),
    },
    "slip_N": {"slips at a thousandth": times("slip_N", 1e-3), "slips at three times": times("slip_N", 3.0)},
    "force": {"forces three times": pushing(3.0), "forces of the other sign": pushing(-1.0)},
}
"""Changes of what only some scenes have, by the key of an element or, for forces by the cam angle, of the scene."""


def cases(scene: Scene) -> Iterator[ExtremeCase]:
    """The scene as it is at its highest listed speed, then with every single change, and on COMBINED with every two."""
    assert scene.operation is not None, "load_scene(..., need='operation') guarantees it"
    top = max(scene.operation.speeds_rpm)
    yield ExtremeCase(AS_IT_IS, scene, top)
    for kind in CHANGES:
        for name in CHANGES[kind]:
            yield _changed(scene, top, {name: CHANGES[kind][name]})
    for key, changes in OF_ELEMENTS.items():
        if getattr(scene, key, None) or any(getattr(e, key, None) is not None for e in scene.element):
            for name, change in changes.items():
                yield _changed(scene, top, {name: change})
    if scene.name == COMBINED:
        for one, other in combinations(CHANGES.values(), 2):
            for a, b in product(one, other):
                yield _changed(scene, top, {a: one[a], b: other[b]})


def _changed(scene: Scene, speed_rpm: float, changes: dict[str, Change | float]) -> ExtremeCase:
    for change in changes.values():
        if callable(change):
            scene = change(scene)
        else:
            speed_rpm = change
    return ExtremeCase(" + ".join(changes), scene, speed_rpm)
