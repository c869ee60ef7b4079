"""MOTORI's explicit form of Houbolt's differences, as its module tells it."""

import numpy as np

from camopt.programs import compiled
from camopt.scene.response import Response, Revolve
from camopt.scene.train import Train
from camopt.verifier.methods.of_houbolt.elements import elements_of, forces, hold


def explicit_form(train: Train, angle, cam, cam_speed: float, h: float) -> Revolve:
    """One revolution on the samples `angle` (k), with lift, its velocity and the given forces at them in `cam`."""
    n, r, samples = len(train.mass), len(train.memory), len(angle)
    masses, elements = (train.mass, train.mass_damping, train.mass_force), elements_of(train, h)
    at_once = elements_of(train, 0.0)

    def revolve(state: np.ndarray) -> Response:
        x, v, force = np.zeros((samples + 2, n)), np.zeros((samples, n)), np.zeros((samples, len(train.a)))
        z = np.zeros((samples, r))
        x[2], v[0], held = state[:n], state[n : 2 * n], np.array(state[2 * n :], dtype=float)
        forces(x[2], v[0], cam[0], at_once, held, force[0], z[0])  # x[0], x[1] are the fictitious points before it
        _march((x, v, force, z), cam, h, masses, elements)
        return Response(train, cam_speed, angle, cam[:, 0], x[2:], v, force, z)

    return revolve


@compiled
def _march(motion, cam, h, masses, elements):
    """All steps from x[2], v[0] on, x being two rows ahead of v; forces at every point but the first."""
    mass, mass_damping, mass_force = masses
    x, v, force, z = motion
    held = np.empty(z.shape[1])
    given = np.zeros(len(mass))
    for step in range(len(v)):
        if step > 0:
            hold(elements, force[step - 1], z[step - 1], held)
            forces(x[step + 2], v[step], cam[step], elements, held, force[step], z[step])
        for j in range(len(elements.forced)):
            given[elements.forced[j]] = 0.0
        for j in range(len(elements.forced)):
            given[elements.forced[j]] += cam[step, 2 + j]
        for i in range(len(mass)):
            acceleration = mass_force[i] - mass_damping[i] * v[step, i]
            for e in range(len(elements.rows)):
                acceleration -= elements.rows[e, i] * force[step, e]
            acceleration = (acceleration + given[i]) / mass[i]
            x0 = x[step + 2, i]
            if step == 0:
                x[1, i] = x0 - h * v[0, i] + 0.5 * h**2 * acceleration
                x[0, i] = x0 - 2.0 * h * v[0, i] + 2.0 * h**2 * acceleration
            if step + 1 < len(v):
                x1 = 2.0 * x0 - x[step + 1, i] + h**2 * acceleration
                v[step + 1, i] = (11.0 * x1 - 18.0 * x0 + 9.0 * x[step + 1, i] - 2.0 * x[step, i]) / (6.0 * h)
                x[step + 3, i] = x1
