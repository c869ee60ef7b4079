"""Curvature, eccentricity, pressure angle and contour along a lift law, durations above a lift, and waves of the jerk.

`camopt.cam.followers` computes the contact of each kind of follower; this module evaluates it along a lift law.

The acceleration of a plain cam rises on the opening flank, falls to the nose, rises after it and falls again: its jerk
changes its sign three times. Every ripple, or wave, adds two changes. At constant acceleration the jerk has no sign.
"""

import numpy as np

from camopt.cam.contact import Contact
from camopt.cam.followers import follower_of
from camopt.cam.lift import Lift
from camopt.scene import InputError
from camopt.scene.geometry import Geometry
from camopt.scene.shapes import Float
from camopt.scene.units import DEG, MM

STEP = 0.05 * DEG
"""Largest spacing of the samples [rad]; every piece is sampled at both its ends, from inside. An extreme between two
samples is missed by about step^2 / 8 times its second derivative, 1e-7 of it."""
CLOSER = 20
"""Factor by which the samples are closer than `STEP` around the extremes of the curvature."""
DURATION_LIFTS_MM = {"1_mm": 1.0, "0.050_in": 1.27}
"""Lifts [mm] at which durations are quoted; 0.050 in is usual where inches are used."""
SIGNLESS = 1e-6
"""Magnitude of the jerk, relative to the largest one, up to which it counts as zero, because it is rounding."""
STEPPED = 1e-6
"""Step of the acceleration, relative to the largest acceleration, above which it counts as an infinite jerk."""


def contact(lift: Lift, geometry: Geometry, theta: Float[np.ndarray, " k"] | None = None) -> Contact:
    """The contact of a cam with its follower at `theta` [rad], of any turn, from the right where a derivative steps. By
    default `theta` covers one turn, with every piece sampled at both its ends and at least every `STEP`. Raises
    InputError if a finger or rocker cannot follow the lift."""
    if theta is None:
        counts = np.ceil(np.diff(lift.borders) / STEP).astype(int) + 1
        ends = zip(lift.borders[:-1], lift.borders[1:], counts, strict=True)
        theta = np.concatenate([np.linspace(start, end, n) for start, end, n in ends])
        piece = np.repeat(np.arange(len(counts)), counts)
        law = [lift.of_piece(piece, theta, order) for order in range(3)]
    else:
        law = [lift(theta, order) for order in range(3)]
    return follower_of(geometry).contact(np.stack(law), theta)


def smallest_radii(lift: Lift, geometry: Geometry) -> tuple[float, float | None]:
    """`Contact.smallest_convex` and `Contact.smallest_concave` of a cam, with samples `CLOSER` times as close around
    every extreme. Raises InputError if a finger or rocker cannot follow the lift."""
    coarse = contact(lift, geometry)
    turns = np.diff(1 / coarse.radius_of_curvature)
    at = coarse.theta[1 + np.flatnonzero(turns[1:] * turns[:-1] < 0)]
    if len(at) == 0:
        return coarse.smallest_convex, coarse.smallest_concave
    fine = contact(lift, geometry, (at[:, None] + STEP * np.linspace(-1, 1, 2 * CLOSER + 1)).ravel())
    concave = [size for samples in (coarse, fine) if (size := samples.smallest_concave) is not None]
    return min(coarse.smallest_convex, fine.smallest_convex), min(concave, default=None)


def crossing(lift: Lift, height: float) -> tuple[float, float]:
    """Cam angles [rad] at which the lift first rises to and last falls from `height` [m] > 0; -pi and pi if it is
    nowhere so low. Raises InputError for a height that is not below the maximum lift."""
    if not 0 < height < lift.max_lift:
        raise InputError(
            f"duration: {height / MM:g} mm is not below the maximum lift: give a lift between zero and "
            f"{lift.max_lift / MM:g} mm"
        )
    roots = lift.roots(0, height)
    return (float(roots.min()), float(roots.max())) if len(roots) else (-np.pi, np.pi)


def sign_changes(lift: Lift) -> Float[np.ndarray, " k"]:
    """The angles [rad] inside the duration at which the jerk changes its sign. Between neighbouring borders and roots
    of the snap the jerk is monotonic, so that no change is missed."""
    half = lift.half_duration
    inside = lift.borders[(lift.borders > -half) & (lift.borders < half)]
    bends = lift.roots(4)
    marks = np.unique(np.concatenate([[-half, half], inside, bends[np.abs(bends) < half]]))
    piece = np.searchsorted(lift.borders, 0.5 * (marks[1:] + marks[:-1])) - 1
    ends, jerk = (lift.of_piece(piece, np.stack([marks[:-1], marks[1:]]), order).T for order in (2, 3))
    step = ends[1:, 0] - ends[:-1, 1]
    steep = np.where(np.abs(step) > STEPPED * np.abs(ends).max(), np.copysign(np.inf, step), 0.0)
    value = np.column_stack([jerk, np.append(steep, 0.0)]).ravel()
    angle = np.column_stack([marks[:-1], marks[1:], marks[1:]]).ravel()
    sign = np.where(np.abs(value) > SIGNLESS * np.abs(jerk).max(), np.sign(value), 0.0)
    signed = np.flatnonzero(sign)
    changed = np.flatnonzero(np.diff(sign[signed]))
    return 0.5 * (angle[signed[changed]] + angle[signed[changed + 1]])
