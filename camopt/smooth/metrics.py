"""The declared metrics (`camopt.scene.quantities`) of a motion, in JAX: differentiable where the motion allows it.

Angles at which something happens (the touch, the nominal closing) are roots inside a step, with the derivative of the
root by the implicit function theorem, so that d(seating velocity) includes the shift of the touch. A maximum has the
derivative of one side: at a tie of samples that of the first, at a tie of contacts, or of a value with its floor (jump
and bounce with zero), half of each.
"""

import jax
import jax.numpy as jnp
import numpy as np

from camopt.scene.shapes import Float
from camopt.scene.units import DEG, MM
from camopt.smooth.interpolation import (
    at_angle,
    cubic,
    greatest,
    greatest_between,
    separation_angle,
    step_integral,
    time_to_fall,
)
from camopt.smooth.system import Array, System, SystemState


def margins(system: System, motion: SystemState) -> Float[Array, "k e"]:
    """Compression of every element beyond its touch [m]."""
    y = jnp.stack([motion.x, motion.v], axis=1)
    return jax.vmap(lambda y, lift: system.compression(y, lift, 0.0)[0])(y, motion.lift)


def margin_slopes(system: System, motion: SystemState, cam_speed) -> Float[Array, "k e"] | None:
    """Derivatives of the margins by angle [m/rad]; None where the derivative of the lift is not known."""
    if motion.lift_dtheta is None:
        return None
    y = jnp.stack([motion.x, motion.v], axis=1)
    lift_dt = motion.lift_dtheta * cam_speed
    return jax.vmap(lambda y, lift_dt: system.compression(y, 0.0, lift_dt)[1])(y, lift_dt) / cam_speed


def seat_distance(system: System, motion: SystemState) -> tuple[Float[Array, " k"], Float[Array, " k"]]:
    """Distance s of the valve from where its seat touches [m], positive open, and its rate [m/s]."""
    return -margins(system, motion)[:, system.topology.seat], motion.v[:, system.topology.valve]


def valve_acceleration(system: System, motion: SystemState) -> Float[Array, " k"]:
    """Acceleration of the valve [m/s^2], from the forces of the record."""
    valve = system.topology.valve
    on_valve = motion.force @ system.topology.incidence(system.mass.shape[0])[:, valve]
    drag = system.mass_damping[valve] * motion.v[:, valve]
    push = system.push(motion.angle)
    load = system.mass_force[valve] if push is None else system.mass_force[valve] + push[:, valve]
    return (load - drag - on_valve) / system.mass[valve]


def closing(system: System, motion: SystemState, cam_speed, revolution: int, layer: jax.Array | float = 0.0) -> tuple:
    """Whether the valve left its seat, whether the seat pushes again, and angle [rad] and velocity [m/s] of the touch.

    The touch is the first angle after the revolution's greatest valve lift at which the seat pushes.

    `layer` [m] is the distance s where the seat starts to push: half of eps for the compact ramp, 0 without smoothing.
    """
    s, v = seat_distance(system, motion)
    index = jnp.arange(len(s))
    top = jnp.argmax(jnp.where(in_revolution(motion.angle, revolution), s, -jnp.inf))
    pushes = (motion.force[:, system.topology.seat] > 0) & (index > top)
    i = jnp.argmax(pushes)
    j = jnp.maximum(i - 1, 0)
    acceleration = valve_acceleration(system, motion)[j]  # the motion before the touch, not through it
    t = time_to_fall((s[j], v[j], 0.5 * acceleration), layer, (motion.angle[i] - motion.angle[j]) / cam_speed)
    opened = ~(s[top] <= layer)  # a motion that is NaN has no value; it did not stay shut
    return opened, jnp.any(pushes), motion.angle[j] + t * cam_speed, v[j] + t * acceleration


def in_revolution(angle, revolution: int):
    """Samples of revolution r: angles from -pi + 2 pi r to pi + 2 pi r."""
    return jnp.abs(angle - 2 * jnp.pi * revolution) <= jnp.pi


def leaked(system: System, motion: SystemState, touch, opening_foot, revolution: int):
    """By how much [m] the adjusters between cam and valve are shorter at the angle of the touch than at the opening
    foot of the revolution, and never below zero."""
    if motion.memory is None or not system.topology.adjusters:
        return 0.0
    shortening = motion.memory[:, np.array(system.topology.adjusters)].sum(axis=1)
    before = at_angle(motion.angle, shortening, 2 * jnp.pi * revolution + opening_foot)
    return jnp.maximum(0.0, at_angle(motion.angle, shortening, touch) - before)


def nominal_closing(system: System, motion: SystemState, revolution: int, shorter: jax.Array | float = 0.0):
    """Angle [rad] at which the cam lift has fallen to the lash and what the adjusters are `shorter` [m]: a cubic inside
    a step, or linear without its slope."""
    lash = shorter + sum(system.gap[e] for e in system.topology.cam_side)
    above = in_revolution(motion.angle, revolution) & (motion.lift > lash)
    i = jnp.clip(len(motion.angle) - 1 - jnp.argmax(above[::-1]), 0, len(motion.angle) - 2)
    width, rise = motion.angle[i + 1] - motion.angle[i], motion.lift[i + 1] - motion.lift[i]
    slopes = (rise, rise) if motion.lift_dtheta is None else motion.lift_dtheta[i + jnp.arange(2)] * width
    t = time_to_fall(cubic(motion.lift[i], rise, *slopes), lash, jnp.where(rise < 0, 1.0, 0.0))
    return motion.angle[i] + t * width


