"""Speeds at which a harmonic of the cam meets a lightly damped mode: where a grid of speeds alone would miss a peak.

A mode of angular frequency w and damping ratio z resonates with the cam's harmonic n at the cam speed w / n, within a
relative half width of z. While the valve is seated the mode is another one than while it is lifted. Its phase runs at
one rate and then at the other, so over a revolution the mean counts, weighted with the angles for which the valve is
lifted and seated; the centre lies between the two in any case (and, under progressive laws, between those of the
springs at rest and at full lift).
"""

from dataclasses import dataclass, replace

import numpy as np

from camopt.cam.lift import Lift
from camopt.scene.laws import PROGRESSIVE
from camopt.scene.rest import rest_position
from camopt.scene.schema import Scene
from camopt.scene.shapes import Float
from camopt.scene.train import Train, build_train
from camopt.scene.vibration import acting_elements, oscillations

SAMPLES = 4096
"""Samples of the lift for its harmonics: those up to a thousand are exact to rounding."""
SMALLEST = 1e-7
"""Amplitude at resonance [m], harmonic over twice the damping ratio, below which a resonance moves no figure."""
MOST_RESONANCES, MOST_POINTS = 40, 13
"""Resonances looked at, the largest amplitudes first, and speeds at each of them."""
UNDAMPED = 1e-6
"""Damping ratio that stands in for a smaller one: half widths must not vanish."""


@dataclass(frozen=True)
class Resonance:
    """A harmonic of the cam on a mode, in crankshaft speeds [r/min]."""

    speed_rpm: float  # where the mean frequency puts it
    low_rpm: float  # between which it lies
    high_rpm: float
    half_width_rpm: float
    harmonic: int
    frequency_Hz: float
    amplitude_m: float  # harmonic of the lift over twice the damping ratio

    def speeds_rpm(self) -> Float[np.ndarray, " points"]:
        """Speeds at which it is looked at: a half width apart, from one half width below to one above."""
        low, high = self.low_rpm - self.half_width_rpm, self.high_rpm + self.half_width_rpm
        points = int(np.clip(np.ceil((high - low) / self.half_width_rpm) + 1, 3, MOST_POINTS))
        return np.unique(np.append(np.linspace(low, high, points), self.speed_rpm))


def resonances(scene: Scene, lift: Lift, step_rpm: float) -> tuple[list[Resonance], int]:
    """Resonances within the scene's band that steps of `step_rpm` may miss, and how many of them were left out.

    Left out without being counted are those wider than the step, whose half width the grid resolves, and those too
    weak to move a figure; counted are those beyond MOST_RESONANCES.
    """
    assert scene.operation is not None, "load_scene(..., need='operation') guarantees it"
    train = build_train(scene)
    per_rpm = scene.cam_speed(1.0)
    low, high = (per_rpm * s for s in scene.operation.band_rpm)
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
    """(angular frequency [rad/s], damping ratio) of every mode while lifted and of the seated mode most alike in shape.

    Several of each where laws are progressive: with the springs as at rest and as at full lift.
    """
    trains = _linearised(train, lift)
    lifted = [oscillations(t, acting_elements(train, "lifted")) for t in trains]
    seated = [oscillations(t, acting_elements(train, "seated")) for t in trains]
    pairs = []
    for shape in lifted[0][2]:
        pairs.append(tuple([_nearest(shape, m, train.mass) for m in some] for some in (lifted, seated)))
    return pairs


def _nearest(shape: np.ndarray, others: tuple[np.ndarray, np.ndarray, np.ndarray], mass: np.ndarray):
    """Frequency and damping ratio of the mode with the largest modal assurance (Allemang and Brown 1982), by mass."""
    angular, ratio, shapes = others
    alike = (shapes @ (mass * shape)) ** 2 / ((shapes**2) @ mass)
    i = int(np.argmax(alike))
    return float(angular[i]), float(ratio[i])


def _linearised(train: Train, lift: Lift) -> list[Train]:
    """The train, and under progressive laws the trains whose springs have their stiffness at rest and at full lift."""
    laws = train.laws
    if laws is None or not np.any(laws.kind == PROGRESSIVE):
        return [train]
    out = []
    for height in (0.0, lift.max_lift):
        raised = replace(train, gap=train.gap - train.cam_driven * height)
        d = train.compression(rest_position(raised), height)
        tangent = laws.tangent(d, train.preload)
        out.append(replace(train, stiffness=np.where(laws.kind == PROGRESSIVE, tangent, train.stiffness)))
    return out
