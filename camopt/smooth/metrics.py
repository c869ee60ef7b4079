"""The declared metrics (`camopt.scene.quantities`) of a motion, in JAX: differentiable where the motion allows it.

A value between samples has the derivative of the interpolant there. The angles of events (the touch, the nominal
closing) are roots inside a step, with the derivative of the root by the implicit function theorem, so that d(seating
velocity) includes the shift of the touch. A maximum has a one-sided derivative: at a tie of samples that of the first,
at a tie of contacts, or of a value with its floor (jump and bounce with zero), half of each.
"""

import jax
import jax.numpy as jnp
import numpy as np

from camopt.scene.shapes import Float
from camopt.scene.units import DEG, MM
from camopt.smooth.scan import hermite
from camopt.smooth.system import Array, System, SystemState


def time_to_fall(coefficients, level, most):
    """Time in [0, most] at which sum_k coefficients[k] t^k has fallen to `level`, with its derivative.

    Bisection finds it; one Newton step carries the derivative (implicit function theorem).
    """
    series = jnp.stack(coefficients)[::-1]
    frozen, fixed = jax.lax.stop_gradient((series, level))

    def halve(_, bracket):
        low, high = bracket
        middle = 0.5 * (low + high)
        above = jnp.polyval(frozen, middle) > fixed
        return jnp.where(above, middle, low), jnp.where(above, high, middle)

    most = jax.lax.stop_gradient(most)
    low, high = jax.lax.fori_loop(0, 50, halve, (jnp.zeros_like(most), most))
    t = 0.5 * (low + high)
    speed = jnp.polyval(jnp.polyder(frozen), t)
    falling = speed < 0
    value = jnp.polyval(series, t) - level
    return t - jnp.where(falling, (value - jax.lax.stop_gradient(value)) / jnp.where(falling, speed, -1.0), 0.0)


def cubic(start, rise, m0, m1):
    """Coefficients of the cubic on [0, 1] that begins at `start`, rises by `rise` and has the end slopes m0 and m1.

    SciPy's CubicHermiteSpline cannot be differentiated by its values.
    """
    return start, m0, 3 * rise - 2 * m0 - m1, m0 + m1 - 2 * rise


def at_angle(angle: Float[Array, " k"], values: Float[Array, " k"], theta, slope: Float[Array, " k"] | None = None):
    """`values` at the angle theta: linear inside a step or, with their `slope` by angle, the cubic."""
    i = jnp.clip(jnp.searchsorted(angle, jax.lax.stop_gradient(theta), side="right") - 1, 0, len(angle) - 2)
    width = angle[i + 1] - angle[i]
    t = jnp.where(width > 0, (theta - angle[i]) / jnp.where(width > 0, width, 1.0), 0.0)
    rise = values[i + 1] - values[i]
    if slope is None:
        return values[i] + t * rise
    return hermite(t, values[i], rise, slope[i] * width, slope[i + 1] * width)


def step_integral(angle: Float[Array, " k"], s: Float[Array, " k"], s_dtheta: Float[Array, " k"], keep):
    """Integral of max(0, s) over the steps kept, by Simpson's rule with the cubic in the middle."""
    width = jnp.diff(angle)
    middle = 0.5 * (s[1:] + s[:-1]) - width * jnp.diff(s_dtheta) / 8
    before, between, after = (jnp.maximum(q, 0.0) for q in (s[:-1], middle, s[1:]))
    return jnp.sum(jnp.where(keep, width / 6 * (before + 4 * between + after), 0.0))


def greatest(at: Float[Array, " k"], s: Float[Array, " k"], v: Float[Array, " k"], edges):
    """Greatest s at samples between the edges, raised to the crest of the cubic beside it; v is the slope by `at`.

    The place of the crest is held fixed. If a damped contact closes, the crest of its force may lie in its layer. The
    derivative of the crest then includes the shift of the closing, which that of the following sample would not.
    """
    keep = (at >= edges[0]) & (at <= edges[1])
    i = jnp.argmax(jnp.where(keep, s, -jnp.inf))
    j = jnp.clip(jnp.where(v[i] > 0, i, i - 1), 0, len(s) - 2)  # the crest lies between j and j + 1
    h, (v0, v1) = at[j + 1] - at[j], jax.lax.stop_gradient((v[j], v[j + 1]))
    proper = (v0 > 0) & (v1 < 0)
    start, m0, second, third = cubic(s[j], s[j + 1] - s[j], v[j] * h, v[j + 1] * h)
    root = jnp.sqrt(jnp.maximum(second**2 - 3 * third * m0, 0.0))  # the slope falls through zero where it is -2 root
    t = jax.lax.stop_gradient(jnp.where(proper, m0 / (root - second), 0.0))
    proper = proper & (at[j] + t * h >= edges[0]) & (at[j] + t * h <= edges[1])
    crest = start + t * (m0 + t * (second + t * third))
    return jnp.where(proper, crest, jnp.max(jnp.where(keep, s, -jnp.inf)))


def separation_angle(angle: Float[Array, " k"], margin: Float[Array, " k"], edges):
    """Total angle between the edges at which a contact is apart (margin < 0) [rad], crossings linear inside steps."""
    low, high = jnp.minimum(margin[1:], margin[:-1]), jnp.maximum(margin[1:], margin[:-1])
    spread = jnp.where(high > low, high - low, 1.0)
    share = jnp.where(high <= 0, jnp.where(low < 0, 1.0, 0.0), jnp.clip(-low / spread, 0.0, 1.0))
    width = jnp.minimum(angle[1:], edges[1]) - jnp.maximum(angle[:-1], edges[0])
    return jnp.sum(jnp.maximum(width, 0.0) * share)


