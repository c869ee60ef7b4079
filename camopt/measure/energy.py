"""Energy balance of a recorded motion: work of cam and forces, dissipation, and energy left in opened contacts.

With compressions d and elastic forces p = preload + k d the equations of motion give, over any span,
    in - damped - left = change of kinetic energy + change of elastic energy,
    in = int f lift' dt (cam-driven elements) + int force v dt (constant forces and those over the cam angle),
    damped = int c d'^2 dt (acting elements) + int c v^2 dt (masses) + slip |distance slid| (friction)
             + int f^2 / leak dt (oil).
`left` is the elastic energy of a contact whose force reaches zero: -int p d' dt while it is compressed without force.
With the elastic energy U, which is p^2 / (2 k) for a linear law, this is U(opening) if the contact separates and
U(opening) - U(closing) if it closes again, so that recovered energy is not counted (docs/model.md). The laws are
implemented here again and evaluated on the motion alone: the balance closes only if the method integrated them.
"""

from dataclasses import dataclass

import numpy as np

from camopt.cam.lift import Lift
from camopt.scene.laws import FRICTION, OIL, Laws
from camopt.scene.response import Response
from camopt.scene.shapes import Float
from camopt.scene.train import Train

NODES, WEIGHTS = (np.polynomial.legendre.leggauss(5)[0] + 1) / 2, np.polynomial.legendre.leggauss(5)[1] / 2
"""Gauss-Legendre rule on [0, 1], exact up to degree 9: the square of a quintic's slope has degree 8."""


class Elastic:
    """Elastic force p [N] of every element as a function of its compression d, and its energy [J], zero at p = 0."""

    def __init__(self, train: Train):
        self.train, self.curves = train, {}
        self.laws = laws = _linear_laws(train) if train.laws is None else train.laws
        kind = laws.kind
        self.oil, self.friction = (np.flatnonzero(kind == k).tolist() for k in (OIL, FRICTION))
        for e in laws.with_table:
            force = laws.curve(e, train.preload[e])
            energy = force.antiderivative()
            energy.c[-1] -= energy(force.roots()[0])
            self.curves[e] = force, energy

    def force(self, d: Float[np.ndarray, "k e"]) -> Float[np.ndarray, "k e"]:
        """Elastic forces [N] at compressions [m]; zero for elements with a memory."""
        return np.stack([self.laws.along(e, d[:, e], p)[0] for e, p in enumerate(self.train.preload)], axis=1)

    def stored(self, d: Float[np.ndarray, "k e"], memory: Float[np.ndarray, "k r"]) -> Float[np.ndarray, "k e"]:
        """Elastic energies [J]; zero for an open contact."""
        t, laws = self.train, self.laws
        pressed = t.preload + t.stiffness * d
        pressed = np.where(t.contact, np.maximum(pressed, 0.0), pressed)
        energy = 0.5 * pressed**2 / t.stiffness
        for e, (force, curve) in self.curves.items():
            energy[:, e] = np.where(~t.contact[e] | (force(d[:, e]) > 0.0), curve(d[:, e]), 0.0)
        for e, law in laws.of_contacts:
            energy[:, e] = law.stored(np.maximum(0.0, d[:, e] + law.depth(t.preload[e])))
        for j, e in enumerate(t.memory):
            energy[:, e] = 0.5 * self.memory_force(d[:, e], memory[:, j], e) ** 2 / t.stiffness[e]
        return energy

    def memory_force(self, d: np.ndarray, z: np.ndarray, e: int) -> np.ndarray:
        """Force [N] of an element with a memory z [m]."""
        t, laws = self.train, self.laws
        if e in self.oil:
            return t.stiffness[e] * np.maximum(0.0, d - z - laws.travel[e])
        return np.clip(t.stiffness[e] * (d - z), -laws.slip[e], laws.slip[e])


@dataclass(frozen=True)
class Energy:
    """Energies [J] of a record of k samples, by its n masses and e elements."""

    by_cam: Float[np.ndarray, " e"]  # work of the cam through each element
    by_forces: Float[np.ndarray, " n"]  # work of the constant forces and of those over the cam angle
    damped: Float[np.ndarray, " e"]  # dissipated by the elements' dampers, by friction and by leakage
    damped_to_ground: Float[np.ndarray, " n"]  # dissipated by the masses' dampers
    left: Float[np.ndarray, " e"]  # left in contacts that opened while still compressed
    kinetic: Float[np.ndarray, " k"]
    elastic: Float[np.ndarray, " k"]  # zero for an unstressed spring or a contact that just touches

    @property
    def put_in(self) -> float:
        """Work of the cam and the given forces [J]."""
        return float(self.by_cam.sum() + self.by_forces.sum())

    @property
    def dissipated(self) -> float:
        """Energy dissipated by dampers, friction and leakage [J], without that left in opened contacts."""
        return float(self.damped.sum() + self.damped_to_ground.sum())

    @property
    def stored(self) -> Float[np.ndarray, " k"]:
        """Kinetic and elastic energy at the samples [J]."""
        return self.kinetic + self.elastic

    @property
    def residual(self) -> float:
        """Residual of the balance [J]: in - dissipated - left in contacts - change of the stored energy."""
        return self.put_in - self.dissipated - float(self.left.sum()) - float(self.stored[-1] - self.stored[0])

    @property
    def residual_relative(self) -> float:
        """Residual divided by the largest stored energy of the record."""
        return self.residual / float(self.stored.max())


