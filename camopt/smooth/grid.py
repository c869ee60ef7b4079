"""The grid of angles on which a motion is resolved.

A step that runs through a contact's layer, or over the angle at which its force is clipped, may have a small error and
still have a wrong derivative: it is then the derivative of a discrete motion across a wrinkle of height `tolerance` and
width `eps`. The grid therefore has a point at each edge of a layer and at each clip, and several in a layer.
"""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from camopt.scene.shapes import Float
from camopt.smooth.laws import Layer
from camopt.smooth.scan import ERROR, NODES, STAGES, WEIGHTS, DrivenSystem, at_stage, combine, hermite, stage_slopes
from camopt.smooth.system import Array

CLIP_STEP = 1e-4
"""Longest step over an angle at which a force is clipped, as a phase [rad] of the stiffest motion."""
EDGE = 1e-3
"""Longest step over the edge of a layer, in units of eps. Between the edges the law is a polynomial."""
ACROSS = 4
"""Least number of steps across a layer."""
BETWEEN = np.arange(1, 8) / 8
"""Further shares of a step at which its motion is examined, because a contact may open and close between two stages."""
PLACES = np.concatenate([[0.0], NODES[1:], BETWEEN, [1.0]])
"""Shares of a step of its start, its later stages, the examined places between and its end."""
STRAY = 0.9
"""A step that ends before an edge or a clip but crosses it midway shrinks to this share of the first place beyond."""
LEAST_STEPS = 720
"""A revolution has at least this many steps: no event of a cam is shorter than one of them."""
LARGEST_PHASE = 0.8
"""Longest step, as a phase [rad] of the stiffest motion. The tolerance bounds the error of the motion, but not that of
its derivative, in which every closing excites the fastest modes. With 1.2 the error of gradients is up to three times
as large, and beyond the stability limit (1.9 for the modes of `kodama`, whose frequency is a fifth higher) gradients
grow without bound."""
ATTEMPTS = 1.5
"""Permitted number of attempted steps per accepted step; bouncing motions of `kodama` take about 1.3."""
CHUNK = 128
"""Number of attempts between two checks whether the revolution is complete."""


class GridSearch(NamedTuple):
    """State of the search for the grid: the angle [rad], the next width [rad], the state and its derivative."""

    angle: jax.Array
    width: jax.Array
    y: jax.Array
    slope: Array


def regular_angles(revolutions: int, steps: int) -> np.ndarray:
    """Equally spaced angles (revolutions * steps + 1) [rad] of a record that begins at -pi."""
    return np.linspace(-np.pi, (2 * revolutions - 1) * np.pi, revolutions * steps + 1)


def equal_grid(steps: int) -> Float[Array, " {steps}+1"]:
    """Angles from -pi to pi [rad] in equal steps."""
    return regular_angles(1, steps)


