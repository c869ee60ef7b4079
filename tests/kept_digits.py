"""Small motions whose figures are kept: `python -m tests.kept_digits` writes them anew, after a change that is meant.

Each takes seconds of plain Python at most, since a mutant of a compiled program is tried without compiling it.
"""

from collections.abc import Callable
from functools import cache, partial
from pathlib import Path

import numpy as np

from camopt.cam.families.exponent import exponent
from camopt.cam.families.polydyne import polydyne
from camopt.exact import prepare, settled_metrics
from camopt.exact.adjoint.gradient import value_and_gradient
from camopt.exact.adjoint.metrics import METRICS
from camopt.measure.metrics import measure
from camopt.scene import build_train, load_scene
from camopt.scene.response import joined
from camopt.scene.rest import state_at_rest
from camopt.storage import write_json
from camopt.study.extremes.step_methods import LOCATING, STEP_METHODS

FILE = Path(__file__).parent / "data/kept-digits.json"
REAL = Path(__file__).parent / "scene/real.toml"
"""A train with every element of real trains."""


@cache
def case(name: str | Path, rpm: float) -> tuple:
    """Train, cam and cam speed."""
    scene = load_scene(name)
    return build_train(scene), (exponent if name == REAL else polydyne)(scene), scene.cam_speed(rpm)


def motion(method: Callable, name: str | Path, rpm: float, steps: int) -> np.ndarray:
    """End state of one revolution from rest, and mean sizes of positions, velocities and forces on the way."""
    train, lift, speed = case(name, rpm)
    found = method(train, lift, speed, steps)(state_at_rest(train))
    sizes = [np.abs(part).mean(axis=0) for part in (found.x, found.v, found.force)]
    return np.concatenate([found.x[-1], found.v[-1], found.memory[-1], *sizes])


def metrics() -> np.ndarray:
    """What is measured on a record of two revolutions with bounces."""
    train, lift, speed = case("motori-1", 6000)
    revolve = prepare(train, lift, speed, 180)
    first = revolve(state_at_rest(train))
    found = measure(joined([first, revolve(np.concatenate([first.x[-1], first.v[-1]]))]), lift)
    return np.concatenate(list(found.values()))


def gradient() -> np.ndarray:
    """Values of all metrics in the first revolution and their slopes by cam and train."""
    found = value_and_gradient(*case("motori-1", 12000), METRICS, mechanical=True)
    assert found.by_train is not None
    slopes = [found.by_coefficients.sum(axis=1).ravel(), found.by_train.stiffness.ravel(), found.by_train.mass.ravel()]
    return np.concatenate([found.values, *slopes])


def settled() -> np.ndarray:
    """Metrics of a motion that settles at once."""
    found = settled_metrics(*([one] for one in case("motori-1", 3000)))
    return np.concatenate(
        [found.states.ravel(), *(found.worst(name).ravel() for name in ("bounce_mm", "contact_force_min_N"))]
    )


FIGURES: dict[str, Callable[[], np.ndarray]] = {
    **{f"{name}-one-mass": partial(motion, LOCATING[name], "motori-1", 6000, 180) for name in LOCATING},
    **{f"{name}-one-mass": partial(motion, STEP_METHODS[name], "motori-1", 6000, 720) for name in STEP_METHODS},
    **{f"{name}-real": partial(motion, LOCATING[name], REAL, 6000, 180) for name in LOCATING},
    **{f"{name}-real": partial(motion, STEP_METHODS[name], REAL, 3000, 720) for name in STEP_METHODS},
    "metrics": metrics,
    "gradient": gradient,
    "settled": settled,
}

if __name__ == "__main__":
    write_json(FILE, {name: figures() for name, figures in FIGURES.items()})
