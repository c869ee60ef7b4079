"""Errors of the ground contour: waves over a revolution, of no more than some micrometres."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.interpolate import PPoly, make_interp_spline

from camopt.cam.lift import Lift
from camopt.scene.errors import InputError

HARMONICS = 2, 40
"""Lowest and highest harmonic of a revolution in a grinding error where nothing else is said: the first harmonic is
eccentricity, higher ones are roughness."""
PEAK = 5e-6
"""Largest value of a grinding error where nothing else is said [m]."""
WAVE_KNOTS = 18
"""Knots of an error's spline in its shortest wave."""
Seed = int | Sequence[int]


class Waves(NamedTuple):
    """Harmonics (h) of a revolution, with their sizes (h) and phases (h) [rad]."""

    harmonic: np.ndarray
    size: np.ndarray
    phase: np.ndarray

    @property
    def parts(self) -> np.ndarray:
        """Cosine and sine part of each harmonic (2 h), symmetric about zero and without correlation."""
        return np.concatenate([self.size * np.cos(self.phase), -self.size * np.sin(self.phase)])

    def __call__(self, angle: np.ndarray) -> np.ndarray:
        """The sum of the waves at angles (k) [rad]."""
        return np.cos(self.harmonic * angle[:, None] + self.phase) @ self.size


def drawn_waves(seed: Seed, harmonics: tuple[int, int] = HARMONICS) -> Waves:
    """Waves of every harmonic from the lowest to the highest, of equal expected size and any phase."""
    random, harmonic = np.random.default_rng(seed), np.arange(harmonics[0], harmonics[1] + 1)
    size = random.standard_normal(len(harmonic))
    return Waves(harmonic, size, random.uniform(0, 2 * np.pi, len(harmonic)))


def grinding_error(lift: Lift, seed: Seed, peak: float = PEAK, harmonics: tuple[int, int] = HARMONICS) -> Lift:
    """The error [m] of one ground cam, whose largest value is `peak` [m]; the same seed gives the same error.

    It fades out over the ramps, or over its shortest wave where that is longer, so that the base circle stays the base
    circle. Raises InputError for a lift without a
    base circle, and for one that does not rise from it.
    """
    foot, half = lift.opening_foot, lift.half_duration
    if foot == -np.pi or foot == np.pi:
        raise InputError(
            f"grinding errors lie on the lobe of a cam, and this lift is {'never' if foot < 0 else 'everywhere'} zero: "
            f"give a cam that rises from a base circle, or leave [grinding] out"
        )
    end, knot = lift.closing_angle(0.0), 2 * np.pi / (WAVE_KNOTS * harmonics[1])
    angle = np.linspace(foot, end, max(int(np.ceil((end - foot) / knot)), WAVE_KNOTS) + 1)
    wave = drawn_waves(seed, harmonics)(angle)
    opening, closing = (max(ramp, 2 * np.pi / harmonics[1]) for ramp in (-half - foot, end - half))
    inside = np.clip((angle - foot) / opening, 0, 1) * np.clip((end - angle) / closing, 0, 1)
    wave *= inside**3 * (10 - 15 * inside + 6 * inside**2)
    clamped = [(1, 0.0), (2, 0.0)]
    spline = PPoly.from_spline(
        make_interp_spline(angle, peak / np.abs(wave).max() * wave, 5, bc_type=(clamped, clamped))
    )
    keep = np.flatnonzero(np.diff(spline.x) > 0)
    pieces = np.zeros((len(keep) + 2, 6))
    pieces[1:-1] = spline.c[::-1, keep].T
    borders = np.concatenate([[-np.pi], spline.x[keep], [end, np.pi]])
    return Lift(borders, pieces, half)


def ground(lift: Lift, seed: Seed, peak: float = PEAK, harmonics: tuple[int, int] = HARMONICS) -> Lift:
    """The lift with the grinding error of a seed."""
    return lift.shifted(grinding_error(lift, seed, peak, harmonics))
