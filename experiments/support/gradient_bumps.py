"""Gradient of the seating velocity by bumps on a cam: the problem, and its reference by central differences."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
from scipy.interpolate import BSpline, PPoly

from camopt.cam.lift import Lift
from camopt.exact.engine import prepare
from camopt.measure.metrics import measure
from camopt.scene import Scene, Train, build_train
from camopt.scene.response import record_of
from camopt.scene.rest import state_at_rest
from camopt.scene.units import DEG
from camopt.smooth.laws import Layer
from camopt.smooth.metrics import revolution_metrics
from camopt.smooth.scan import DrivenSystem
from camopt.smooth.simulate import lift_samples
from camopt.smooth.system import System, SystemState

METRIC = "seating_velocity_m_per_s"
STEPS_OF_DIFFERENCES = (1e-7, 1e-8, 1e-9)
"""Heights of a bump [m] for the central differences, of which the best agreement is used."""
SETTLING = 8
"""Number of event-exact revolutions from rest before the one that is differentiated."""


@cache
def bump(i: int, count: int, interval_deg: float = 4.0, last_deg: float = 60.0) -> Lift:
    """The i-th of `count` quintic B-splines on the lift [m, height 1], six intervals wide, their middles from -last_deg
    to last_deg."""
    knots = (np.linspace(-last_deg, last_deg, count)[i] + interval_deg * np.arange(-3.0, 4.0)) * DEG
    pieces = PPoly.from_spline(BSpline.basis_element(knots).tck)
    inside = [k for k in range(len(pieces.x) - 1) if pieces.x[k] < pieces.x[k + 1] and knots[0] <= pieces.x[k] < knots[-1]]  # fmt: skip  # noqa: E501
    rows = np.vstack([np.zeros(6), pieces.c[::-1, inside].T, np.zeros(6)])
    return Lift(np.concatenate([[-np.pi], knots, [np.pi]]), rows, 1.0)


@dataclass(frozen=True)
class Problem:
    """Gradients of the seating velocity by the heights z (m) of bumps on a cam, from a settled state at each speed."""

    scene: Scene
    train: Train
    lift: Lift
    speeds_rpm: tuple[float, ...]
    states: np.ndarray  # (s, 2n)
    bumps: tuple[Lift, ...]

    @property
    def cam_speeds(self) -> np.ndarray:
        return np.array([self.scene.cam_speed(rpm) for rpm in self.speeds_rpm])

    def under(self, system: System) -> Callable[..., DrivenSystem]:
        """The train, in the precision of `system`, under the cam with bumps of heights z (m) at a cam speed."""
        precision = system.mass.dtype
        base = jnp.asarray(lift_samples(self.lift), precision)
        parts = jnp.asarray(np.stack([lift_samples(b) for b in self.bumps], -1), precision)
        return lambda z, cam_speed: DrivenSystem(system, base + parts @ z, cam_speed)

    def metric(self, system: System, motion: SystemState, cam_speed, eps) -> jax.Array:
        """METRIC of a smoothed motion whose layer has the width eps [m]."""
        shape = self.lift.half_duration, self.lift.opening_foot
        return revolution_metrics(system, motion, cam_speed, *shape, layer=Layer(eps).half_width)[METRIC]

    def at(self, s: int) -> tuple[float, jax.Array]:
        """Cam speed and state (2, n) of the s-th of the speeds."""
        return self.cam_speeds[s], jnp.asarray(self.states[s].reshape(2, -1))


def problem(scene: Scene, lift: Lift, speeds_rpm: tuple[float, ...], bumps: int, **grid: float) -> Problem:
    """The problem with settled states; `grid` are the intervals of `bump`."""
    train = build_train(scene)
    rest = state_at_rest(train)
    states = np.array([prepare(train, lift, scene.cam_speed(rpm)).advance(rest, SETTLING) for rpm in speeds_rpm])
    return Problem(scene, train, lift, speeds_rpm, states, tuple(bump(i, bumps, **grid) for i in range(bumps)))


def exact_value(p: Problem, lift: Lift, speed: int) -> float:
    """The metric of one event-exact revolution, measured by the verifier."""
    revolve = prepare(p.train, lift, p.cam_speeds[speed], 2880)
    return float(measure(record_of(revolve, p.states[speed], 2), lift)[METRIC][0])


def exact_differences(p: Problem, speed: int) -> np.ndarray:
    """Central differences of event-exact by each bump (steps, m), with every height of `STEPS_OF_DIFFERENCES`."""

    def slope(b: Lift, h: float) -> float:
        ends = (replace(b, coefficients=height * b.coefficients) for height in (h, -h))
        up, down = (exact_value(p, p.lift.shifted(end), speed) for end in ends)
        return (up - down) / (2 * h)

    return np.array([[slope(b, h) for b in p.bumps] for h in STEPS_OF_DIFFERENCES])


def against(gradient: np.ndarray, differences: np.ndarray) -> dict[str, float]:
    """Relative error and cosine of a gradient (m) against the differences (steps, m) that agree best with it."""
    error = np.linalg.norm(gradient - differences, axis=1) / np.linalg.norm(differences, axis=1)
    if not np.any(np.isfinite(error)):
        return {"relative_error": float("nan"), "cosine": float("nan")}
    best = differences[int(np.nanargmin(error))]
    cosine = gradient @ best / (np.linalg.norm(gradient) * np.linalg.norm(best)) if np.any(gradient) else 0.0
    return {"relative_error": float(np.nanmin(error)), "cosine": float(cosine)}
