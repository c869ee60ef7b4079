"""Least-squares fit of a measured valve lift: event-exact motions, their exact gradient, damped Gauss-Newton.

The gradient of the sum of squares comes from the exact adjoint, one sweep per series for any number of parameters. The
Jacobian that turns it into a step comes from forward differences and is kept while steps decrease as predicted.

Where a valve bounces, the sum of squares has many minima: an error of a tenth in a parameter moves the hops by more
than their length. Up to its closing the motion is smooth in every parameter, and its fit there starts the rest near
enough: a homotopy in the data (Voss, Timmer and Kurths 2004, Int. J. Bifurcation Chaos 14, fits by initial values).

A parameter is represented by the logarithm of a factor on its start value, which keeps masses, stiffnesses and dampings
positive.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq

from camopt.cam.lift import Lift
from camopt.exact.adjoint.motion import ByTrain, Samples, TracedMotion, rest_back
from camopt.scene import InputError, MotionRefused, Scene, Train, build_train, state_at_rest
from camopt.scene.parameters import Tied, matching, no_such_number

TRAIN_DIFFERENCE = 1e-6
"""Step in a logarithm for differentiating the numbers of a train, which are products and quotients of the factors:
truncation and rounding errors stay below 1e-9 of them."""
DIFFERENCE = 1e-4
"""Step of the Jacobian's differences in a logarithm: truncation and rounding stay below 1e-6 of a column."""
LONGEST_STEP = 0.5
"""Longest step in the logarithms of the factors."""
CONVERGED = 1e-4
"""Predicted decrease of the squares, in noise variances, at which the fit has converged: 0.01 standard errors."""
RENEWED, SHORTENED, REJECTED = 0.8, 0.25, 0.1
"""Ratios of actual to predicted decrease below which the Jacobian is renewed, the next step cut, this one rejected."""
ROUNDING_M = 1e-12
"""Residual [m] that counts as zero."""
MOST_FIT_STEPS = 60
FARTHEST = np.log(10.0)
"""Largest distance from the start in the logarithms: beyond a factor of ten a train may take millions of steps."""


class FreeParameters:
    """The free parameters (p) of a scene; a point of the fit is `logs` (p), the logarithms of their factors."""

    def __init__(self, scene: Scene, free: Sequence[str]):
        """Finds the parameters named in `free` (p); a `*` in a name ties all matching non-zero numbers to one factor.

        Raises InputError for a name that matches nothing, zeros only, masses and elements, or another name's numbers.
        """
        self.scene, self.train = scene, build_train(scene)
        self.tied: list[Tied] = []
        for name in free:
            if not (matched := matching(scene, name)):
                raise no_such_number(scene, name, "identify")
            numbers = tuple(number for number in matched if number.of(scene))  # no factor changes zero
            if not numbers:
                raise InputError(
                    f"identify: {name}: the fit starts at the scene's value, and that is 0 or none: set it"
                )
            if len({number.table for number in numbers}) > 1:
                raise InputError(f"identify: {name}: masses and elements both match: name them apart")
            self.tied.append(Tied(name, numbers))
        taken = [number for tied in self.tied for number in tied.numbers]
        if not self.tied or len(set(taken)) < len(taken):
            raise InputError(f"identify: free = {list(free)}: name at least one parameter, and none of them twice")

    def moved(self, logs: np.ndarray) -> Train:
        """The train with every free parameter multiplied by exp of its entry in logs (p)."""
        return build_train(self.moved_scene(logs))

    def by_logs(self, logs: np.ndarray, by_train: ByTrain) -> np.ndarray:
        """Gradients (l, p) with respect to logs, from gradients of l quantities with respect to the train's parameters,
        which are differentiated by central differences of the scene's own arithmetic."""
        columns = []
        for step in TRAIN_DIFFERENCE * np.eye(len(logs)):
            up, down = self.moved(logs + step), self.moved(logs - step)
            total = np.zeros(len(by_train.mass))
            for name, number in up.parameters.items():
                slope = (number - down.parameters[name]) / (2 * TRAIN_DIFFERENCE)
                total += getattr(by_train, name).reshape(len(total), -1) @ slope.ravel()
            columns.append(total)
        return np.stack(columns, axis=1)

    def moved_scene(self, logs: np.ndarray) -> Scene:
        """The scene with every free parameter multiplied by exp of its entry in logs (p)."""
        scene = self.scene
        for tied, log in zip(self.tied, logs, strict=True):
            scene = tied.scaled(scene, float(np.exp(log)))
        return scene


class Series(NamedTuple):
    """A measured series in SI: valve positions (m) [m] at angles (m) [rad] from -pi, where the motion is at rest."""

    cam_speed: float
    angle: np.ndarray
    valve: np.ndarray