def energy(response: Response, lift: Lift) -> Energy:
    """The energy balance of a record of any length by any method that opens contacts where their force reaches zero.

    Between samples the motion is taken as the quintic through positions, velocities and accelerations, which follow
    from the recorded forces on the interval's side of a force jump; the lift is exact. If the elements switch at
    samples, as in event-exact motion, this interpolation is the only error: it is below 1e-9 of the stored energy at
    7200 samples per revolution of the built-in scenes. If they switch between samples, the residual is the method's.
    """
    t, time, elastic = response.train, response.time, Elastic(response.train)
    start = np.flatnonzero(np.diff(time) > 0)
    h = np.diff(time)[start]
    angle_forces = np.zeros_like(response.x)  # forces on the masses over the cam angle [N]
    for forcing in t.forcing:
        angle_forces[:, forcing.on] += forcing.at(response.angle)
    acceleration = (t.mass_force + angle_forces - t.mass_damping * response.v - response.force @ t.incidence) / t.mass
    totals = np.zeros((3, len(t.a))), np.zeros((2, len(t.mass)))
    for node, weight in zip(NODES, WEIGHTS, strict=True):
        x, v = _quintic(response.x, response.v, acceleration, start, h, node)
        angle = response.angle[start] + node * np.diff(response.angle)[start]
        lift_rate = lift(angle, 1) * response.cam_speed
        by_element, by_mass = _powers(elastic, x, v, lift(angle), lift_rate)
        if t.forcing:  # linear between samples, which include its corners
            by_mass[0] += (angle_forces[start] + node * (angle_forces[start + 1] - angle_forces[start])) * v
        for e in elastic.oil:
            by_element[1, :, e] += _leakage_power(response, elastic, (start, h, node), t.compression(x, lift(angle)), e)
        totals[0][:] += weight * np.einsum("i,qie->qe", h, by_element)
        totals[1][:] += weight * np.einsum("i,qin->qn", h, by_mass)
    kinetic = 0.5 * response.v**2 @ t.mass
    stored = elastic.stored(t.compression(response.x, response.lift), response.memory)
    (by_cam, damped, left), (by_forces, damped_to_ground) = totals
    for e in elastic.friction:
        damped[e] += elastic.laws.slip[e] * np.abs(np.diff(response.memory[:, t.memory.index(e)])).sum()
    return Energy(by_cam, by_forces, damped, damped_to_ground, left, kinetic, np.sum(stored, axis=1))


def _powers(law: Elastic, x, v, rise, rise_rate) -> tuple[Float[np.ndarray, "3 m e"], Float[np.ndarray, "2 m n"]]:
    """Powers [W] at m instants: by element of cam, dampers and opened contacts, by mass of loads and ground dampers."""
    t = law.train
    rate = t.compression(v, rise_rate) + t.gap  # `compression` subtracts the gap, which has no rate
    elastic = law.force(t.compression(x, rise))
    damping = t.damping + law.laws.dissipation * elastic
    force = elastic + damping * rate
    acting = ~t.contact | ((elastic > 0) & (force > 0))
    letting_go = t.contact & (elastic > 0) & (force <= 0)
    by_cam = acting * t.cam_driven * force * rise_rate[:, None]
    damped = acting * damping * rate**2
    left = letting_go * elastic * -rate
    return np.stack([by_cam, damped, left]), np.stack([t.mass_force * v, t.mass_damping * v**2])


def _leakage_power(response: Response, law: Elastic, place: tuple, d: np.ndarray, e: int) -> Float[np.ndarray, " m"]:
    """Power [W] that the oil of element e loses at a place (intervals `start`, their h [s], share).

    `d` (m, e) are the compressions there. The memory is taken as the cubic through its values and rates, f / leak, at
    both ends of an interval. The loss is zero if the oil pushes at neither end.
    """
    (start, h, u), t = place, law.train
    z, f, leak = response.memory[:, t.memory.index(e)], response.force[:, e], law.laws.leak[e]
    rise, first, last = z[start + 1] - z[start], h * f[start] / leak, h * f[start + 1] / leak
    between = z[start] + u * (first + u * (3 * rise - 2 * first - last + u * (first + last - 2 * rise)))
    pushes = (f[start] > 0.0) | (f[start + 1] > 0.0)
    return np.where(pushes, law.memory_force(d[:, e], between, e), 0.0) ** 2 / leak


def _quintic(x, v, a, start, h, u: float) -> tuple[Float[np.ndarray, "m n"], Float[np.ndarray, "m n"]]:
    """Position and velocity at the share `u` of the intervals of length h [s] that begin at the samples `start` (m)."""
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


def _linear_laws(train: Train) -> Laws:
    """The laws of a train without explicit laws: all elements are linear."""
    zero = np.zeros(len(train.a))
    kind, rows, table = zero.astype(int), np.ones(len(zero), int), np.zeros((len(zero), 1, 2))
    return Laws(kind, train.stiffness, zero + 1.0, zero, table, zero, zero, zero, rows)
