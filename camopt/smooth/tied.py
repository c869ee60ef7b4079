"""Simultaneous motions of many cases whose contacts between cam and valve may pull, and their derivatives.

A case is a train at a speed. During the event, between the ramp tops or slightly longer, a share `tie` of the law of
the contacts between cam and valve is bilateral: their elastic force becomes negative, and their damping pulls. In a
train with lash the contacts that are closed at rest are also tied on the ramps and on the base circle, where the motion
of a follower that hops within its lash would depend on its last digits; an adjuster must be free to push there. With a
share of one a contact cannot open, and its force always has a slope by the cam's coefficients; with zero the law is
that of the scene, smoothed. A nonlinear elastic law is continued along its tangent below `TANGENT_N`, and its damping
is no less there than at that force. Tied contact forces of a train with linear laws are affine in the lift as long as
seat and lash change their contact at the same angles.
"""

from functools import partial
from typing import Any, ClassVar, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from camopt.scene.rest import rest_position
from camopt.scene.smoothing import Smoothing
from camopt.scene.train import Train
from camopt.smooth.grid import equal_grid
from camopt.smooth.laws import Layer
from camopt.smooth.scan import lift_at
from camopt.smooth.system import Array, System, build_system, column

CARRIED = (
    0.0,
    -567301805773 / 1357537059087,
    -2404267990393 / 2016746695238,
    -3550918686646 / 2091501179385,
    -1275806237668 / 842570457699,
)
"""Share of the previous stage's increment that each stage takes over."""
ADDED = (
    1432997174477 / 9575080441755,
    5161836677717 / 13612068292357,
    1720146321549 / 2090206949498,
    3134564353537 / 4481467310338,
    2277821191437 / 14882151754819,
)
"""Share of the increment that each stage adds to the state."""
NODES = (
    0.0,
    1432997174477 / 9575080441755,
    2526269341429 / 6820363962896,
    2006345519317 / 3224310063776,
    2802321613138 / 2924317926251,
)
ADJOINTS = {"reverse": diffrax.RecursiveCheckpointAdjoint, "forward": diffrax.ForwardMode}
"""Modes of differentiation. One has to be chosen in advance: diffrax's checkpointed loop has no forward mode, and its
other loop no reverse mode."""


class LowStorage(diffrax.AbstractSolver):
    """A Runge-Kutta method of order four whose stages need two registers, each step divided into equal `parts`.

    A Jacobian by forward mode carries dozens of tangents through every stage, and a method that stores the slopes of
    all its stages spends its time on memory access. The stages run in a loop, so that programs compile in seconds.
    Source: Carpenter, Kennedy (1994), Fourth-order 2N-storage Runge-Kutta schemes, NASA TM 109112, solution 3.
    """

    parts: int = 1
    term_structure: ClassVar = diffrax.AbstractTerm
    interpolation_cls: ClassVar = diffrax.LocalLinearInterpolation

    def order(self, terms):
        return 4

    def init(self, terms, t0, t1, y0, args):
        return None

    def func(self, terms, t0, y0, args):
        return terms.vf(t0, y0, args)

    def step(self, terms, t0, t1, y0, args, solver_state, made_jump):
        width = (t1 - t0) / self.parts
        dtype = y0.dtype
        carried, added, nodes = (jnp.tile(jnp.asarray(row, dtype), self.parts) for row in (CARRIED, ADDED, NODES))
        begin = jnp.repeat(jnp.arange(self.parts), len(NODES))

        def stage(registers, of):
            y, increment = registers
            carry, add, node, begun = of
            increment = carry * increment + width * terms.vf(t0 + (begun + node) * width, y, args)
            return (y + add * increment, increment), None

        (y1, _), _ = jax.lax.scan(stage, (y0, jnp.zeros_like(y0)), (carried, added, nodes, begin))
        return y1, None, {"y0": y0, "y1": y1}, None, diffrax.RESULTS.successful


