"""Every family as a JAX function of its free parameters: lift, area and peak values, all of them differentiable.

A family's record (`camopt.cam.families.record`) defines how its event is built from parameters in arrays of NumPy or of
JAX. Here it is built from JAX arrays, so that derivatives are those of the construction itself, its linear solves
included, and exact to round-off. Parameters are a dictionary of arrays, under the names and in the units of the command
line:

    cam = differentiable(scene, multi_pol(scene))
    jax.grad(cam.area)(cam.parameters)["sections_deg"]
    jax.jacobian(cam.lift, argnums=1)(theta, cam.parameters)

A member that was found for the largest area is differentiated at its angles and levels, which are its parameters; the
derivative does not include how the search would change them under other limits. The derivative of a peak value is taken
at the place of the peak, which is held fixed in its piece (Danskin 1966). If two pieces tie, the derivative is that of
the first of them.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import factorial, perm
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from camopt.cam.families.record import Parameters, family_named
from camopt.cam.families.registry import BY_COEFFICIENTS, FAMILIES
from camopt.cam.lift import Lift, whole_turn
from camopt.cam.ramps import Ramp, scene_ramps, symmetric_conditions
from camopt.scene import InputError, Scene
from camopt.scene.shapes import Float
from camopt.scene.units import DEG, MM, MM_PER_DEG

SAMPLES, NEWTON_STEPS = 33, 5
"""Number of samples per piece on which a peak is sought, and number of Newton steps that then place it."""


@dataclass(frozen=True)
class DifferentiableCam:
    """A cam as a function of its parameters; `parameters` holds their current values.

    `moving_pieces(parameters)` gives borders (p + 1) [rad] and coefficients (p, q) [m/rad^k] from -pi to pi, as in
    `Lift` but perhaps with empty pieces; `half_duration(parameters)` is half the angle between the ramp tops [rad]. All
    methods are pure functions of JAX arrays: jit, vmap, grad and jacobian apply.
    """

    family: str
    parameters: Parameters
    moving_pieces: Callable[[Parameters], tuple[jax.Array, jax.Array]]
    half_duration: Callable[[Parameters], Any]
    ramp_foot: float  # rad

    def pieces(self, parameters: Parameters) -> tuple[Float[jax.Array, " edges"], Float[jax.Array, "p q"]]:
        """Borders and coefficients with the values of `moving_pieces`, the borders held constant in derivatives.

        The derivatives of the coefficients are those of the lift at a fixed angle. A motion depends on nothing else,
        because lift and velocity are continuous across a border that moves.
        """
        borders, coefficients = self.moving_pieces(parameters)
        held = jax.lax.stop_gradient(borders)
        away = (held - borders)[:-1]
        orders = range(coefficients.shape[1])
        return held, jnp.stack([polynomial(coefficients, away, k) / factorial(k) for k in orders], axis=1)

    def lift(self, theta, parameters: Parameters, order: int = 0) -> jax.Array:
        """Lift or its derivative by angle [m/rad^order] at `theta` [rad], any shape."""
        borders, coefficients = self.moving_pieces(parameters)
        theta = jnp.mod(jnp.asarray(theta) + jnp.pi, 2 * jnp.pi) - jnp.pi
        piece = jnp.searchsorted(borders, theta, side="right") - 1
        piece = jnp.clip(piece, 0, len(coefficients) - 1)
        return polynomial(coefficients[piece], theta - borders[piece], order)

    def area(self, parameters: Parameters) -> Float[jax.Array, ""]:
        """Integral of the lift over the duration [m rad]."""
        borders, coefficients = self.moving_pieces(parameters)
        half = self.half_duration(parameters)
        powers = np.arange(coefficients.shape[1])
        widths = jnp.diff(borders)[:, None]
        parts = jnp.sum(coefficients * widths ** (powers + 1) / (powers + 1), axis=1)
        middles = 0.5 * (borders[1:] + borders[:-1])
        return jnp.sum(jnp.where(abs(middles) < half, parts, 0.0))

    def motion_parameters(self, parameters: Parameters) -> Parameters:
        """The parameters of this cam for `simulate(parameters=...)` and `exact_metrics`: lift, borders and half
        duration.

        Raises InputError for a ramp without a foot: the velocity has steps at its ends, and the effect of a moving step
        on the motion is not a derivative of the lift.
        """
        if not self.ramp_foot > 0.0:
            raise InputError(
                f"{self.family}: a ramp without a foot steps in velocity, and the motion's derivative by a step that "
                f"moves is not that of the lift: give the ramp a foot ([design] ramp_foot_deg)"
            )
        borders, coefficients = self.pieces(parameters)
        return {"lift": coefficients, "borders": borders, "half_duration": self.half_duration(parameters)}

    def peak(self, parameters: Parameters, order: int = 0, lowest: bool = False) -> Float[jax.Array, ""]:
        """Largest, or with `lowest` smallest, lift or derivative by angle [m/rad^order] over the revolution.

        At the borders of pieces the values from both sides count, so that a step counts with both its sides.
        """
        borders, coefficients = self.moving_pieces(parameters)
        widths = jnp.diff(borders)
        sign = -1.0 if lowest else 1.0
        shares = _peak_shares(*jax.lax.stop_gradient((sign * coefficients, widths)), order)
        values = polynomial(coefficients, shares * widths, order)
        return values[jnp.argmax(sign * values)]


def polynomial(coefficients, x, order: int) -> jax.Array:
    """The derivative `order` of sum_k c_k x^k at x (...); the coefficients (..., q) are in ascending powers."""
    k = np.arange(order, coefficients.shape[-1])
    falling = np.array([float(perm(i, order)) for i in k])
    return jnp.sum(falling * coefficients[..., order:] * x[..., None] ** (k - order), axis=-1)


def _peak_shares(coefficients, widths, order: int) -> jax.Array:
    """The share (p) of its width at which the derivative `order` of each piece (p, q) is largest."""
    grid = np.linspace(0.0, 1.0, SAMPLES)
    shares = jnp.asarray(grid)[jnp.argmax(polynomial(coefficients[:, None, :], grid * widths[:, None], order), axis=1)]

    def newton(_, shares):
        slope, bend = (widths**k * polynomial(coefficients, shares * widths, order + k) for k in (1, 2))
        step = jnp.where(bend < 0, -slope / jnp.where(bend < 0, bend, -1.0), 0.0)
        moved = jnp.clip(shares + step, 0.0, 1.0)
        now, then = (polynomial(coefficients, at * widths, order) for at in (shares, moved))
        return jnp.where(then > now, moved, shares)  # where slope and bend are only round-off, so is a step

    return jax.lax.fori_loop(0, NEWTON_STEPS, newton, shares)


def differentiable(scene: Scene, cam: Lift) -> DifferentiableCam:
    """A family's member as a function of its own free parameters and of the design conditions for which it is built.

    The own parameters of polydyne are `exponents` of at least 8 and `speed_rpm`; of exponent, `exponents`; of a family
    of sections, all `sections_deg` except the last, which takes the rest of half the duration, and every level that the
    conditions at the nose leave free; of new-design, `start_ratio` as well; of the free cam, `z`, its free coefficients
    [mm/deg^2]. All families but the free cam also have the design conditions `duration_deg`, `max_lift_mm`,
    `ramp_height_mm` and `ramp_velocity_mm_per_deg`. Raises InputError for a cam without a family, such as a lift table.
    """
    families = {**FAMILIES, **BY_COEFFICIENTS}
    if cam.family not in families:
        raise InputError(f"cam {cam.family!r} has no parameters to differentiate; take one of {', '.join(families)}")
    family = family_named(cam.family)
    if family.construction is None:
        raise InputError(f"cam {cam.family!r}: its family has no construction to differentiate; take another family")
    conditions, ramps_of, half_duration = (_symmetric if family.symmetric else _as_the_scene)(scene, cam)
    free, event = family.construction(scene, cam)
    parameters = {name: jnp.asarray(value, dtype=float) for name, value in (free | conditions).items()}

    def pieces(p: Parameters) -> tuple[Any, Any]:
        p = {name: jnp.asarray(value, dtype=float) for name, value in p.items()}
        opening, closing = ramps_of(p)
        return whole_turn(*event(p, opening, closing), opening, closing)

    return DifferentiableCam(cam.family, parameters, pieces, half_duration, ramps_of(parameters)[0].foot)


Conditions = tuple[Parameters, Callable[[Parameters], tuple[Ramp, Ramp]], Callable[[Parameters], Any]]
"""The design conditions that are parameters, and functions of the parameters: the ramps and half the duration [rad]."""


def _symmetric(scene: Scene, cam: Lift) -> Conditions:
    """The conditions of a symmetric cam are parameters."""
    design, ramp = symmetric_conditions(scene, cam.family)
    conditions = {
        "duration_deg": design.duration_deg,
        "max_lift_mm": design.max_lift_mm,
        "ramp_height_mm": cam.parameters.get("ramp_height_mm", design.ramp_height_mm),
        "ramp_velocity_mm_per_deg": design.ramp_velocity_mm_per_deg,
    }

    def ramps_of(p: Parameters) -> tuple[Ramp, Ramp]:
        side = Ramp(p["ramp_height_mm"] * MM, p["ramp_velocity_mm_per_deg"] * MM_PER_DEG, ramp.foot)
        return side, side

    return conditions, ramps_of, lambda p: p["duration_deg"] * DEG / 2


def _as_the_scene(scene: Scene, cam: Lift) -> Conditions:
    """The conditions are those of the scene, and none is a parameter."""
    if scene.design is None:
        raise InputError(f"{cam.family}: the scene needs [design]")
    ramps, half = scene_ramps(scene.design), scene.design.duration_deg / 2 * DEG
    return {}, lambda _: ramps, lambda _: half
