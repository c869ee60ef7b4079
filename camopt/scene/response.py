"""The record that every simulation method returns: positions, velocities and forces against cam angle."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from camopt.scene.train import Train


@dataclass(frozen=True)
class Response:
    """Motion of a valve train at one speed, sampled at k angles; two samples may share an angle where a force jumps.

    Angles are cam angles, ascending from the start of the record: revolution r (from 0) covers [-pi + 2 pi r, pi + 2 pi
    r], and its nose is at 2 pi r.
    """

    train: Train
    cam_speed: float  # rad/s
    angle: np.ndarray  # (k) rad
    lift: np.ndarray  # (k) m, of the cam
    x: np.ndarray  # (k, n) m
    v: np.ndarray  # (k, n) m/s
    force: np.ndarray  # (k, e) N, the force that each element exerts: never below zero in a contact
    memory: np.ndarray = field(default_factory=lambda: np.zeros((1, 0)))  # (k, r) m; one row where r is zero

    @property
    def time(self) -> np.ndarray:
        """Seconds from -180 degrees of the first revolution, shape (k)."""
        return (self.angle + np.pi) / self.cam_speed

    @property
    def revolutions(self) -> int:
        """Number of whole revolutions in the record."""
        return round((self.angle[-1] - self.angle[0]) / (2 * np.pi))

    def seat_separation(self) -> np.ndarray:
        """Signed distance s of the valve from where its seat touches [m], shape (k); positive is open."""
        return self.gap(self.train.seat)

    def separation(self, element: int) -> np.ndarray:
        """Separation of a contact [m], shape (k): zero while it touches."""
        return np.maximum(0.0, self.gap(element))

    def gap(self, e: int) -> np.ndarray:
        """Signed separation of a contact from where it touches [m], shape (k): negative where it is compressed."""
        t = self.train
        return -(self.across(self.x, e) + t.cam_driven[e] * self.lift - t.gap[e] - t.touch_compression[e])

    def across(self, values: np.ndarray, e: int, unit: float = 1.0) -> np.ndarray:
        """Difference of `values` (k, n) of the masses between the two ends of an element, divided by `unit`, shape (k);
        the values of the ground are zero."""
        first, second = (0.0 if i < 0 else values[:, i] / unit for i in (self.train.a[e], self.train.b[e]))
        return np.asarray(first - second)


Revolve = Callable[[np.ndarray], Response]
"""A function from a state (2n + r: positions [m], velocities [m/s], memories [m]) at -pi to the following revolution.

Every method provides `prepare(train, lift, cam_speed, ...) -> Revolve`, which computes what all revolutions have in
common. Settling, metrics and error estimates are thus written once for all methods.
"""


def joined(responses: list[Response]) -> Response:
    """Consecutive revolutions as one record; the sample at which two of them meet occurs twice."""
    first = responses[0]
    angle = np.concatenate([r.angle + 2 * np.pi * i for i, r in enumerate(responses)])
    series = (np.concatenate([getattr(r, name) for r in responses]) for name in ("lift", "x", "v", "force", "memory"))
    return Response(first.train, first.cam_speed, angle, *series)


def record_of(revolve: Revolve, state: np.ndarray, revolutions: int) -> Response:
    """The motion from a state over a number of revolutions, at least one, as one record."""
    records = [revolve(state)]
    for _ in range(revolutions - 1):
        records.append(revolve(end_state(records[-1])))
    return joined(records)


def next_state(revolve: Revolve, state: np.ndarray) -> np.ndarray:
    """The state one revolution later. A method with an `advance` computes it without samples, which is faster."""
    advance = getattr(revolve, "advance", None)
    return end_state(revolve(state)) if advance is None else advance(state, 1)


def end_state(response: Response) -> np.ndarray:
    """State (2n + r) at the end of a record, from which the next revolution starts."""
    return np.concatenate([response.x[-1], response.v[-1], response.memory[-1]])
