"""Small motions whose results are stored: `python -m tests.kept_digits` writes them again after an intended change.

Each takes at most seconds in plain Python, since mutants of compiled programs are tried without compiling them.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest

from camopt.cam.families.exponent import exponent
from camopt.cam.families.polydyne import polydyne
from camopt.exact import prepare, settled_metrics
from camopt.exact.adjoint.metrics import METRICS
from camopt.exact.adjoint.motion import Gradient, Slopes, TracedMotion, value_and_gradient
from camopt.exact.kernel import propagators
from camopt.measure.metrics import measure
from camopt.scene import MotionRefused, build_train, load_scene
from camopt.scene.response import joined
from camopt.scene.rest import state_at_rest
from camopt.storage import write_json
from camopt.study.extremes.extremes import LOCATING, STEP_METHODS
from tests.exact.small_trains import STILL, one_mass

FILE = Path(__file__).parent / "data/kept-digits.json"
REAL = Path(__file__).parent / "scene/real.toml"
"""A train with every element of real trains."""
WEIGHTS = 1.0 / (3.0 + np.arange(len(METRICS)))
"""Weights of the metrics in a gradient, so that one adjoint sweep depends on all of them."""
NOTHING = 1e-9
"""Part of the largest number of an array below which other numbers are rounding errors."""
CURVED = (
    'kind = "contact"\nbetween = ["ground", "m"]\nlaw = "hertz"\nstiffness_N_per_m = 1.0e9\ndamping_N_s_per_m = 40.0',
    """kind = "spring"
