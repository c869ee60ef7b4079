"""Speeds at which a harmonic of the cam meets a lightly damped mode, whose peak a grid of speeds alone would miss.

A mode of angular frequency w and damping ratio z resonates with the cam's harmonic n at the cam speed w / n. Its peak
has the relative half width z. While the valve is seated the mode is another one than while it is lifted: its phase runs
at one rate and then at the other, so that the mean counts, weighted with the angles for which the valve is lifted and
seated. The centre lies between the two frequencies in any case and, under laws by tables, between those of the springs
at rest and at full lift.
"""

from dataclasses import dataclass, replace

import numpy as np

from camopt.cam.lift import Lift
from camopt.scene.laws import PROGRESSIVE, TABLE
from camopt.scene.rest import rest_position
from camopt.scene.schema import Scene
from camopt.scene.shapes import Float
from camopt.scene.train import Train, build_train
from camopt.scene.vibration import acting_elements, oscillations

SAMPLES = 4096
"""Number of samples of the lift from which its harmonics are taken. Those up to a thousand are exact to rounding."""
SMALLEST = 1e-7
"""Amplitude [m] below which a resonance moves no figure; an amplitude is the harmonic over twice the damping ratio."""
MOST_RESONANCES, MOST_POINTS = 40, 13
"""Largest number of resonances that are looked at, those of the largest amplitudes, and of speeds at each of them."""
UNDAMPED = 1e-6
"""Damping ratio that stands in for a smaller one, because half widths must not vanish."""


@dataclass(frozen=True)
class Resonance:
    """A harmonic of the cam that meets a mode; its speeds are those of the crankshaft [r/min]."""

    speed_rpm: float  # where the mean frequency puts it
    low_rpm: float  # the least speed at which it may lie
    high_rpm: float  # the greatest one
    half_width_rpm: float
    harmonic: int
    frequency_Hz: float
    amplitude_m: float  # harmonic of the lift over twice the damping ratio

    def speeds_rpm(self) -> Float[np.ndarray, " points"]:
        """The ascending crankshaft speeds [r/min] at which it is looked at.

        They lie a half width apart, but for MOST_POINTS, from one half width below `low_rpm` to one above `high_rpm`.
        """
        low, high = self.low_rpm - self.half_width_rpm, self.high_rpm + self.half_width_rpm
        points = int(np.clip(np.ceil((high - low) / self.half_width_rpm) + 1, 3, MOST_POINTS))
        return np.unique(np.append(np.linspace(low, high, points), self.speed_rpm))


def resonances(scene: Scene, lift: Lift, step_rpm: float) -> tuple[list[Resonance], int]:
    """The resonances within the scene's band that steps of `step_rpm` [r/min] may miss, and how many were left out.

    They ascend in speed. Those beyond MOST_RESONANCES are left out and counted. Those whose half width is the step or
    more, which the grid resolves, and those too weak to move a figure are left out and not counted.
    """
    train = build_train(scene)
    per_rpm = scene.cam_speed(1.0)
    low, high = (per_rpm * s for s in scene.required_operation.band_rpm)
    height = 2 * np.abs(np.fft.rfft(lift(np.linspace(-np.pi, np.pi, SAMPLES, endpoint=False)))) / SAMPLES
    share = float(np.clip((lift.closing_angle(train.lash) - lift.opening_foot) / (2 * np.pi), 0.0, 1.0))
    found = []
    for lifted, seated in _pairs(train, lift):
        ends = np.array([f for f, _ in (*lifted, *seated)])
        angular, ratio = share * np.mean(lifted, axis=0) + (1 - share) * np.mean(seated, axis=0)
        ratio = max(float(ratio), UNDAMPED)
        for n in range(max(1, int(np.ceil(angular / high))), min(int(angular / low), len(height) - 1) + 1):
            speed, amplitude = angular / n / per_rpm, height[n] / (2 * ratio)
            if ratio * speed < step_rpm and amplitude > SMALLEST:
                between = ends.min() / n / per_rpm, ends.max() / n / per_rpm
                found.append(
                    Resonance(speed, *between, ratio * speed, n, float(angular / (2 * np.pi)), float(amplitude))
                )
    found.sort(key=lambda r: -r.amplitude_m)
    return sorted(found[:MOST_RESONANCES], key=lambda r: r.speed_rpm), max(0, len(found) - MOST_RESONANCES)


def _pairs(train: Train, lift: Lift) -> list[tuple[list[tuple[float, float]], list[tuple[float, float]]]]:
    """For every mode while the valve is lifted, that mode and the seated mode that is most alike in shape.

    Each is a list of (angular frequency [rad/s], damping ratio) for the trains of `_linearised`. There are none where
    the train does not oscillate at all while the valve is seated, or lifted.
    """
    trains = _linearised(train, lift)
    lifted = [oscillations(t, acting_elements(train, "lifted")) for t in trains]
    seated = [oscillations(t, acting_elements(train, "seated")) for t in trains]
    if not all(len(angular) for angular, _, _ in (*lifted, *seated)):
        return []
    return [
        ([_nearest(shape, m, train.mass) for m in lifted], [_nearest(shape, m, train.mass) for m in seated])
        for shape in lifted[0][2]
    ]


def _nearest(shape: np.ndarray, others: tuple[np.ndarray, np.ndarray, np.ndarray], mass: np.ndarray):
    """Angular frequency [rad/s] and damping ratio of the mode among `others` that is most alike to `shape` (n).

    `others` are frequencies (k), damping ratios (k) and shapes (k, n). The measure is the modal assurance criterion
    (Allemang and Brown, A correlation coefficient for modal vector analysis, 1982), weighted with the masses (n).
    """
    angular, ratio, shapes = others
    alike = (shapes @ (mass * shape)) ** 2 / ((shapes**2) @ mass)
    i = int(np.argmax(alike))
    return float(angular[i]), float(ratio[i])


def _linearised(train: Train, lift: Lift) -> list[Train]:
    """The train alone or, where springs follow tables, two with springs as stiff as at rest, and as at full lift."""
    laws = train.laws
    if laws is None or not np.any(by_table := np.isin(laws.kind, (PROGRESSIVE, TABLE))):
        return [train]
    out = []
    for height in (0.0, lift.max_lift):
        raised = replace(train, gap=train.gap - train.cam_driven * height)
        d = train.compression(rest_position(raised), height)
        tangent = laws.tangent(d, train.preload)
        out.append(replace(train, stiffness=np.where(by_table, tangent, train.stiffness)))
    return out
