'''The non-smooth verifier: independent methods, metrics, settling and the verdict (NumPy and numba, no JAX).

Also the public function: `camopt.verify(scene, cam, speeds_rpm, methods, accuracy)` is `verify_cam` of
`camopt.verify.effort` and returns a `Verdict`; it raises `camopt.scene.InputError` for what cannot be judged.
`speeds_rpm` (k) are crankshaft speeds [r/min], the scene's listed ones by default; how accurately is said in
`camopt.verify.effort`.

How verification works
======================

- Every method (`rkg`, `tmm`, `houbolt`, `dop853`) assembles its own equations and has its own contact law: that
  duplication is the independence. They share only the train's data, the lift pieces and the response record. A test
  reads the imports; none may reach for JAX, the smoothed path or event-exact.
- At each speed a method starts at rest and runs until the state one revolution apart moves less than 1 um and 1 mm/s,
  at most 40 revolutions (`settle`); the next four are measured, and a metric is its worst over them (`metrics`). A
  motion that does not settle is reported as aperiodic, with its range.
- A method's step is halved until bounce and jump stand (`converge`); what the last halvings moved is the error estimate
  of every figure.
- Agreement: the deciding figures of all methods overlap within range and error estimate. Then every limit of the scene
  is held against the upper end, over neighbouring states, speeds (0.1 %) and lifts (0.1 um), at the listed speeds and
  at the worst speeds of the swept band (`verdict`). Limits on the shape are judged exactly, from the roots of the
  pieces (`limits`).
- *confirmed*: they agree and every limit holds. *rejected*: they agree and a limit is broken, named in `broken`.
  *sensitive*: the neighbourhood straddles a limit. *not converged*: no agreement; one method alone never confirms.

Adding a verifier method
========================

One file here and one line in `INDEPENDENT` below. The file has a function `prepare` that turns a train, a lift law, a
cam speed [rad/s] and a number of steps into one revolution as a function of its start state. Import nothing of camopt
but the names below: the method's own assembly is the point. `camopt/verify/semi_implicit_euler.py` would be

    """Semi-implicit Euler (Cromer 1981, American Journal of Physics 49): velocities first, order 1. Linear laws."""

    import numpy as np
    from numba import njit

    from camopt.cam.lift import Lift
    from camopt.scene.response import Response, Revolve
    from camopt.scene.train import GROUND, Train


    def prepare(train: Train, lift: Lift, cam_speed: float, steps_per_revolution: int) -> Revolve:
        """One revolution as a function of its start state (2n: [m], then [m/s]); InputError for nonlinear laws."""
        train.require_linear("semi-implicit Euler", "use Runge-Kutta-Gill")
        n, angle = len(train.mass), np.linspace(-np.pi, np.pi, steps_per_revolution + 1)
        rise, rate = lift(angle), lift(angle, 1) * cam_speed
        h = 2 * np.pi / cam_speed / steps_per_revolution
        loads = train.mass, train.mass_damping, train.mass_force
        elements = train.a, train.b, train.contact, train.cam_driven, train.stiffness, train.damping
        offsets = train.preload, train.gap

        def revolve(state: np.ndarray) -> Response:
            x, v = np.empty((len(angle), n)), np.empty((len(angle), n))
            force = np.empty((len(angle), len(train.a)))
            x[0], v[0] = state[:n], state[n:]
            _march(x, v, force, rise, rate, h, loads, elements, offsets)
            return Response(train, cam_speed, angle, rise, x, v, force)

        return revolve


    @njit(nogil=True)
    def _march(x, v, force, rise, rate, h, loads, elements, offsets):
        """All steps; element forces (e) at every sample."""
        mass, mass_damping, mass_force = loads
        a, b, contact, driven, stiffness, damping = elements
        preload, gap = offsets
        for i in range(len(x)):
            total = mass_force - mass_damping * v[i]
            for e in range(len(a)):
                d, d_rate = driven[e] * rise[i] - gap[e], driven[e] * rate[i]
                if a[e] != GROUND:
                    d, d_rate = d + x[i, a[e]], d_rate + v[i, a[e]]
                if b[e] != GROUND:
                    d, d_rate = d - x[i, b[e]], d_rate - v[i, b[e]]
                elastic = preload[e] + stiffness[e] * d
                f = elastic + damping[e] * d_rate
                if contact[e]:
                    f = max(0.0, f) if elastic > 0.0 else 0.0
                force[i, e] = f
                if a[e] != GROUND:
                    total[a[e]] -= f
                if b[e] != GROUND:
                    total[b[e]] += f
            if i + 1 < len(x):
                v[i + 1] = v[i] + h * total / mass
                x[i + 1] = x[i] + h * v[i + 1]

and its line in `INDEPENDENT`

    "semi-implicit-euler": "camopt.verify.semi_implicit_euler",

With that `camopt simulate --method` and `camopt verify --method` know it, `verify(..., methods=...)` of
`camopt.verify.verdict` lets it vote, and `tests/verify/test_layers.py` reads its imports. `METHODS` of
`camopt.verify.verdict` says which methods vote by default. `tests/test_guide.py` writes this very file and this line,
and runs them.
'''

import sys
from importlib import import_module
from types import ModuleType

INDEPENDENT = {
    "rkg": "camopt.verify.rkg",
    "tmm": "camopt.verify.tmm",
    "houbolt": "camopt.verify.houbolt",
    "dop853": "camopt.verify.dop853",
}
"""Every method of this package by its name on the command line, and the module whose `prepare` it is."""

_PUBLIC = {
    "energy": "energy",
    "Energy": "energy",
    "measure": "metrics",
    "periodic_state": "periodic",
    "settle": "settle",
    "Settled": "settle",
    "verify": "verdict",
    "Verdict": "verdict",
    "verify_cam": "effort",
    "broken_by_shape": "limits",
}


def __getattr__(name: str):
    """Names are imported on first use; only `verdict` reaches for the event-exact method, and only when asked to."""
    if name in _PUBLIC:
        return getattr(import_module(f"camopt.verify.{_PUBLIC[name]}"), name)
    raise AttributeError(f"module 'camopt.verify' has no attribute {name!r}")


def __dir__():
    return sorted(_PUBLIC)


class _Callable(ModuleType):
    """This package is also the public function: `camopt.verify(scene, lift)` is `verify_cam`."""

    def __setattr__(self, name: str, value):
        """Keeps `settle` and `energy` the functions after the import system has bound the files of the same names."""
        if name in _PUBLIC and isinstance(value, ModuleType):
            value = getattr(value, name)
        super().__setattr__(name, value)

    def __call__(self, *args, **kwargs):
        return import_module("camopt.verify.effort").verify_cam(*args, **kwargs)


sys.modules[__name__].__class__ = _Callable