WIDTH, _, STEPS = Smoothing()
"""Default width of the contacts' layer [m], and default number of steps per revolution, at whose ends the motion is
read: every quarter of a degree. The steps do not adapt to the edges of the layer."""
LARGEST_PHASE = 1.7
"""Longest step, as a phase [rad] of the stiffest mass on its own elements. The fastest mode of a train is at most 1.42
times as fast, and a Hertz contact at its largest force a little more: that is within the method's limit."""
TANGENT_N = 20.0
"""Contact force [N] below which a nonlinear law is continued along its tangent: at zero force it has no stiffness."""


class TiedSystem(eqx.Module):
    """A train, and the law of its contacts between cam and valve under tension."""

    system: System
    tangent: tuple[Array, Array, Array]  # (c) each: compression [m], force [N] and stiffness [N/m] where it begins
    at_rest: Array  # (c) 1 for a contact that is tied on the base circle as well, 0 for the others

    def pull(self, u: jax.Array, u_dt: jax.Array) -> jax.Array:
        """Bilateral force (c, *b) [N] of the contacts between cam and valve at given compressions and rates."""
        s, on = self.system, np.array(self.system.topology.cam_side)
        begin, _, slope = (column(values, u) for values in self.tangent)
        lifted = jnp.maximum(u[on], begin)
        pushing = s.elastic(u.at[on].set(lifted))
        return pushing[on] + slope * jnp.minimum(u[on] - begin, 0.0) + s.damper(pushing)[on] * u_dt[on]

    def force(self, y, lift, lift_dt, layer: Layer, tie) -> jax.Array:
        """Force of every element (e, *b) [N]; a share `tie` of the contacts between cam and valve is bilateral."""
        on = np.array(self.system.topology.cam_side)
        force = self.system.force(y, lift, lift_dt, layer)
        pull = self.pull(*self.system.compression(y, lift, lift_dt))
        return force.at[on].add(tie * (pull - force[on]))

    def rate(self, y, lift, lift_dt, layer: Layer, tie, push=None) -> jax.Array:
        """Time derivative of the state y (2, n + r, *b), under the given forces `push` (n) [N]."""
        return self.system.rate(y, lift, lift_dt, layer, push, self.force(y, lift, lift_dt, layer, tie))


def tied_system(train: Train) -> TiedSystem:
    """The system of a train with the tangents of its contacts between cam and valve."""
    system, on = build_system(train), np.array(train.cam_side)
    closed = train.compression(rest_position(train), 0.0)[on] >= train.touch_compression[on] - 1e-12
    at_rest = closed & ~closed.all()
    begin, force, slope = (np.asarray(values)[on] for values in _tangents(system))
    return TiedSystem(system, (begin, force, slope), at_rest.astype(float))