def event_metrics(
    system: System, motion: SystemState, cam_speed, half_duration, revolution: int
) -> dict[str, jax.Array]:
    """Jump and contact forces at angles within half the duration from the nose, at the worst cam-side contact."""
    centre = 2 * jnp.pi * revolution
    edges = (centre - half_duration, centre + half_duration)
    margin, slope = margins(system, motion), margin_slopes(system, motion, cam_speed)
    gap, turn, low, high = [], [], [], []
    for e in system.topology.cam_side:
        pressed = motion.angle, margin[:, e], None if slope is None else slope[:, e]
        force = motion.angle, motion.force[:, e], None if motion.force_dtheta is None else motion.force_dtheta[:, e]
        gap.append(greatest_between(*pressed, edges, -1.0))
        turn.append(separation_angle(*pressed[:2], edges))
        low.append(-greatest_between(*force, edges, -1.0))
        high.append(greatest_between(*force, edges))
    return {
        "jump_mm": jnp.maximum(0.0, jnp.max(jnp.stack(gap))) / MM,
        "jump_deg": jnp.max(jnp.stack(turn)) / DEG,
        "contact_force_min_N": jnp.maximum(0.0, jnp.min(jnp.stack(low))),
        "contact_force_max_N": jnp.max(jnp.stack(high)),
    }


def closed_metrics(
    system: System, motion: SystemState, cam_speed, opening_foot, revolution: int, layer: jax.Array | float = 0.0
) -> dict[str, jax.Array]:
    """Bounce, seating and impact velocity, and the integral of max(0, s)^2 from the touch to the next opening foot.

    The window ends with the record where the record ends first. Without a touch the values are NaN, or 0 where
    the valve never opened; in both cases gradients are zero.
    """
    opened, touches, touch, velocity = closing(system, motion, cam_speed, revolution, layer)
    shorter = leaked(system, motion, touch, opening_foot, revolution)
    nominal = nominal_closing(system, motion, revolution, shorter)
    s, v = seat_distance(system, motion)
    end = 2 * jnp.pi * (revolution + 1) + opening_foot
    before_end, begin = motion.angle <= end, jnp.minimum(touch, nominal)
    window = (motion.angle >= begin) & before_end
    hop = jnp.where(nominal < touch, at_angle(motion.angle, s, nominal, v / cam_speed), 0.0)
    crest = greatest(motion.angle, s, v / cam_speed, (begin, end))
    highest = jnp.maximum(jnp.maximum(0.0, hop), crest)
    bounce = jnp.where(highest > layer, highest, 0.0)  # a valve in the layer has not left its seat
    after = (motion.angle >= touch) & before_end
    _, square = step_integral(motion.angle, s, v / cam_speed, after[1:] & after[:-1])
    falls = (s[:-1] > layer) & (s[1:] <= layer) & window[1:]
    share = (s[:-1] - layer) / jnp.where(falls, s[:-1] - s[1:], 1.0)
    impact = jnp.max(jnp.where(falls, -(v[:-1] + share * jnp.diff(v)), 0.0))
    values = {
        "bounce_mm": bounce / MM,
        "seating_velocity_m_per_s": jnp.abs(velocity),
        "impact_velocity_m_per_s": jnp.maximum(impact, jnp.abs(velocity)),
        "closed_integral_m2_rad": square,
    }
    null = jnp.where(opened, jnp.nan, 0.0)
    return {name: jnp.where(opened & touches, value, null) for name, value in values.items()}


def revolution_metrics(
    system: System,
    motion: SystemState,
    cam_speed,
    half_duration,
    opening_foot,
    revolution: int = 0,
    layer: jax.Array | float = 0.0,
) -> dict[str, jax.Array]:
    """Every declared metric of one revolution of a record, by its name in `QUANTITIES` and in the unit of that name.

    `half_duration` and `opening_foot` [rad] belong to the cam; `layer` [m] means what it means for `closing`.
    """
    s, v = seat_distance(system, motion)
    now = in_revolution(motion.angle, revolution)
    lash = sum(system.gap[e] for e in system.topology.cam_side)
    area, _ = step_integral(motion.angle, s, v / cam_speed, now[1:] & now[:-1])
    excess = jnp.max(jnp.where(now, s - jnp.maximum(0.0, motion.lift - lash), -jnp.inf))
    return {
        **closed_metrics(system, motion, cam_speed, opening_foot, revolution, layer),
        **event_metrics(system, motion, cam_speed, half_duration, revolution),
        "dynamic_area_mm_deg": area / (MM * DEG),
        "excess_lift_mm": excess / MM,
    }