def greatest_between(angle, values, slopes, edges, sign=1.0):
    """Greatest of sign * values (k) from one angle to another, by cubics with the `slopes` by angle."""
    values, slopes = sign * values, sign * slopes
    ends = (at_angle(angle, values, edge, slopes) for edge in edges)
    return jnp.max(jnp.stack([greatest(angle, values, slopes, edges), *ends]))


def margins(system: System, motion: SystemState, cam_speed) -> tuple[Float[Array, "k e"], Float[Array, "k e"]]:
    """Compression of every element beyond its touch [m], and its derivative by angle [m/rad]."""
    y = jnp.stack([motion.x, motion.v], axis=1)
    margin, rate = jax.vmap(system.compression)(y, motion.lift, motion.lift_dtheta * cam_speed)
    return margin, rate / cam_speed


def seat_distance(system: System, motion: SystemState, cam_speed) -> tuple[Float[Array, " k"], Float[Array, " k"]]:
    """Distance s of the valve from where its seat touches [m], positive open, and its rate [m/s]."""
    return -margins(system, motion, cam_speed)[0][:, system.topology.seat], motion.v[:, system.topology.valve]


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
    s, v = seat_distance(system, motion, cam_speed)
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
    """Shortening [m], at least zero, of the adjusters between cam and valve, from the opening foot to the touch."""
    if motion.memory is None or not system.topology.adjusters:
        return 0.0
    shortening = motion.memory[:, np.array(system.topology.adjusters)].sum(axis=1)
    before = at_angle(motion.angle, shortening, 2 * jnp.pi * revolution + opening_foot)
    return jnp.maximum(0.0, at_angle(motion.angle, shortening, touch) - before)


def nominal_closing(system: System, motion: SystemState, revolution: int, shorter: jax.Array | float = 0.0):
    """Angle [rad] at which the cam lift, a cubic inside a step, has fallen to the lash plus the adjusters' shortening
    `shorter` [m]."""
    lash = shorter + sum(system.gap[e] for e in system.topology.cam_side)
    above = in_revolution(motion.angle, revolution) & (motion.lift > lash)
    i = jnp.clip(len(motion.angle) - 1 - jnp.argmax(above[::-1]), 0, len(motion.angle) - 2)
    width, rise = motion.angle[i + 1] - motion.angle[i], motion.lift[i + 1] - motion.lift[i]
    slopes = motion.lift_dtheta[i + jnp.arange(2)] * width
    t = time_to_fall(cubic(motion.lift[i], rise, *slopes), lash, jnp.where(rise < 0, 1.0, 0.0))
    return motion.angle[i] + t * width


def event_metrics(
    system: System, motion: SystemState, cam_speed, half_duration, revolution: int
) -> dict[str, jax.Array]:
    """Jump and contact forces at angles within half the duration from the nose, at the worst cam-side contact."""
    centre = 2 * jnp.pi * revolution
    edges = (centre - half_duration, centre + half_duration)
    margin, slope = margins(system, motion, cam_speed)
    gap, turn, low, high = [], [], [], []
    for e in system.topology.cam_side:
        pressed = motion.angle, margin[:, e], slope[:, e]
        force = motion.angle, motion.force[:, e], motion.force_dtheta[:, e]
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
    """Bounce, seating and impact velocity, from the closing to the next opening foot.

    The window ends with the record if the record ends first. Without a touch the values are NaN, or 0 if the valve
    never opened; in both cases gradients are zero.
    """
    opened, touches, touch, velocity = closing(system, motion, cam_speed, revolution, layer)
    shorter = leaked(system, motion, touch, opening_foot, revolution)
    nominal = nominal_closing(system, motion, revolution, shorter)
    s, v = seat_distance(system, motion, cam_speed)
    end, begin = 2 * jnp.pi * (revolution + 1) + opening_foot, jnp.minimum(touch, nominal)
    window = (motion.angle >= begin) & (motion.angle <= end)
    hop = jnp.where(nominal < touch, at_angle(motion.angle, s, nominal, v / cam_speed), 0.0)
    crest = greatest(motion.angle, s, v / cam_speed, (begin, end))
    highest = jnp.maximum(jnp.maximum(0.0, hop), crest)
    bounce = jnp.where(highest > layer, highest, 0.0)  # a valve in the layer has not left its seat
    falls = (s[:-1] > layer) & (s[1:] <= layer) & window[1:]
    share = (s[:-1] - layer) / jnp.where(falls, s[:-1] - s[1:], 1.0)
    impact = jnp.max(jnp.where(falls, -(v[:-1] + share * jnp.diff(v)), 0.0))
    values = {
        "bounce_mm": bounce / MM,
        "seating_velocity_m_per_s": jnp.abs(velocity),
        "impact_velocity_m_per_s": jnp.maximum(impact, jnp.abs(velocity)),
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

    `half_duration` and `opening_foot` [rad] belong to the cam; `layer` [m] is as in `closing`.
    """
    s, v = seat_distance(system, motion, cam_speed)
    now = in_revolution(motion.angle, revolution)
    lash = sum(system.gap[e] for e in system.topology.cam_side)
    area = step_integral(motion.angle, s, v / cam_speed, now[1:] & now[:-1])
    excess = jnp.max(jnp.where(now, s - jnp.maximum(0.0, motion.lift - lash), -jnp.inf))
    return {
        **closed_metrics(system, motion, cam_speed, opening_foot, revolution, layer),
        **event_metrics(system, motion, cam_speed, half_duration, revolution),
        "dynamic_area_mm_deg": area / (MM * DEG),
        "excess_lift_mm": excess / MM,
    }
