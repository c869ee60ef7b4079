"""The fixed list of extreme scenes as data: changes of a scene, applied one at a time and in pairs."""

from collections.abc import Callable, Iterator
from functools import partial
from itertools import combinations, product

import numpy as np

from camopt.scene import Scene, build_train
from camopt.scene.parameters import RATE, SceneNumber, matching, with_numbers

HEAVY = 30.0
"""Factor on every damping constant in the case of heavy damping, which overdamps the seats of the built-in scenes."""
AS_IT_IS = "as it is"
COMBINED = "kodama"
"""The scene to which every pair of changes of different kinds is applied."""


def contacts(scene: Scene, stiffness_N_per_m: float) -> Scene:
    """Gives every contact with a linear law one stiffness, except preloaded contacts that model springs."""
    stiff = max(e.stiffness_N_per_m or 0.0 for e in scene.element)
    numbers = {
        SceneNumber("element", i, RATE): stiffness_N_per_m
        for i, e in enumerate(scene.element)
        if e.kind == "contact" and e.law == "linear" and (e.stiffness_N_per_m or 0.0) > 1e-2 * stiff
    }
    return with_numbers(scene, numbers)


def times(scene: Scene, key: str, factor: float) -> Scene:
    """Multiplies the number `key` of every mass and element that has it."""
    return with_numbers(scene, {number: factor * number.of(scene) for number in matching(scene, f"*.{key}")})


def speed(scene: Scene, speed_rpm: float) -> Scene:
    """Sets the listed speeds to one crankshaft speed [r/min]."""
    operation = scene.required_operation.model_copy(update={"speeds_rpm": (speed_rpm,)})
    return scene.model_copy(update={"operation": operation})


def clearance(scene: Scene, gap_mm: float) -> Scene:
    """Puts all clearance between cam and valve into one contact: that with the largest gap, or else the cam's."""
    train = build_train(scene)
    holder = max(train.cam_side, key=lambda e: (train.gap[e], -train.cam_side.index(e)))
    gaps = {SceneNumber("element", e, "gap_mm"): gap_mm if e == holder else 0.0 for e in train.cam_side}
    return with_numbers(scene, gaps)


def fast_mode(scene: Scene, frequency_Hz: float) -> Scene:
    """Makes the mass with the highest frequency on its own elements light enough for the given frequency."""
    i, stiffness = _stiffest(scene)
    return with_numbers(scene, {SceneNumber("mass", i, "mass_kg"): stiffness / (2 * np.pi * frequency_Hz) ** 2})


def mass_ratio(scene: Scene, ratio: float) -> Scene:
    """Makes the same mass lighter than the heaviest one by a ratio; a scene with one mass is unchanged."""
    if len(scene.mass) == 1:
        return scene
    lightest = max(m.mass_kg for m in scene.mass) / ratio
    return with_numbers(scene, {SceneNumber("mass", _stiffest(scene)[0], "mass_kg"): lightest})


def pushing(scene: Scene, factor: float) -> Scene:
    """Multiplies every force that depends on the cam angle."""
    tables = [tuple((angle, factor * value) for angle, value in f.table) for f in scene.force]
    forces = [f.model_copy(update={"table": t}) for f, t in zip(scene.force, tables, strict=True)]
    return scene.model_copy(update={"force": tuple(forces)})


def _stiffest(scene: Scene) -> tuple[int, float]:
    """The mass with the highest k/m, and the sum of its elements' stiffnesses [N/m]."""
    train = build_train(scene)
    total = np.zeros(len(train.mass) + 1)  # the last entry belongs to the ground
    np.add.at(total, train.a, train.stiffness)
    np.add.at(total, train.b, train.stiffness)
    i = int(np.argmax(total[:-1] / train.mass))
    return i, float(total[i])


DAMPING, LEAK, SLIP = "damping_N_s_per_m", "leak_N_s_per_m", "slip_N"
Changes = dict[str, Callable[[Scene], Scene]]
CHANGES: dict[str, Changes] = {
    "stiffness": {
        "contacts 1e9 N/m": partial(contacts, stiffness_N_per_m=1e9),
        "contacts 1e10 N/m": partial(contacts, stiffness_N_per_m=1e10),
    },
    "damping": {
        "no damping": partial(times, key=DAMPING, factor=0.0),
        "heavy damping": partial(times, key=DAMPING, factor=HEAVY),
    },
    "speed": {"300 r/min": partial(speed, speed_rpm=300.0), "15000 r/min": partial(speed, speed_rpm=15_000.0)},
    "clearance": {"no clearance": partial(clearance, gap_mm=0.0), "clearance 1 mm": partial(clearance, gap_mm=1.0)},
    "mass": {"72 kHz mode": partial(fast_mode, frequency_Hz=72e3), "mass ratio 1e4": partial(mass_ratio, ratio=1e4)},
}
"""Changes of the scene by kind; two changes of one kind are not combined."""
OF_ELEMENTS: dict[str, Changes] = {
    LEAK: {
        "leaks a thousand times as fast": partial(times, key=LEAK, factor=1e-3),
        "hardly leaks": partial(times, key=LEAK, factor=1e3),
    },
    SLIP: {
        "slips at a thousandth": partial(times, key=SLIP, factor=1e-3),
        "slips at three times": partial(times, key=SLIP, factor=3.0),
    },
    "force": {
        "forces three times": partial(pushing, factor=3.0),
        "forces of the other sign": partial(pushing, factor=-1.0),
    },
}
"""Changes of features that only some scenes have, by the key of an element, or "force" for forces by the cam angle."""


def cases(scene: Scene) -> Iterator[tuple[str, Scene]]:
    """Named scenes: the scene as it is, then with each single change, and for COMBINED with each pair of changes."""
    yield AS_IT_IS, scene
    has = [key for key in OF_ELEMENTS if any(getattr(table, key, None) for table in (scene, *scene.element))]
    for changes in (*CHANGES.values(), *(OF_ELEMENTS[key] for key in has)):
        yield from ((name, change(scene)) for name, change in changes.items())
    if scene.name == COMBINED:
        for first, second in combinations(CHANGES.values(), 2):
            yield from ((f"{a} + {b}", second[b](first[a](scene))) for a, b in product(first, second))
