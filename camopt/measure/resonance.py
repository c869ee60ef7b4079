"""Speeds at which a harmonic of the cam excites a lightly damped mode, whose peak a grid of speeds alone could miss.

A mode of angular frequency w and damping ratio z resonates with the cam's harmonic n at the cam speed w / n. Its peak
has the relative half width z. The mode has one frequency while the valve is seated and another while it is lifted. Its
phase advances at either rate in turn, so that the mean of the two frequencies determines the resonance, weighted by the
angles for which the valve is lifted and seated. In any case the centre lies between the two frequencies and, for laws
given by tables, between those of the springs at rest and at full lift.
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
"""Number of samples of the lift from which its harmonics are computed; those up to a thousand are exact to rounding."""
SMALLEST = 1e-7
"""Amplitude [m] below which a resonance changes no metric: the harmonic of the lift over twice the damping ratio."""
MOST_RESONANCES, MOST_POINTS = 40, 13
"""Largest number of resonances that are evaluated, those of the largest amplitudes, and of speeds for each of them."""
UNDAMPED = 1e-6
"""Smallest damping ratio that is used, because half widths must not vanish."""


@dataclass(frozen=True)
class Resonance:
    """A harmonic of the cam that excites a mode; all speeds are those of the crankshaft [r/min]."""

    speed_rpm: float  # by the mean frequency
    low_rpm: float  # lowest possible speed
    high_rpm: float  # highest possible speed
    half_width_rpm: float
    harmonic: int
    frequency_Hz: float
    amplitude_m: float  # harmonic of the lift over twice the damping ratio

    def speeds_rpm(self) -> Float[np.ndarray, " points"]:
        """The ascending crankshaft speeds [r/min] at which it is evaluated.

        They range from one half width below `low_rpm` to one above `high_rpm`, a half width apart or, if these were
        more than MOST_POINTS, wider apart.
        """
        low, high = self.low_rpm - self.half_width_rpm, self.high_rpm + self.half_width_rpm
        points = int(np.clip(np.ceil((high - low) / self.half_width_rpm) + 1, 3, MOST_POINTS))
        return np.unique(np.append(np.linspace(low, high, points), self.speed_rpm))


def resonances(scene: Scene, lift: Lift, step_rpm: float) -> tuple[list[Resonance], int]:
    """The resonances within the scene's band that steps of `step_rpm` [r/min] may miss, and how many were left out.

    They are in ascending order of speed. Only the resonances beyond MOST_RESONANCES count as left out, not those whose
    half width is at least the step, which the grid resolves, nor those too weak to change a metric.
    """
    train = build_train(scene)
    per_rpm = scene.cam_speed(1.0)
    low, high = (per_rpm * s for s in scene.required_operation.band_rpm)
    height = 2 * np.abs(np.fft.rfft(lift(np.linspace(-np.pi, np.pi, SAMPLES, endpoint=False)))) / SAMPLES
    share = float(np.clip((lift.closing_angle(train.lash) - lift.opening_foot) / (2 * np.pi), 0.0, 1.0))
    candidates = []
    for lifted, seated in _pairs(train, lift):
        ends = np.array([f for f, _ in (*lifted, *seated)])
        angular, ratio = share * np.mean(lifted, axis=0) + (1 - share) * np.mean(seated, axis=0)
        ratio = max(float(ratio), UNDAMPED)
        for n in range(max(1, int(np.ceil(angular / high))), min(int(angular / low), len(height) - 1) + 1):
            speed, amplitude = angular / n / per_rpm, height[n] / (2 * ratio)
            if ratio * speed < step_rpm and amplitude > SMALLEST:
                between = ends.min() / n / per_rpm, ends.max() / n / per_rpm
                candidates.append(
                    Resonance(speed, *between, ratio * speed, n, float(angular / (2 * np.pi)), float(amplitude))
                )
    candidates.sort(key=lambda r: -r.amplitude_m)
    return sorted(candidates[:MOST_RESONANCES], key=lambda r: r.speed_rpm), max(0, len(candidates) - MOST_RESONANCES)


def _pairs(train: Train, lift: Lift) -> list[tuple[list[tuple[float, float]], list[tuple[float, float]]]]:
    """Every mode of the train with the valve lifted, paired with the mode of the most similar shape with it seated.

    Each is a list of (angular frequency [rad/s], damping ratio) over the trains of `_linearised`. The result is empty
    if the train has no oscillating mode with the valve seated, or with the valve lifted.
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


def _nearest(shape: np.ndarray, modes: tuple[np.ndarray, np.ndarray, np.ndarray], mass: np.ndarray):
    """Angular frequency [rad/s] and damping ratio of the mode that is most similar to `shape` (n).

    `modes` are frequencies (k), damping ratios (k) and shapes (k, n). The measure is the modal assurance criterion
    (Allemang and Brown, A correlation coefficient for modal vector analysis, 1982), weighted with the masses (n).
    """
    angular, ratio, shapes = modes
    alike = (shapes @ (mass * shape)) ** 2 / ((shapes**2) @ mass)
    i = int(np.argmax(alike))
    return float(angular[i]), float(ratio[i])


def _linearised(train: Train, lift: Lift) -> list[Train]:
    """The train or, if it has springs given by tables, two trains with the spring rates at rest and at full lift."""
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
