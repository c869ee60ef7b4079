"""The neighbourhood of a settled motion, and the limits held against all of it with the estimated error."""

from dataclasses import replace

import numpy as np

from camopt.cam.lift import Lift
from camopt.measure.limits import motion_limits
from camopt.measure.settling import Figures, decay_per_revolution, settle_and_measure
from camopt.measure.sweep import SettledMany
from camopt.scene.laws import OIL
from camopt.scene.rest import state_at_rest
from camopt.scene.schema import Scene
from camopt.scene.train import Train, build_train
from camopt.verifier.convergence import WANDERING_REVOLUTIONS, Converged, Prepare, at_once

SPEED_NEIGHBOUR = 1e-3
LIFT_NEIGHBOUR = 1e-7  # m, at the largest lift
OTHER_STARTS = (2, 5)
"""Which of the neighbours have the speed and the lift themselves, and begin in another state."""
STATE_NEIGHBOUR = (1e-6, 1e-3)  # m (and m of a memory), m/s: as far apart as two states that count as settled


def neighbours(
    prepare: Prepare, train: Train, lift: Lift, cam_speed: float, answer: Converged, many: SettledMany | None = None
) -> list[Figures]:
    """Figures at neighbouring speeds (+-0.1 %), lifts (+-0.1 um at the largest lift) and initial states.

    `many`, where there is one, measures the method's settled motions without the step of the samples and many times as
    fast. Raises MotionRefused where a neighbour's motion is refused.
    """
    assert answer.state is not None, "a refused motion has no neighbours"
    n, length = len(train.mass), train.state_size
    units = np.repeat((*STATE_NEIGHBOUR, STATE_NEIGHBOUR[0]), (n, n, length - 2 * n))
    away = units * np.random.default_rng(0).choice([-1.0, 1.0], length)
    cases = []
    for sign in (-1.0, 1.0):
        scaled = replace(lift, coefficients=lift.coefficients * (1 + sign * LIFT_NEIGHBOUR / lift.max_lift))
        cases.append((lift, cam_speed * (1 + sign * SPEED_NEIGHBOUR), answer.state))
        cases.append((scaled, cam_speed, answer.state))
        cases.append((lift, cam_speed, answer.state + sign * away))
    if many is not None:
        found = [at_once(many, train, *case) for case in cases]
        return [Figures({name: np.array(ends) for name, ends in one.range.items()}) for one in found]
    steps = answer.steps_per_revolution // 2  # the error estimate is what the last halving changed
    most = None if answer.periodic else WANDERING_REVOLUTIONS
    return [
        settle_and_measure(
            prepare(train, cam, speed, steps), state, cam, most, decay=decay_per_revolution(train, speed)
        ).figures
        for cam, speed, state in cases
    ]


def against_limits(
    scene: Scene, speed_rpm: float, answer: Converged, near: list[Figures]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Limits that the whole neighbourhood breaks, and those that a part of it breaks or may break."""
    at = f"at {speed_rpm:g} r/min"
    seats = [not np.isnan(v) for v in (answer.worst["bounce_mm"], *(f.worst("bounce_mm") for f in near))]
    if not all(seats):
        never = f"{'pump-up, ' * pumped_up(build_train(scene), answer.state)}never seats {at}"
        return ((never,), ()) if not any(seats) else ((), (never,))
    broken, straddled = [], []
    for key, limit in motion_limits(scene.design).items():
        values, error = [answer.worst[limit.metric], *(f.worst(limit.metric) for f in near)], answer.error[limit.metric]
        if all(limit.breaks(value, error) for value in values):
            broken.append(f"{key} {at}")
        elif not all(limit.keeps(value, answer.doubt(limit.metric)) for value in values):
            straddled.append(f"{key} {at}")
    return tuple(broken), tuple(straddled)


def pumped_up(train: Train, state: np.ndarray | None) -> bool:
    """Whether, in a settled state (2n + r) at -pi, an adjuster that filled while the valve flew holds it off its seat.

    The cam stands on its base circle there: the valve is off its seat, and a column of oil is longer than in the train
    at rest by more than its ball travels. Whether the oil carries load at that instant hangs on the vibration.
    """
    if train.laws is None or state is None:
        return False
    n = len(train.mass)
    off = train.compression(state[:n], 0.0)[train.seat] < train.touch_compression[train.seat]
    longer = (state_at_rest(train) - state)[2 * n :]
    oil = [i for i, e in enumerate(train.memory) if train.laws.kind[e] == OIL]
    return bool(off and any(longer[i] > train.laws.travel[train.memory[i]] for i in oil))
