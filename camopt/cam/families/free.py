"""The free cam: a spline cam whose joining and ramp conditions are eliminated by x = x_p + Z z.

Every limit of the design is linear in z or is linearised (`camopt.cam.families.shape_rows`).
"""

from dataclasses import dataclass, field

import numpy as np

from camopt.cam.families.record import BuildEvent, Family, Parameters
from camopt.cam.families.shape_rows import Limits, LinearisationPoint, shape_rows
from camopt.cam.families.spline import SplineCam, basis_lift
from camopt.cam.lift import Lift
from camopt.cam.ramps import Ramp, scene_ramps
from camopt.scene import InputError, Scene
from camopt.scene.design import Design
from camopt.scene.units import DEG


@dataclass(frozen=True)
class FreeCam(SplineCam):
    """A spline cam with the limits of a design; limits that are not linear in the lift are linearised `about` a cam."""

    about: LinearisationPoint = field(default_factory=LinearisationPoint)

    def limits(self, design: Design) -> Limits:
        """The design's limits on the shape as rows on z that hold at every angle."""
        return shape_rows(self, design, self.about)


def free_cam(design: Design, knot_deg: float = 3.0) -> FreeCam:
    """The free cam of a design, with the longest knot interval up to `knot_deg` that divides the duration.

    The spline has the lift, the velocity and zero acceleration of the ramps at both ramp tops. The remaining freedom of
    its coefficients x (n) is that of the free coefficients z (m) [mm/deg^2]. Raises ValueError if no coefficient is
    free.
    """
    half = design.duration_deg / 2 * DEG
    count = int(np.ceil(design.duration_deg / knot_deg - 1e-9))
    if count < 2:
        raise ValueError(
            f"knot_deg must be at most half of duration_deg = {design.duration_deg:g} (given: {knot_deg:g})"
        )
    breaks = np.linspace(-half, half, count + 1)
    opening, closing = scene_ramps(design)
    lift = basis_lift(breaks)
    n = lift.c.shape[2]
    first, last = np.eye(n)[[0, n - 1]]
    conditions = np.stack([first, last, lift.derivative()(half) / half, lift(half) / half**2])
    velocity = -closing.velocity - opening.velocity
    rise = closing.height - opening.height - opening.velocity * 2 * half
    values = np.array([0.0, 0.0, velocity / half, rise / half**2])
    row_scale = np.abs(conditions).max(axis=1)
    conditions, values = conditions / row_scale[:, None], values / row_scale
    q, r = np.linalg.qr(conditions.T, mode="complete")
    x_p = q[:, :4] @ np.linalg.solve(r[:4].T, values)
    x_p += q[:, :4] @ np.linalg.solve(r[:4].T, values - conditions @ x_p)  # one refinement: equalities to round-off
    return FreeCam(breaks, opening, closing, x_p, q[:, 4:])


def free_cam_of(design: Design, cam: Lift) -> tuple[FreeCam, np.ndarray]:
    """The free cam between a design's ramps to which `cam` belongs, and the free coefficients z (m) of `cam`."""
    free = free_cam(design, cam.parameters["knot_deg"])
    return free, free.Z.T @ (np.array(cam.parameters["coefficients_mm_per_deg2"]) - free.x_p)


def _construction(scene: Scene, cam: Lift) -> tuple[Parameters, BuildEvent]:
    """The free coefficients z [mm/deg^2], from which the event is built between the scene's ramps."""
    if scene.design is None:
        raise InputError("free: the scene needs [design]")
    free, z = free_cam_of(scene.design, cam)

    def event(p: Parameters, opening: Ramp, closing: Ramp):
        return p["z"].__array_namespace__().asarray(free.breaks), free.pieces(p["z"])

    return {"z": z}, event


FAMILY = Family("free", construction=_construction, symmetric=False)
