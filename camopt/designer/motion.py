"""The settled motion of an edited scene at one speed, and bounce and jump over its band, as plain numbers."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from camopt.cam.lift import Lift
from camopt.designer.cams import Cancelled
from camopt.exact.engine import prepare
from camopt.exact.settled import settled_metrics
from camopt.measure.limits import motion_limits
from camopt.measure.settling import Settled, decay_per_revolution, settle, settled_from_rest
from camopt.plots.style import DESIGN
from camopt.report.motion import animated, cam_entry, last_revolution_numbers
from camopt.scene.errors import InputError, MotionRefused
from camopt.scene.quantities import QUANTITIES
from camopt.scene.response import end_state
from camopt.scene.rest import state_at_rest
from camopt.scene.schema import Scene
from camopt.scene.train import Train

STEP_DEG = 1.0
"""Step of the shown motion."""
FEW_REVOLUTIONS = 6
"""Most revolutions that a sketch of the motion runs before the one that is shown."""
BAND_SPEEDS, AT_ONCE = 41, 12
"""Speeds of the band's curve, and how many of them are computed between two checks whether they are still wanted."""


def motion_at(
    scene: Scene, train: Train, lift: Lift, speed_rpm: float, sketch: bool, start: np.ndarray | None
) -> tuple[dict[str, Any], np.ndarray | None]:
    """One revolution at a crankshaft speed with its metrics, the share of every limit that it uses, and what the
    animation draws, or in place of these a sentence where the motion is refused; and the state in which it ends.

    The motion is settled, but that of a `sketch`, which runs at most FEW_REVOLUTIONS before, from the state `start`
    where there is one.
    """
    cam_speed = scene.cam_speed(speed_rpm)
    try:
        if sketch:
            settled = _sketched(train, lift, cam_speed, start)
        else:
            settled = settled_from_rest(prepare, train, lift, cam_speed)
    except (MotionRefused, InputError) as error:
        return {"speed_rpm": speed_rpm, "says": f"The motion is refused: {error}"}, None
    return shown_motion(scene, train, lift, speed_rpm, settled), end_state(settled.response)


def _sketched(train: Train, lift: Lift, cam_speed: float, start: np.ndarray | None) -> Settled:
    decay = decay_per_revolution(train, cam_speed)
    if start is None or len(start) != train.state_size:
        start = state_at_rest(train)
    settled = settle(prepare(train, lift, cam_speed), start, FEW_REVOLUTIONS, 1, 1, decay=decay)
    return replace(settled, periodic=True)  # whether it settles is said at rest


def shown_motion(scene: Scene, train: Train, lift: Lift, speed_rpm: float, settled: Settled) -> dict[str, Any]:
    """What the page shows of a motion."""
    figures = settled.metrics(lift)
    metrics = {name: figures.worst(name) for name in QUANTITIES}
    numbers = {"speed_rpm": speed_rpm, **last_revolution_numbers(settled, STEP_DEG)}
    entry = {"name": DESIGN, **cam_entry(DESIGN, lift, scene, STEP_DEG), "motions": [numbers]}
    return {
        "speed_rpm": speed_rpm,
        "periodic": settled.periodic,
        "metrics": metrics,
        "used": _used(scene, metrics),
        "animation": animated(scene, train, [entry], STEP_DEG),
    }


def _used(scene: Scene, metrics: dict[str, float]) -> dict[str, float]:
    """By limit on the motion how much of it is used: one at the limit, more beyond it."""
    limits = motion_limits(scene.design)
    return {key: float(limit.share(np.array(metrics[limit.metric]))) for key, limit in limits.items()}


def band_of(scene: Scene, train: Train, lift: Lift, wanted: Callable[[], bool] = lambda: True) -> dict[str, Any]:
    """Every metric at speeds over the scene's band, and by limit on the motion the largest part used and where.

    Raises Cancelled between some of the speeds once it is not `wanted` any more.
    """
    assert scene.operation is not None, "an edited scene has a band"
    speeds = np.linspace(*scene.operation.band_rpm, BAND_SPEEDS)
    parts: dict[str, list[np.ndarray]] = {name: [] for name in QUANTITIES}
    for begin in range(0, len(speeds), AT_ONCE):
        if not wanted():
            raise Cancelled
        some = [scene.cam_speed(s) for s in speeds[begin : begin + AT_ONCE]]
        metrics = settled_metrics([train], [lift], some)
        for name, values in parts.items():
            values.append(metrics.worst(name)[0, 0])
    curves = {name: np.concatenate(values) for name, values in parts.items()}
    worst = {}
    for key, limit in motion_limits(scene.design).items():
        used = limit.share(curves[limit.metric])
        at = int(np.argmax(used))
        worst[key] = {"used": used[at], "value": curves[limit.metric][at], "speed_rpm": speeds[at]}
    return {"speeds_rpm": speeds, "curves": curves, "worst": worst}
