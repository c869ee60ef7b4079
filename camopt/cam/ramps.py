"""Ramps: a foot that leaves the base circle with continuous acceleration, then constant velocity to the ramp top."""

from dataclasses import dataclass

import numpy as np

from camopt.scene.design import Design
from camopt.scene.errors import InputError
from camopt.scene.schema import Scene
from camopt.scene.units import DEG, MM, MM_PER_DEG

FOOT_VELOCITY = np.array([0.0, 0.0, 0.0, 10.0, -15.0, 6.0])
"""Velocity in the foot as a fraction of the ramp's velocity, in powers of s = 0 (base circle) to 1."""


@dataclass(frozen=True)
class Ramp:
    """The ramp of one side: height [m] at its top, velocity [m/rad], and length of its foot [rad]."""

    height: float
    velocity: float
    foot: float

    def __repr__(self) -> str:
        return (
            f"Ramp(height {self.height / MM:.6g} mm, velocity {self.velocity / MM_PER_DEG:.6g} mm/deg, "
            f"foot {self.foot / DEG:.6g} deg)"
        )

    @property
    def length(self) -> float:
        """Angle from the foot's outer end to the ramp top [rad]; the foot rises velocity * foot / 2."""
        return self.height / self.velocity + self.foot / 2

    def opening_pieces(self, top: float, xp=np) -> tuple[np.ndarray, np.ndarray]:
        """Borders (3) [rad] up to the angle `top` and local coefficients (2, 7) [m/rad^k], without the base circle.
        With `xp` = jax.numpy, `top`, height and velocity may be traced."""
        start = top - self.length
        powers = np.arange(6)
        shape = FOOT_VELOCITY / (powers + 1) / self.foot**powers if self.foot > 0 else np.zeros(6)
        foot, straight = np.append(0.0, shape), np.append([self.foot / 2, 1.0], np.zeros(5))
        return xp.asarray([start, start + self.foot, top]), self.velocity * xp.asarray([foot, straight])


def scene_ramps(design: Design) -> tuple[Ramp, Ramp]:
    """Opening and closing ramp of a scene's design conditions."""
    foot = design.ramp_foot_deg * DEG
    opening, closing = (Ramp(h * MM, v * MM_PER_DEG, foot) for h, v, _ in design.ramps())
    return opening, closing


def symmetric_conditions(scene: Scene, family: str) -> tuple[Design, Ramp]:
    """Design conditions of a scene and the ramp of a symmetric cam. Raises InputError if there is none, or two."""
    if scene.design is None:
        raise InputError(f"{family}: the scene needs [design]")
    opening, closing = scene_ramps(scene.design)
    if opening != closing:
        raise InputError(
            f"{family}: the cam is symmetric, but the scene's closing ramp differs from its opening ramp: leave "
            f"closing_ramp_height_mm and closing_ramp_velocity_mm_per_deg out, or let `camopt optimize` find a cam, "
            f"which may have two ramps"
        )
    return scene.design, opening