def refined_grid(driven: DrivenSystem, y0, layer: Layer, tolerance, steps: int):
    """A grid for one revolution from y0 (2, n): angles (steps + 1) from -pi [rad], and states (steps + 1, 2, n) there.

    `tolerance` [m] is the error permitted per step in the positions; times the stiffest frequency it is the error
    permitted in the velocities. If fewer than `steps` are needed, the last sample is repeated; if they do not suffice,
    the last angle is less than pi. No derivative passes through the grid.
    """
    driven, y0, layer = jax.lax.stop_gradient((driven, y0, layer))
    frequency, cam_speed = driven.system.stiffest(), driven.cam_speed
    scale = tolerance * jnp.stack([jnp.ones_like(frequency), frequency])[:, None]
    end = jnp.asarray(jnp.pi, y0.dtype)
    widest = jnp.minimum(2 * jnp.pi / LEAST_STEPS, LARGEST_PHASE / frequency * cam_speed).astype(y0.dtype)

    def attempt(at: GridSearch, _):
        last = at.angle + at.width >= end
        width = jnp.where(last, end - at.angle, at.width)
        h = width / cam_speed
        cam = driven.cam(at.angle + width * jnp.asarray(NODES, end.dtype))
        slopes = stage_slopes(driven.system, at.y, at.slope, h, cam, layer)
        y = combine(at.y, h, WEIGHTS, slopes)
        lift, lift_dt, push = at_stage(cam, -1)
        slope = driven.system.rate(y, lift, lift_dt, layer, push)
        error = jnp.max(jnp.abs(combine(0.0, h, ERROR, [*slopes, slope])) / scale)
        growth = jnp.clip(0.9 * jnp.maximum(error, 1e-10) ** -0.2, 0.1, 5.0)
        inner = [combine(at.y, h, STAGES[i], slopes[:i]) for i in range(1, 6)]
        seen = jnp.concatenate([jnp.stack([at.y, *inner]), _between(at.y, at.slope, y, slope, h), y[None]])
        u, g = _surfaces(driven, seen, at.angle + width * PLACES.astype(end.dtype), layer)
        shrink = contact_limit(u, g, h, layer, CLIP_STEP / frequency)
        accepted = (error <= 1.0) & (shrink >= 1.0)  # NaN is rejected
        factor = jnp.where(shrink < 1.0, jnp.minimum(growth, jnp.maximum(shrink, 1e-4)), growth)
        factor = jnp.where(jnp.isfinite(error), factor, 0.1)
        angle = jnp.where(accepted, jnp.where(last, end, at.angle + width), at.angle)
        state = jnp.where(accepted, y, at.y), jnp.where(accepted, slope, at.slope)
        return GridSearch(angle, jnp.minimum(width * factor, widest), *state), (angle, state[0], accepted)

    begin = GridSearch(-end, widest, y0, driven.rate(y0, -end, layer))
    angle, states, accepted = _until_arrival(attempt, begin, end, chunks=int(ATTEMPTS * steps) // CHUNK + 1)
    index = jnp.flatnonzero(accepted, size=steps, fill_value=-1)
    index = jnp.where(index < 0, jnp.max(index), index)
    return jnp.append(-end, angle[index]), jnp.concatenate([y0[None], states[index]])


def _until_arrival(attempt, begin: GridSearch, end, chunks: int):
    """Angles, states and acceptance of all attempts, chunk by chunk, until the revolution's end or the last chunk."""

    def more(search):
        at, i, _ = search
        return (at.angle < end) & (i < chunks)

    def next_chunk(search):
        at, i, records = search
        at, chunk = jax.lax.scan(attempt, at, None, length=CHUNK)
        return at, i + 1, tuple(record.at[i].set(new) for record, new in zip(records, chunk, strict=True))

    kinds = (begin.angle, begin.y, jnp.asarray(False))
    empty = tuple(jnp.zeros((chunks, CHUNK, *k.shape), k.dtype) for k in kinds)
    _, _, records = jax.lax.while_loop(more, next_chunk, (begin, 0, empty))
    return tuple(record.reshape(-1, *record.shape[2:]) for record in records)


def _between(y0, slope0, y1, slope1, h):
    """States (7, 2, n) at the shares `BETWEEN` of a step of h [s], by the cubic through its ends and their slopes."""
    cubic = partial(hermite, start=y0, rise=y1 - y0, m0=h * slope0, m1=h * slope1)
    return jax.vmap(cubic)(jnp.asarray(BETWEEN, y0.dtype))


def _surfaces(driven: DrivenSystem, y, angle, layer: Layer):
    """Compression beyond the touch [m] and force before clipping [N], both (k, contacts), at k states and angles.

    The bounds of memories follow: the distance beyond each, and a force that is never clipped.
    """
    system = driven.system

    def one(y, lift, lift_dt):
        u, u_dt = system.compression(y, lift, lift_dt)
        beyond, force = u[system.topology.contacts], system.raw_force(u, u_dt, layer)
        if system.laws is None or not system.topology.memory:
            return beyond, force
        ways = system.laws.bounds(system.slack(y, u), system.stiffness)
        return jnp.concatenate([beyond, ways]), jnp.concatenate([force, jnp.ones_like(ways)])

    return jax.vmap(one)(y, *driven.lift(angle))


def contact_limit(u, g, h, layer: Layer, clip_step) -> jax.Array:
    """Factor by which a step of `h` [s] must shrink; a step with a factor of 1 or above stays as it is.

    `u` [m] and `g` [N] are the compression and the raw force (k, contacts) at the `PLACES` of the step. The edges of a
    layer and the clip are crossed in short steps that start just before them. No stage of a long step may lie behind
    one of them: its derivative belongs to the other side, however little its force differs. The last stages are less
    accurate than the end, so that even a step that ends just before an edge may be refused. Inside a layer, a step may
    change the compression by the width of the layer over `ACROSS` at most.
    """
    if u.size == 0:
        return jnp.ones_like(h)
    half = layer.half_width
    share = 2 * half / ACROSS
    pushing, change = jnp.any(g > 0, axis=0), jnp.abs(u[-1] - u[0])
    edges = [_crossing(u - edge, pushing, EDGE * layer.eps) for edge in (-half, half)]
    inside = pushing & (jnp.abs(u[0]) < half) & (change > share)
    within = jnp.where(inside, 0.95 * share / jnp.maximum(change, share), jnp.inf)
    clip = _crossing(g, jnp.any(u > -half, axis=0), clip_step / h * jnp.max(jnp.abs(g - g[:1]), axis=0))
    return jnp.min(jnp.stack([*edges, within, clip]))


def _crossing(values, matters, longest):
    """Factor that ends a step just before zero if values (k, contacts) change sign in it by more than `longest`."""
    behind, moved = values[:1] * values < 0, jnp.abs(values - values[:1])
    refused = matters & jnp.any(behind, axis=0) & (jnp.max(moved, axis=0) > longest)
    first = jnp.min(jnp.where(behind, PLACES.astype(values.dtype)[:, None], 1.0), axis=0)
    to_zero = jnp.maximum(jnp.abs(values[0]) - 0.5 * longest, 0.9 * longest) / jnp.where(behind[-1], moved[-1], 1.0)
    return jnp.where(refused, jnp.where(behind[-1], to_zero, STRAY * first), jnp.inf)
