"""Least squares of a measured valve lift: residuals of event-exact motions, their exact gradient, damped Gauss-Newton.

The gradient of the squares is the exact adjoint's, one sweep per series whatever the number of parameters. The Jacobian
that turns it into a step is one of forward differences, kept while the steps do what it promises.

Where a valve bounces, the sum of squares has many minima: a parameter a tenth off moves the hops by more than their
length. Up to its closing the motion is smooth in every parameter, and what is fitted there is near enough for the rest:
a homotopy in the data (Voss, Timmer and Kurths 2004, Int. J. Bifurcation Chaos 14, on fits by initial values).

A parameter is expressed by the logarithm of a factor on its start value, which keeps masses, stiffnesses and dampings
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
"""Step in a logarithm with which the numbers of a train are differentiated, which are products and quotients of the
factors: truncation and rounding stay below 1e-9 of them."""
DIFFERENCE = 1e-4
"""Step of the Jacobian's central differences in a logarithm: truncation and rounding stay below 1e-6 of a column."""
LONGEST_STEP = 0.5
"""Longest step in the logarithms of the factors."""
STANDING = 1e-4
"""Decrease of the squares, in variances of the noise, below which the fit has converged: 0.01 standard errors."""
DISAPPOINTING, SHORTENED, ACCEPTED = 0.8, 0.25, 0.1
"""Shares of the promised decrease below which the Jacobian is renewed, the next step shortened, this one taken back."""
ROUNDING_M = 1e-12
"""Residual that counts as none."""
MOST_FIT_STEPS = 60
FARTHEST = np.log(10.0)
"""Farthest from the start values in the logarithms: beyond a factor of ten a train may take millions of steps."""


class FreeParameters:
    """The free parameters (p) of a scene; a point of the fit is `logs` (p), the logarithms of their factors."""

    def __init__(self, scene: Scene, free: Sequence[str]):
        """Finds the parameters named in `free` (p); a `*` in a name ties all that match and are not zero to one factor.

        Raises InputError for a name that matches nothing, zeros only, both masses and elements, or what another has.
        """
        self.scene, self.train = scene, build_train(scene)
        self.tied: list[Tied] = []
        for name in free:
            if not (matched := matching(scene, name)):
                raise no_such_number(scene, name, "identify")
            numbers = tuple(number for number in matched if number.of(scene))  # a factor leaves zero as it is
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
        """The train with every free parameter times exp of its entry in logs (p)."""
        return build_train(self.moved_scene(logs))

    def by_logs(self, logs: np.ndarray, by_train: ByTrain) -> np.ndarray:
        """Gradients (l, p) by logs, from gradients of l numbers by the parameters of the train there, which are
        differentiated by central differences of the scene's own arithmetic."""
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
        """The scene with the free parameters moved."""
        scene = self.scene
        for tied, log in zip(self.tied, logs, strict=True):
            scene = tied.scaled(scene, float(np.exp(log)))
        return scene


class Series(NamedTuple):
    """A measured series in SI: valve position (m) [m] at angles (m) [rad] from -pi, where the motion is at rest."""

    cam_speed: float
    angle: np.ndarray
    valve: np.ndarray


class LiftFit:
    """Residuals (m) [m] of all series together at a point `logs` (p), and their derivatives."""

    def __init__(self, parameters: FreeParameters, lift: Lift, series: Sequence[Series], zero_known: bool):
        self.parameters, self.lift, self.series, self.zero_known = parameters, lift, series, zero_known
        self.borders = np.cumsum([len(s.angle) for s in series])[:-1]

    def until(self, share: float) -> "LiftFit":
        """The fit to the first samples only, that share of every series."""
        parts = []
        for one in self.series:
            count = max(2, int(np.ceil(share * len(one.angle))))
            parts.append(one._replace(angle=one.angle[:count], valve=one.valve[:count]))
        return LiftFit(self.parameters, self.lift, parts, self.zero_known)

    def motions(self, train: Train) -> list[TracedMotion]:
        """The motion of each series from rest, over the whole revolutions that reach its last angle."""
        start, motions = state_at_rest(train), []
        for one in self.series:
            turns = max(1, int(np.ceil((one.angle[-1] + np.pi) / (2 * np.pi) - 1e-12)))
            motions.append(TracedMotion(train, self.lift, one.cam_speed, start, turns, mechanical=True))
        return motions

    def residual(self, motions: Sequence[TracedMotion]) -> np.ndarray:
        """Computed less measured valve position (m) [m]; where the zero is not known, less each series' mean."""
        valve = self.parameters.train.valve
        return self._centred([m.at(s.angle).x[:, valve] - s.valve for m, s in zip(motions, self.series, strict=True)])

    def tried(self, logs: np.ndarray) -> tuple[list[TracedMotion], np.ndarray]:
        """Motions and residual at a point that may have none, or lie too far off: then the residual is infinite."""
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
        """bar (m) times the residuals' Jacobian at `logs`, whose motions are given, shape (p), by the exact adjoint."""
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
        """The residuals' Jacobian (m, p) [m] by the logs, by central differences."""
        columns = [self._at(logs + h) - self._at(logs - h) for h in DIFFERENCE * np.eye(len(logs))]
        return np.stack(columns, axis=1) / (2 * DIFFERENCE)

    def slopes(self, logs: np.ndarray, residual: np.ndarray) -> np.ndarray:
        """The same by forward differences from the residual there, at half the cost: good enough for a step."""
        return np.stack([(self._at(logs + h) - residual) / DIFFERENCE for h in DIFFERENCE * np.eye(len(logs))], axis=1)

    def _at(self, logs: np.ndarray) -> np.ndarray:
        return self.residual(self.motions(self.parameters.moved(logs)))