class LiftFit:
    """Residuals (m) [m] of all series together at a point `logs` (p), and their derivatives."""

    def __init__(self, parameters: FreeParameters, lift: Lift, series: Sequence[Series], zero_known: bool):
        self.parameters, self.lift, self.series, self.zero_known = parameters, lift, series, zero_known
        self.borders = np.cumsum([len(s.angle) for s in series])[:-1]

    def until(self, share: float) -> "LiftFit":
        """The fit to only the first samples, this share of every series."""
        parts = []
        for series in self.series:
            count = max(2, int(np.ceil(share * len(series.angle))))
            parts.append(series._replace(angle=series.angle[:count], valve=series.valve[:count]))
        return LiftFit(self.parameters, self.lift, parts, self.zero_known)

    def motions(self, train: Train) -> list[TracedMotion]:
        """The motion of each series from rest, over the whole revolutions up to its last angle."""
        start, motions = state_at_rest(train), []
        for series in self.series:
            turns = max(1, int(np.ceil((series.angle[-1] + np.pi) / (2 * np.pi) - 1e-12)))
            motions.append(TracedMotion(train, self.lift, series.cam_speed, start, turns, mechanical=True))
        return motions

    def residual(self, motions: Sequence[TracedMotion]) -> np.ndarray:
        """Computed minus measured valve position (m) [m]; where the zero is unknown, minus each series' mean."""
        valve = self.parameters.train.valve
        return self._centred([m.at(s.angle).x[:, valve] - s.valve for m, s in zip(motions, self.series, strict=True)])

    def trial(self, logs: np.ndarray) -> tuple[list[TracedMotion], np.ndarray]:
        """Motions and residual at a trial point; the residual is infinite where it has no motion or is too far away."""
        if np.abs(logs).max() > FARTHEST:
            return [], np.full(1, np.inf)
        try:
            motions = self.motions(self.parameters.moved(logs))
        except (MotionRefused, InputError):
            return [], np.full(1, np.inf)
        return motions, self.residual(motions)

    def _centred(self, parts) -> np.ndarray:
        return np.concatenate([p if self.zero_known else p - p.mean(axis=0) for p in parts])

    def pulled_back(self, logs: np.ndarray, motions: Sequence[TracedMotion], bar: np.ndarray) -> np.ndarray:
        """The product (p) of bar (m) with the residuals' Jacobian at `logs`, by the exact adjoint of its `motions`."""
        train, total = motions[0].train, np.zeros(len(logs))
        n, e = len(train.mass), len(train.a)
        each = np.split(self._centred(np.split(bar, self.borders)), self.borders)
        for motion, series, weights in zip(motions, self.series, each, strict=True):
            m = len(weights)
            x = np.zeros((1, m, n))
            x[0, :, train.valve] = weights
            none, memory = np.zeros((1, m)), np.zeros((1, m, len(train.memory)))
            bars = Samples(x, np.zeros_like(x), none, none, np.zeros((1, m, e)), memory)
            slopes = motion.pull_back(series.angle, bars)
            assert slopes.by_train is not None
            total += self.parameters.by_logs(logs, slopes.by_train + rest_back(train, slopes.by_start))[0]
        return total

    def jacobian(self, logs: np.ndarray) -> np.ndarray:
        """The Jacobian (m, p) [m] of the residuals with respect to logs, by central differences."""
        columns = [self._at(logs + h) - self._at(logs - h) for h in DIFFERENCE * np.eye(len(logs))]
        return np.stack(columns, axis=1) / (2 * DIFFERENCE)

    def slopes(self, logs: np.ndarray, residual: np.ndarray) -> np.ndarray:
        """The Jacobian by forward differences from the residual there, at half the cost: good enough for a step."""
        return np.stack([(self._at(logs + h) - residual) / DIFFERENCE for h in DIFFERENCE * np.eye(len(logs))], axis=1)

    def _at(self, logs: np.ndarray) -> np.ndarray:
        return self.residual(self.motions(self.parameters.moved(logs)))


@dataclass(frozen=True)
class Fitted:
    """The end point of a fit."""

    logs: np.ndarray  # (p)
    residual: np.ndarray  # (m) m
    motions: list[TracedMotion]
    steps: int
    converged: bool

    @property
    def squares(self) -> float:
        """Sum of the squared residuals [m^2]."""
        return float(self.residual @ self.residual)