@jax.jit
def _tangents(system: System) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Compression (e) [m], force [N] and stiffness [N/m] where each element's tangent begins: at zero if all laws are
    linear, else where the elastic force, which increases, reaches `TANGENT_N`."""
    begin = jnp.zeros_like(system.stiffness)
    if system.laws is not None:

        def halve(_, bracket):
            low, high = bracket
            middle = 0.5 * (low + high)
            below = system.elastic(middle) < TANGENT_N
            return jnp.where(below, middle, low), jnp.where(below, high, middle)

        _, begin = jax.lax.fori_loop(0, 60, halve, (begin, jnp.full_like(begin, 1e-2)))
    return (begin, *jax.jvp(system.elastic, (begin,), (jnp.ones_like(begin),)))


class TiedPaths(NamedTuple):
    """The limited paths of one revolution, at the angles `path_angles()` (k) [rad] of cases (b)."""

    force: jax.Array  # (k, c, b) N, of the contacts between cam and valve
    gap: jax.Array  # (k, c, b) m, their separation: negative where they are compressed
    seat_gap: jax.Array  # (k, b) m, of the valve from its seat
    states: jax.Array  # (k, 2, n + r, b)

    @property
    def end(self) -> jax.Array:
        """The state (2, n + r, b) at the end of the revolution."""
        return self.states[-1]


def path_angles(steps: int = STEPS) -> np.ndarray:
    """Angles [rad] at which paths are read, from the end of the first step to that of the last one."""
    return equal_grid(steps)[1:]


def parts_of_steps(tied: TiedSystem, slowest: float, steps: int = STEPS) -> int:
    """Number of parts into which each step is divided for the lowest cam speed [rad/s]."""
    phase = float(jnp.max(tied.system.stiffest())) * 2 * np.pi / steps / slowest
    return max(1, int(np.ceil(phase / LARGEST_PHASE)))


class DrivenTies(eqx.Module):
    """A train with tied contacts under a cam. The arguments are those of `tied_paths`; the samples begin at the angle
    `first` and cover the `span` [rad].

    `rate` and `reading` are programs of their own inside that of the revolution. Its loop is differentiated in several
    passes, each of which would otherwise trace all their operations.
    """

    tied: TiedSystem
    samples: Array
    cam_speed: Array
    event: Any
    tie: Any
    layer: Layer
    first: Any = -np.pi
    span: float = eqx.field(static=True, default=2 * np.pi)

    @jax.jit
    def rate(self, theta, y):
        """Derivative of the state by the cam angle, [m/rad] and [m/s/rad]."""
        lift, lift_dt, share = self._drive(theta)
        change = self.tied.rate(y, lift, lift_dt, self.layer, share, self.tied.system.push(theta))
        return change / self.cam_speed[None, None]

    @jax.jit
    def reading(self, theta, y) -> TiedPaths:
        """The limited quantities at an angle, in the state y."""
        lift, lift_dt, share = self._drive(theta)
        system, on = self.tied.system, np.array(self.tied.system.topology.cam_side)
        force, (u, _) = self.tied.force(y, lift, lift_dt, self.layer, share), system.compression(y, lift, lift_dt)
        return TiedPaths(force[on], -u[on], -u[system.topology.seat], y)

    @jax.jit
    def forces(self, theta, states) -> jax.Array:
        """The forces (k, e, b) [N] of all elements at angles (k) [rad], in states (k, 2, n + r, b)."""

        def at(theta, y):
            lift, lift_dt, share = self._drive(theta)
            return self.tied.force(y, lift, lift_dt, self.layer, share)

        return jax.vmap(at)(theta, states)

    def _drive(self, theta):
        inside = (theta >= self.event[0] - 1e-9) & (theta < self.event[1] - 1e-9)
        lift, lift_dtheta = lift_at(self.samples, theta, self.first, self.span)
        return lift, lift_dtheta * self.cam_speed, self.tie * jnp.where(inside, 1.0, self.tied.at_rest)[:, None]


class Grid(diffrax.StepTo):
    """Steps to given ascending times, without the checks of diffrax: in a process where equinox was imported before
    this package, their callbacks keep JAX from storing a program."""

    def wrap(self, direction):
        """The same times, because they ascend."""
        return self

    def init(self, terms, t0, t1, y0, dt0, args, func, error_order):
        """The end of the first step, and the number of the time after it."""
        return self.ts[1], 2


@partial(jax.jit, static_argnames=("parts", "adjoint"))
def tied_paths(
    tied: TiedSystem,
    samples,
    cam_speed,
    y0,
    event,
    tie,
    layer: Layer,
    *,
    parts: int,
    adjoint: str = "forward",
) -> TiedPaths:
    """One revolution from the states y0 (2, n + r, b) at the cam speeds (b) [rad/s].

    The contacts are tied over the `event`, from one angle to another [rad]. `samples` (k + 1, 2) are lift and slope at
    the ends of the revolution's k equal steps (`camopt.smooth.simulate.lift_samples`). `adjoint` is "forward" or
    "reverse", the one mode in which the paths may be differentiated: in the numbers of the system, the samples and the
    start.
    """
    steps, driven = samples.shape[0] - 1, DrivenTies(tied, samples, cam_speed, event, tie, layer)
    grid = jnp.asarray(equal_grid(steps), y0.dtype)
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(lambda theta, y, _: driven.rate(theta, y)),
        LowStorage(parts),
        grid[0],
        grid[-1],
        None,
        y0,
        saveat=diffrax.SaveAt(steps=True, fn=lambda theta, y, _: driven.reading(theta, y)),
        stepsize_controller=Grid(ts=grid),
        adjoint=ADJOINTS[adjoint](),
        max_steps=steps,
        throw=False,
    )
    assert solution.ys is not None
    return solution.ys
