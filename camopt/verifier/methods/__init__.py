'''The independent methods, one file each: own assembly, own contact law, nothing shared but train, lift law and record.

Adding a verifier method
========================

One file here and one line in `INDEPENDENT` below; what of it is too long for one file stands in a folder `of_<method>`
beside it, which no other method reads. The file has a function `prepare` that turns a train, a lift law, a
cam speed [rad/s] and a number of steps into one revolution as a function of its start state. Import nothing of camopt
but the names below: the method's own assembly is the point. `camopt/verifier/methods/semi_implicit_euler.py` would be

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
        load = np.tile(train.mass_force, (len(angle), 1))
        for given in train.forcing:
            load[:, given.on] += np.interp(angle, given.angle, given.force)
        loads = train.mass, train.mass_damping, load
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
        mass, mass_damping, load = loads
        a, b, contact, driven, stiffness, damping = elements
        preload, gap = offsets
        for i in range(len(x)):
            total = load[i] - mass_damping * v[i]
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

    "semi-implicit-euler": "camopt.verifier.methods.semi_implicit_euler",

With that `camopt simulate --method` and `camopt verify --method` know it, `verify(..., methods=...)` of
`camopt.verifier.verdict` lets it vote, and `tests/verifier/test_independence.py` reads its imports. `METHODS` of
`camopt.verifier.verdict` says which methods vote by default. `tests/test_guide.py` writes this very file and this line,
and runs them.
'''

INDEPENDENT = {
    "rkg": "camopt.verifier.methods.rkg",
    "tmm": "camopt.verifier.methods.tmm",
    "houbolt": "camopt.verifier.methods.houbolt",
    "dop853": "camopt.verifier.methods.dop853",
}
"""Every method of this package by its name on the command line, and the module whose `prepare` it is."""
METHOD_NAMES = {
    "event": "event-exact",
    "rkg": "Runge-Kutta-Gill",
    "tmm": "transition matrix",
    "houbolt": "Houbolt",
    "dop853": "DOP853",
    "smooth": "smooth",
}
"""What readers are shown for a method's name on the command line; a method without an entry is shown by that one."""


def verdict_methods() -> tuple[str, ...]:
    """Names of the methods that a verdict can ask: event-exact, and those of this package."""
    return "event", *INDEPENDENT