def descend(fit: LiftFit, logs: np.ndarray, most_steps: int = MOST_FIT_STEPS, certain: float = 1.0) -> Fitted:
    """Damped Gauss-Newton from `logs` (p), in the directions whose singular values exceed `certain` times the
    residual's root mean square: other directions could be moved by a factor of e without notice.

    Raises MotionRefused or InputError where there is no motion at the start.
    """
    motions = fit.motions(fit.parameters.moved(logs))
    residual = fit.residual(motions)
    jacobian = fit.slopes(logs, residual)
    fresh, radius = True, LONGEST_STEP
    for steps in range(most_steps):
        noise = certain * max(float(np.sqrt(np.mean(residual**2))), ROUNDING_M)
        gradient = fit.pulled_back(logs, motions, residual)
        s, directions = resolved_directions(jacobian, noise)
        if float(np.sum((directions @ gradient / s) ** 2)) <= CONVERGED * noise**2:  # a full step would gain nothing
            if fresh:
                return Fitted(logs, residual, motions, steps, True)
            jacobian, fresh = fit.slopes(logs, residual), True
            continue
        step = limited_step(s, directions, gradient, radius)
        predicted = -2 * gradient @ step - float(np.sum((jacobian @ step) ** 2))
        trial_motions, new_residual = fit.trial(logs + step)
        ratio = (residual @ residual - new_residual @ new_residual) / predicted
        if ratio > REJECTED:
            logs, residual, motions, fresh = logs + step, new_residual, trial_motions, False
        if ratio < RENEWED and not fresh:
            jacobian, fresh = fit.slopes(logs, residual), True
        if ratio < SHORTENED:
            radius = float(np.linalg.norm(step)) / 4
        elif ratio > RENEWED:
            radius = min(LONGEST_STEP, 2 * radius)
    return Fitted(logs, residual, motions, most_steps, False)


def resolved_directions(jacobian: np.ndarray, noise: float) -> tuple[np.ndarray, np.ndarray]:
    """Singular values (k) [m] above the noise [m], and their directions (k, p)."""
    _, s, directions = np.linalg.svd(jacobian, full_matrices=False)
    return s[s > noise], directions[s > noise]


def limited_step(s: np.ndarray, directions: np.ndarray, gradient: np.ndarray, radius: float) -> np.ndarray:
    """The step (p), at most `radius` long, that minimises the squares, by the Jacobian's singular values (k) and
    directions (k, p) and the exact gradient (p) (Levenberg and Marquardt, damped to this length; More 1978)."""
    along = directions @ gradient

    def step(damping: float) -> np.ndarray:
        return -along / (s**2 + damping)

    if np.linalg.norm(step(0.0)) <= radius:
        return step(0.0) @ directions
    longest = np.linalg.norm(along) / radius  # this damping makes the step short enough
    damping: Any = brentq(lambda d: float(np.linalg.norm(step(d))) - radius, 0.0, longest)
    return step(float(damping)) @ directions


SHARES = np.arange(3, 12) / 12
"""Shares of the samples that are fitted in succession before all samples."""
STAGE_STEPS, STAGE_CERTAINTY = 12, 20.0
"""Most steps for one of these shares, and `certain` of `descend` there."""
BOX = 0.2
"""Half-width, in the logarithms, of the box around the start values from which other starts are drawn."""
FEWEST_STARTS, MOST_STARTS = 2, 4
"""Number of starts that are compared, and the most that are tried while no fit reaches the noise."""


def homotopy(fit: LiftFit, logs: np.ndarray) -> Fitted:
    """The fit of all samples, approached over growing shares of them; raises as `descend` does."""
    steps = 0
    for share in SHARES:
        first_samples = fit.until(share)
        if sum(len(s.angle) for s in first_samples.series) > 2 * len(logs):
            fitted = descend(first_samples, logs, STAGE_STEPS, STAGE_CERTAINTY)
            logs, steps = fitted.logs, steps + fitted.steps
    fitted = descend(fit, logs)
    return replace(fitted, steps=steps + fitted.steps)


def fits_from_starts(fit: LiftFit, good_enough: float) -> list[Fitted]:
    """Fits from the start values and from drawn ones, the best first, until FEWEST_STARTS have been compared and the
    best has converged to squares [m^2] of at most `good_enough`, or MOST_STARTS have been tried.

    From each start all samples are fitted at once, which is cheaper where there is one minimum, and then by the
    homotopy if that is not good enough. Raises MotionRefused or InputError where the start values have no motion.
    """
    random, count = np.random.default_rng(0), len(fit.parameters.tied)
    fits: list[Fitted] = []
    good = False
    for start in range(MOST_STARTS):
        logs = random.uniform(-BOX, BOX, count) if start else np.zeros(count)
        try:
            for fitted in (descend, homotopy):
                fits = sorted([*fits, fitted(fit, logs)], key=lambda f: f.squares)
                good = fits[0].converged and fits[0].squares <= good_enough
                if good:
                    break
        except (MotionRefused, InputError):  # a drawn start without a motion is skipped
            if not start:
                raise
        if start + 1 >= FEWEST_STARTS and good:
            break
    return fits
