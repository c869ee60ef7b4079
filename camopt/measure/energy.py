"""Energy balance of a recorded motion: what cam and forces put in, what dampers and opened contacts took, what is left.

With compressions d and elastic forces p = preload + k d the equations of motion give, over any span,
    in - damped - left = change of kinetic energy + change of elastic energy,
    in = int f lift' dt (cam-driven elements) + int force v dt,
    damped = int c d'^2 dt (acting elements) + int c v^2 dt (masses),
and `left` is what a contact still holds when its force reaches zero: -int p d' dt while it is compressed without force.
With U = p^2 / (2 k) that is U(opening) where it separates and U(opening) - U(closing) where it closes again, so that
nothing is counted that comes back (docs/model.md). The contact law is written here once more and is evaluated on the
motion alone: the balance closes only if the method that made the record integrated these equations.
"""

from dataclasses import dataclass

import numpy as np

from camopt.cam.lift import Lift
from camopt.scene.response import Response
from camopt.scene.shapes import Float
from camopt.scene.train import Train

NODES, WEIGHTS = (np.polynomial.legendre.leggauss(5)[0] + 1) / 2, np.polynomial.legendre.leggauss(5)[1] / 2
"""Gauss-Legendre on [0, 1], exact to degree 9: the square of a quintic's slope has degree 8."""


@dataclass(frozen=True)
class Energy:
    """Energies [J] of a record of k samples, by its n masses and e elements."""

    by_cam: Float[np.ndarray, " e"]  # work of the cam through each element
    by_forces: Float[np.ndarray, " n"]  # work of the constant forces
    damped: Float[np.ndarray, " e"]  # dissipated by the elements' dampers
    damped_to_ground: Float[np.ndarray, " n"]  # dissipated by the masses' dampers
    left: Float[np.ndarray, " e"]  # left in contacts that opened while still compressed
    kinetic: Float[np.ndarray, " k"]
    elastic: Float[np.ndarray, " k"]  # from the unstressed spring or the touching contact on

    @property
    def put_in(self) -> float:
        """Work of cam and constant forces [J]."""
        return float(self.by_cam.sum() + self.by_forces.sum())

    @property
    def dissipated(self) -> float:
        """Energy taken by all dampers [J], without what opened contacts keep."""
        return float(self.damped.sum() + self.damped_to_ground.sum())

    @property
    def stored(self) -> Float[np.ndarray, " k"]:
        """Kinetic and elastic energy at the samples [J]."""
        return self.kinetic + self.elastic

    @property
    def residual(self) -> float:
        """What the balance misses [J]: in - dissipated - left in contacts - change of the stored energy."""
        return self.put_in - self.dissipated - float(self.left.sum()) - float(self.stored[-1] - self.stored[0])

    @property
    def residual_relative(self) -> float:
        """Residual divided by the largest stored energy of the record."""
        return self.residual / float(self.stored.max())


def energy(response: Response, lift: Lift) -> Energy:
    """The energy balance of a record of any length by any method that opens contacts where their force reaches zero.

    Between samples the motion is taken as the quintic through positions, velocities and accelerations. Accelerations
    follow from the recorded forces on the interval's own side of a force jump; the lift is exact. Where contacts switch
    at samples, as in event-exact motion, only this interpolation errs: by less than 1e-9 of the stored energy at 7200
    samples in a revolution of the built-in scenes. Where contacts switch between samples, the residual is the method's
    own error. Raises InputError for nonlinear laws.
    """
    response.train.require_linear("the energy balance", "judge such a train by the agreement of its methods")
    t, time = response.train, response.time
    start = np.flatnonzero(np.diff(time) > 0)
    h = np.diff(time)[start]
    acceleration = _acceleration(response)
    totals = np.zeros((3, len(t.a))), np.zeros((2, len(t.mass)))
    for node, weight in zip(NODES, WEIGHTS, strict=True):
        x, v = _quintic(response.x, response.v, acceleration, start, h, node)
        angle = response.angle[start] + node * np.diff(response.angle)[start]
        lift_rate = lift(angle, 1) * response.cam_speed
        by_element, by_mass = _powers(t, x, v, lift(angle), lift_rate)
        totals[0][:] += weight * np.einsum("i,qie->qe", h, by_element)
        totals[1][:] += weight * np.einsum("i,qin->qn", h, by_mass)
    kinetic = 0.5 * response.v**2 @ t.mass
    pressed = t.preload + t.stiffness * t.compression(response.x, response.lift)
    pressed = np.where(t.contact, np.maximum(pressed, 0.0), pressed)
    elastic = np.sum(0.5 * pressed**2 / t.stiffness, axis=1)
    (by_cam, damped, left), (by_forces, damped_to_ground) = totals
    return Energy(by_cam, by_forces, damped, damped_to_ground, left, kinetic, elastic)


def _powers(t: Train, x, v, rise, rise_rate) -> tuple[Float[np.ndarray, "3 m e"], Float[np.ndarray, "2 m n"]]:
    """Powers [W] at m instants: by cam, to dampers, left behind; of constant forces, to dampers to ground."""
    rate = t.compression(v, rise_rate) + t.gap  # the gap is no velocity
    elastic = t.preload + t.stiffness * t.compression(x, rise)
    force = elastic + t.damping * rate
    acting = ~t.contact | ((elastic > 0) & (force > 0))
    letting_go = t.contact & (elastic > 0) & (force <= 0)
    by_cam = acting * t.cam_driven * force * rise_rate[:, None]
    damped = acting * t.damping * rate**2
    left = letting_go * elastic * -rate
    return np.stack([by_cam, damped, left]), np.stack([t.mass_force * v, t.mass_damping * v**2])


def _acceleration(response: Response) -> Float[np.ndarray, "k n"]:
    """Accelerations that follow from the recorded forces [m/s^2]."""
    t = response.train
    total = t.mass_force - t.mass_damping * response.v
    for e in range(len(t.a)):
        if t.a[e] >= 0:
            total[:, t.a[e]] -= response.force[:, e]
        if t.b[e] >= 0:
            total[:, t.b[e]] += response.force[:, e]
    return total / t.mass


def _quintic(x, v, a, start, h, u: float) -> tuple[Float[np.ndarray, "m n"], Float[np.ndarray, "m n"]]:
    """Position and velocity at the share `u` of the intervals of h [s] that begin at the samples `start` (m)."""
    h = h[:, None]
    x0, m0, n0 = x[start], h * v[start], 0.5 * h**2 * a[start]
    x1, m1, n1 = x[start + 1], h * v[start + 1], h**2 * a[start + 1]
    rise, slope, bend = x1 - x0 - m0 - n0, m1 - m0 - 2 * n0, n1 - 2 * n0
    c3 = 10 * rise - 4 * slope + 0.5 * bend
    c4 = -15 * rise + 7 * slope - bend
    c5 = 6 * rise - 3 * slope + 0.5 * bend
    position = x0 + u * (m0 + u * (n0 + u * (c3 + u * (c4 + u * c5))))
    velocity = m0 + u * (2 * n0 + u * (3 * c3 + u * (4 * c4 + u * 5 * c5)))
    return position, velocity / h