@dataclass(frozen=True)
class Fitted:
    """Where a fit ended."""

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
    """Damped Gauss-Newton from `logs` (p), in the directions whose singular values are above `certain` times the
    residual's root mean square: others could be moved by a factor of e without notice.

    Raises MotionRefused or InputError where there is no motion at the start.
    """
    motions = fit.motions(fit.parameters.moved(logs))
    residual = fit.residual(motions)
    jacobian = fit.slopes(logs, residual)
    fresh, radius = True, LONGEST_STEP
    for steps in range(most_steps):
        noise = certain * max(float(np.sqrt(np.mean(residual**2))), ROUNDING_M)
        gradient = fit.pulled_back(logs, motions, residual)
        s, directions = told_apart(jacobian, noise)
        if float(np.sum((directions @ gradient / s) ** 2)) <= STANDING * noise**2:  # a whole step would gain nothing
            if fresh:
                return Fitted(logs, residual, motions, steps, True)
            jacobian, fresh = fit.slopes(logs, residual), True
            continue
        step = limited_step(s, directions, gradient, radius)
        promised = -2 * gradient @ step - float(np.sum((jacobian @ step) ** 2))
        trial, new_residual = fit.tried(logs + step)
        gained = (residual @ residual - new_residual @ new_residual) / promised
        if gained > ACCEPTED:
            logs, residual, motions, fresh = logs + step, new_residual, trial, False
        if gained < DISAPPOINTING and not fresh:
            jacobian, fresh = fit.slopes(logs, residual), True
        if gained < SHORTENED:
            radius = float(np.linalg.norm(step)) / 4
        elif gained > DISAPPOINTING:
            radius = min(LONGEST_STEP, 2 * radius)
    return Fitted(logs, residual, motions, most_steps, False)


def told_apart(jacobian: np.ndarray, noise: float) -> tuple[np.ndarray, np.ndarray]:
    """Singular values (k) [m] above the noise [m], and their directions (k, p)."""
    _, s, directions = np.linalg.svd(jacobian, full_matrices=False)
    return s[s > noise], directions[s > noise]


def limited_step(s: np.ndarray, directions: np.ndarray, gradient: np.ndarray, radius: float) -> np.ndarray:
    """The step (p), at most `radius` long, with the least squares by singular values (k) and directions (k, p) of the
    Jacobian and the exact gradient (p) (Levenberg and Marquardt's, its damping that of the length; More 1978)."""
    along = directions @ gradient

    def step(damping: float) -> np.ndarray:
        return -along / (s**2 + damping)

    if np.linalg.norm(step(0.0)) <= radius:
        return step(0.0) @ directions
    longest = np.linalg.norm(along) / radius  # with this damping every step is short enough
    damping: Any = brentq(lambda d: float(np.linalg.norm(step(d))) - radius, 0.0, longest)
    return step(float(damping)) @ directions


SHARES = np.arange(3, 12) / 12
"""Shares of the samples that are fitted one after another before all are."""
STAGE_STEPS, CERTAIN = 12, 20.0
"""Steps within one of these, and how well a direction must be known to be moved there (`descend`)."""
BOX = 0.2
"""Half-width of the box around the start values, in the logarithms, from which other starts are drawn."""
FEWEST_STARTS, MOST_STARTS = 2, 4
"""Starts that are compared, and that are tried while no fit is as good as the noise allows."""


def homotopy(fit: LiftFit, logs: np.ndarray) -> Fitted:
    """The fit of all samples, led there over growing shares of them; raises as `descend` does."""
    steps = 0
    for share in SHARES:
        first_samples = fit.until(share)
        if sum(len(s.angle) for s in first_samples.series) > 2 * len(logs):
            fitted = descend(first_samples, logs, STAGE_STEPS, CERTAIN)
            logs, steps = fitted.logs, steps + fitted.steps
    fitted = descend(fit, logs)
    return replace(fitted, steps=steps + fitted.steps)


def fits_from_starts(fit: LiftFit, good_enough: float) -> list[Fitted]:
    """Fits from the start values and from drawn ones, the best first, until FEWEST_STARTS have been compared and the
    best has converged to squares [m^2] of at most `good_enough`, or all starts are used up.

    From each start all samples are fitted at once, which is cheaper where there is one minimum, and by the homotopy
    where that is not good enough. Raises MotionRefused or InputError where the start values have no motion.
    """
    random, count = np.random.default_rng(0), len(fit.parameters.tied)
    fits: list[Fitted] = []
    good = False
    for tried in range(MOST_STARTS):
        logs = random.uniform(-BOX, BOX, count) if tried else np.zeros(count)
        try:
            for fitted in (descend, homotopy):
                fits = sorted([*fits, fitted(fit, logs)], key=lambda f: f.squares)
                good = fits[0].converged and fits[0].squares <= good_enough
                if good:
                    break
        except (MotionRefused, InputError):  # a drawn start without a motion is none
            if not tried:
                raise
        if tried + 1 >= FEWEST_STARTS and good:
            break
    return fits
