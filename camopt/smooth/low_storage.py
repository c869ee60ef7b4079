"""A Runge-Kutta method of order four whose stages need two registers, as a solver for diffrax.

A Jacobian by forward mode carries dozens of tangents through every stage. A method that keeps the slopes of all its
stages then spends its time on memory; this one keeps the state and one increment. Its stages stand in a loop, so that
programs stay small and compile in seconds for every contact law.
Source: Carpenter, Kennedy (1994), Fourth-order 2N-storage Runge-Kutta schemes, NASA TM 109112, solution 3.
"""

from typing import ClassVar

import diffrax
import jax
import jax.numpy as jnp

CARRIED = (
    0.0,
    -567301805773 / 1357537059087,
    -2404267990393 / 2016746695238,
    -3550918686646 / 2091501179385,
    -1275806237668 / 842570457699,
)
"""Share of the increment that each stage takes over from the one before."""
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
"""Modes of differentiation. One has to be chosen in advance, because diffrax's checkpointed loop knows no forward mode
and its other loop knows no reverse mode."""
IMAGINARY_LIMIT = 3.34
"""Largest phase of an undamped oscillation per step for which the method is stable."""


class LowStorage(diffrax.AbstractSolver):
    """The method, with each step of the controller divided into equal `parts`."""

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
            carry, add, node, part = of
            increment = carry * increment + width * terms.vf(t0 + (part + node) * width, y, args)
            return (y + add * increment, increment), None

        (y1, _), _ = jax.lax.scan(stage, (y0, jnp.zeros_like(y0)), (carried, added, nodes, begin))
        return y1, None, {"y0": y0, "y1": y1}, None, diffrax.RESULTS.successful