between = ["m", "ground"]
law = "progressive"
preload_N = 50.0
stiffness_table = [[0, 2.0e4], [4, 3.0e4], [5, 9.0e4]]""",
)
"""A mass that falls onto a Hertz contact under a progressive spring."""


@cache
def case(name: str | Path, rpm: float) -> tuple:
    """Train, cam and cam speed."""
    scene = load_scene(name)
    return build_train(scene), (exponent if name == REAL else polydyne)(scene), scene.cam_speed(rpm)


@cache
def soft() -> tuple:
    """The same of the train `REAL` with a twenty-fifth of the stiffnesses, so that a revolution has a fifth of the
    steps, and with an adjuster that leaks fifty times as fast, so that the valve seats before its nominal closing."""
    train, lift, speed = case(REAL, 6000)
    stiffness = train.stiffness / 25.0
    laws = replace(train.laws, coefficient=train.laws.coefficient / 25.0, leak=train.laws.leak / 50.0)
    return replace(train, stiffness=stiffness, damping=train.damping / 5.0, laws=laws), lift, speed


def motion(method: Callable, name: str | Path, rpm: float, steps: int) -> np.ndarray:
    """End state of one revolution from rest, and mean magnitudes of positions, velocities and forces over it."""
    train, lift, speed = case(name, rpm)
    return sizes(method(train, lift, speed, steps)(state_at_rest(train)))


def curved(method: Callable, steps: int) -> np.ndarray:
    """The same of `CURVED` over 10 ms, starting at 3 mm with 1 m/s towards the contact."""
    train = one_mass(*CURVED, mass_kg=0.4)
    return sizes(method(train, STILL, 200.0 * np.pi, steps)(np.array([3e-3, -1.0])))


def sizes(response) -> np.ndarray:
    """The numbers of `motion`."""
    means = [np.abs(part).mean(axis=0) for part in (response.x, response.v, response.force)]
    return np.concatenate([response.x[-1], response.v[-1], response.memory[-1], *means])


def metrics() -> np.ndarray:
    """All metrics of a record of two revolutions with bounces."""
    train, lift, speed = case("motori-1", 6000)
    revolve = prepare(train, lift, speed, 180)
    first = revolve(state_at_rest(train))
    values = measure(joined([first, revolve(np.concatenate([first.x[-1], first.v[-1]]))]), lift)
    return np.concatenate(list(values.values()))


def gradient(moving: Callable[[], tuple], moved: float = 0.0) -> np.ndarray:
    """All metrics of the first revolution, started `moved` [m] from rest, and the gradient of their weighted sum."""
    train, lift, speed = moving()
    start = state_at_rest(train)
    start[-1] -= moved
    return numbers(value_and_gradient(train, lift, speed, METRICS, start, cotangent=WEIGHTS, mechanical=True))


def from_rest() -> np.ndarray:
    """Separate gradients of the forces without separation, from rest, whose position depends on the train; spans end at
    borders of pieces."""
    gradients = value_and_gradient(*case("motori-1", 4000), METRICS[3:5], mechanical=True, spacing=np.radians(6.0))
    return numbers(gradients)


def traced() -> np.ndarray:
    """Samples of a traced motion and their gradients."""
    train, lift, speed = soft()
    traced_motion = TracedMotion(train, lift, speed, state_at_rest(train), mechanical=True)
    angles = np.array([-1.0, -0.3, 0.4, 1.7])
    at = traced_motion.at(angles)
    bars = type(at)(
        **{name: np.cos(1.0 + np.arange(part.size)).reshape(1, *part.shape) for name, part in vars(at).items()}
    )
    parts = [*(part.ravel() for part in vars(at).values()), traced_motion.values(METRICS)]
    return np.concatenate([*(cleaned(part) for part in parts), numbers(traced_motion.pull_back(angles, bars))])


def many() -> np.ndarray:
    """Motions for which the memory of a trace has to grow, and one that is refused."""
    train, lift, speed = case("motori-1", 12000)
    train = replace(train)  # with its own tables and workspace
    higher, weighted = replace(lift, coefficients=1.01 * lift.coefficients), []
    with patch.object(propagators, "FIRST_SEGMENTS", 4):
        with pytest.raises(MotionRefused):
            value_and_gradient(train, lift, speed, METRICS, np.array([np.nan, 0.0]), cotangent=WEIGHTS)
        for cam, start in ((lift, state_at_rest(train)), (higher, np.array([1e-4, 0.1]))):
            weighted.append(value_and_gradient(train, cam, speed, METRICS, start, cotangent=WEIGHTS))
    return np.concatenate([numbers(one) for one in weighted])


def settled(moving: Callable[[], tuple], **options) -> np.ndarray:
    """Metrics of a motion that settles at once, or is treated as settled."""
    result = settled_metrics(*([one] for one in moving()), workers=1, **options)
    return np.concatenate([result.states.ravel(), *(result.worst(name).ravel() for name in result.lowest)])


def numbers(slopes: Slopes) -> np.ndarray:
    """All numbers of a gradient in one array; the pieces of the lift are summed with different weights."""
    by_powers = np.einsum("lpq,p->lq", slopes.by_coefficients, np.cos(np.arange(slopes.by_coefficients.shape[1])))
    parts = [by_powers, slopes.by_start, *(vars(slopes.by_train).values() if slopes.by_train else ())]
    if isinstance(slopes, Gradient):
        parts += [slopes.values, slopes.runner_up, slopes.end, np.array(list(vars(slopes.grazing).values()))]
    return np.concatenate([cleaned(np.ravel(part)) for part in parts if part is not None])


def cleaned(row: np.ndarray) -> np.ndarray:
    """An array with rounding errors set to zero and infinite numbers replaced by NaN, for JSON."""
    row = np.where(np.isfinite(row), row, np.nan)
    return np.where(np.abs(row) < NOTHING * np.nanmax(np.abs(row), initial=0.0), 0.0, row)


CURVING = LOCATING | {"rkg": STEP_METHODS["rkg"]}
"""Methods that support nonlinear laws."""
FIGURES: dict[str, Callable[[], np.ndarray]] = {
    **{f"{name}-one-mass": partial(motion, LOCATING[name], "motori-1", 6000, 180) for name in LOCATING},
    **{f"{name}-one-mass": partial(motion, STEP_METHODS[name], "motori-1", 6000, 720) for name in STEP_METHODS},
    **{f"{name}-real": partial(motion, LOCATING[name], REAL, 6000, 180) for name in LOCATING},
    **{f"{name}-real": partial(motion, STEP_METHODS[name], REAL, 6000, 720) for name in STEP_METHODS},
    **{f"{name}-curved": partial(curved, method, 300) for name, method in CURVING.items()},
    "metrics": metrics,
    "gradient": partial(gradient, partial(case, "motori-1", 12000)),
    "gradient-real": partial(gradient, soft, 2e-4),
    "gradient-from-rest": from_rest,
    "traced": traced,
    "many": many,
    "settled": partial(settled, partial(case, "motori-1", 3000)),
    "settled-bouncing": partial(settled, partial(case, "motori-1", 12000), most=2, measured=1),
}

if __name__ == "__main__":
    write_json(FILE, {name: figures() for name, figures in FIGURES.items()})
