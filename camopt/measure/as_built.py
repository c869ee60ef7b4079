"""Trains as built: valve trains and ground cams of individual engines, drawn at random within the scene's tolerances.

The error of a ground contour is a sum of harmonics of the revolution, with an amplitude of at most some micrometres.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from math import factorial

import numpy as np
from scipy.interpolate import make_interp_spline

from camopt.cam.lift import Lift
from camopt.scene.as_built import GRINDING, deviates, key_of, scene_as_built
from camopt.scene.errors import InputError
from camopt.scene.schema import Scene
from camopt.scene.train import Train, build_train
from camopt.scene.units import UM

WAVE_KNOTS = 18
"""Number of knots of the error's spline per period of its highest harmonic."""
Seed = int | Sequence[int]


@dataclass(frozen=True, repr=False)
class TrainAsBuilt:
    """One drawn train: its number, its scene with the drawn values, and its arrays."""

    number: int
    seed: int
    scene: Scene
    train: Train
    draws: dict[str, np.ndarray]
    """The draws (k) of every tolerance, relative to the stated tolerance; those of the grinding error are the cosine
    and sine coefficients of its harmonics."""
    errors: dict[tuple[float, float, float], Lift] = field(default_factory=dict, init=False, compare=False)
    """The grinding error of the last lobe (foot, half duration, end), which all cams of a search have in common."""

    def cam(self, lift: Lift) -> Lift:
        """The lift as ground for this train, or `lift` without grinding errors. Raises the InputError of `lobe_of`."""
        grinding = self.scene.grinding
        if grinding is None:
            return lift
        lobe, seed = lobe_of(lift), key_of(self.seed, self.number, GRINDING)
        error = self.errors.get(lobe)
        if error is None:
            error = grinding_error(lobe, seed, grinding.error_um * UM, grinding.harmonics)
            self.errors.clear()
            self.errors[lobe] = error
        return lift.shifted(error)

    def __repr__(self) -> str:
        return f"TrainAsBuilt({self.scene.name}, train {self.number} of seed {self.seed})"


def trains_as_built(scene: Scene, count: int, *, seed: int = 0, first: int = 0) -> list[TrainAsBuilt]:
    """The trains with the numbers `first` to `first` + `count` - 1, drawn within the scene's tolerances.

    Train i depends only on the seed and on i, so that a longer list begins with the shorter one. Making a tolerance
    narrower or removing it changes no other draw (common random numbers). `train.train` holds the SI arrays, and
    `train.cam(lift)` is the cam as ground for the train. Raises InputError for a count below 1 or negative numbers.
    """
    if count < 1 or seed < 0 or first < 0:
        raise InputError(f"trains as built: {count} trains of seed {seed}: expected at least one, and no negative seed")
    drawn = {i: _draws(scene, seed, i) for i in range(first, first + count)}
    scenes = {i: scene_as_built(scene, draws) for i, draws in drawn.items()}
    return [TrainAsBuilt(i, seed, built, build_train(built), drawn[i]) for i, built in scenes.items()]


def draws_of_trains(scene: Scene, count: int, *, seed: int = 0) -> dict[str, np.ndarray]:
    """The draws (t, k) of the first `count` trains by tolerance, as in `TrainAsBuilt.draws` of one train."""
    drawn = [_draws(scene, seed, i) for i in range(count)]
    return {label: np.array([draws[label] for draws in drawn]) for label in drawn[0]}


def _draws(scene: Scene, seed: int, i: int) -> dict[str, np.ndarray]:
    draws = deviates(scene, seed, i)
    if scene.grinding is not None:
        draws[GRINDING] = drawn_waves(key_of(seed, i, GRINDING), scene.grinding.harmonics)
    return draws


def drawn_waves(seed: Seed, harmonics: tuple[int, int]) -> np.ndarray:
    """Cosine and sine coefficients (2 h) of the harmonics of a revolution from the lowest to the highest.

    All harmonics have the same expected size and a uniformly distributed phase: the coefficients are uncorrelated.
    """
    random, count = np.random.default_rng(seed), harmonics[1] - harmonics[0] + 1
    size, phase = random.standard_normal(count), random.uniform(0, 2 * np.pi, count)
    return np.concatenate([size * np.cos(phase), -size * np.sin(phase)])


def lobe_of(lift: Lift) -> tuple[float, float, float]:
    """Foot, half duration and end of a lift's lobe [rad]. Raises InputError without a lobe or a base circle."""
    foot, half = lift.opening_foot, lift.half_duration
    if foot == -np.pi or foot == np.pi:
        raise InputError(
            f"grinding errors lie on the lobe of a cam, and this lift is {'never' if foot < 0 else 'everywhere'} zero: "
            f"give a cam that rises from a base circle, or leave [grinding] out"
        )
    return foot, half, lift.closing_angle(0.0)


def grinding_error(lobe: tuple[float, float, float], seed: Seed, peak: float, harmonics: tuple[int, int]) -> Lift:
    """The grinding error of a `lobe` (foot, half duration and end [rad]), whose largest value is `peak` [m].

    It contains the `harmonics` from the lowest to the highest, and is the same for the same seed. It fades out over the
    ramps, or over the period of its highest harmonic if that is longer, so that the base circle has no error.
    """
    borders, pieces, waves = _waves(lobe, harmonics)
    coefficients = drawn_waves(seed, harmonics)
    return Lift(borders, pieces @ (peak / np.abs(waves @ coefficients).max() * coefficients), lobe[1])


@lru_cache(maxsize=1)
def _waves(lobe: tuple[float, float, float], harmonics: tuple[int, int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Borders (p + 1) [rad] and pieces (p, 6, 2 h) of the harmonics of a `lobe`, and their values at knots (k, 2 h).

    They are in the order of `drawn_waves`, with amplitude one before they fade out.
    """
    foot, half, end = lobe
    knot = 2 * np.pi / (WAVE_KNOTS * harmonics[1])
    angle = np.linspace(foot, end, max(int(np.ceil((end - foot) / knot)), WAVE_KNOTS) + 1)
    phases = np.arange(harmonics[0], harmonics[1] + 1) * angle[:, None]
    opening, closing = (max(ramp, 2 * np.pi / harmonics[1]) for ramp in (-half - foot, end - half))
    inside = np.clip((angle - foot) / opening, 0, 1) * np.clip((end - angle) / closing, 0, 1)
    faded = inside**3 * (10 - 15 * inside + 6 * inside**2)
    waves = np.concatenate([np.cos(phases), np.sin(phases)], axis=1) * faded[:, None]
    clamped = [(k, np.zeros(waves.shape[1])) for k in (1, 2)]
    spline = make_interp_spline(angle, waves, 5, bc_type=(clamped, clamped))
    starts = np.unique(spline.t)[:-1]
    pieces = np.zeros((len(starts) + 2, 6, waves.shape[1]))
    for k in range(6):
        pieces[1:-1, k] = spline(starts, nu=k) / factorial(k)
    return np.concatenate([[-np.pi], starts, [end, np.pi]]), pieces, waves
